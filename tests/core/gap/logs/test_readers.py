# SPDX-License-Identifier: GPL-3.0-or-later
"""What other people's programs write is read with its numbers, names and units; what is broken is one sentence."""

from __future__ import annotations

import json
import os
import struct
import zipfile
from pathlib import Path

import bad_files
import numpy as np
import pytest
from bad_files import write_bag

from palpate.core.errors import FileError
from palpate.core.gap.logs.log_file import read_log
from palpate.core.gap.logs.readers.damaged_file import SMALL_FILE, damage_said
from palpate.core.gap.logs.readers.message_columns import TopicColumns

TIME = np.arange(40) / 100.0
FORCE = np.sin(TIME * 20.0) * 3.0


def table_of(path, name=""):
    (found,) = [table for table in read_log(path).tables if table.name == name]
    return found


# --- tables of text


@pytest.mark.parametrize(
    ("header", "separator", "decimal", "names", "units"),
    [
        ("t,Fz (N)\n", ",", ".", ["t", "Fz (N)"], {}),
        ("t;Fz\ns;mN\n", ";", ",", ["t", "Fz"], {"t": "s", "Fz": "mN"}),
        ("t,t\n", ",", ".", ["t", "t 2"], {}),
    ],
)
def test_tables_of_text_as_loggers_write_them(tmp_path, header, separator, decimal, names, units):
    rows = [separator.join(f"{value:.6f}".replace(".", decimal) for value in row) for row in zip(TIME, FORCE)]
    (tmp_path / "log.txt").write_text(header + "\n".join(rows) + "\n")
    table = table_of(tmp_path / "log.txt")
    assert list(table.columns) == names and table.units == units
    np.testing.assert_allclose(table.columns[names[1]], FORCE, atol=1e-6)


def test_text_in_a_table_is_left_out_and_said(tmp_path):
    rows = [f"{t},{f},{'' if i == 3 else 'go' if i == 5 else f},ok" for i, (t, f) in enumerate(zip(TIME, FORCE))]
    (tmp_path / "log.csv").write_text("t,F,G,state\n" + "\n".join(rows))
    log = read_log(tmp_path / "log.csv")
    assert list(log.tables[0].columns) == ["t", "F", "G"]
    assert np.flatnonzero(np.isnan(log.tables[0].columns["G"])).tolist() == [3, 5]
    assert any("'state' holds no numbers" in note for note in log.notes) and any("1 cell with text" in n for n in log.notes)


def test_a_name_that_no_text_can_hold_is_one_sentence(tmp_path):
    path = tmp_path / os.fsdecode(b"pr\xff.csv")
    path.write_text("t,F\n0,1\n")
    with pytest.raises(FileError, match="is not UTF-8: rename it"):
        read_log(path)


# --- arrays


def arrays():
    pictures = FORCE[:, None, None] * np.ones((1, 3, 2))
    return {"t": TIME, "pose": np.stack([TIME, FORCE, TIME], 1), "taxels": pictures, "gain": 2.0}


def check_arrays(table):
    np.testing.assert_array_equal(table.columns["t"], TIME)
    np.testing.assert_array_equal(table.columns["pose_1"], FORCE)
    np.testing.assert_array_equal(table.columns["taxels_5"], FORCE)
    assert table.grids == {"taxels": (3, 2)} and "gain" not in table.columns


def test_npz(tmp_path):
    np.savez_compressed(tmp_path / "log.npz", **arrays(), text=np.array(["a"]))
    check_arrays(table_of(tmp_path / "log.npz"))
    assert "'text' holds no plain numbers" in read_log(tmp_path / "log.npz").notes[0]


def test_mat(tmp_path):
    savemat = pytest.importorskip("scipy.io").savemat
    savemat(tmp_path / "log.mat", {**arrays(), "run": {"force": FORCE[None], "time": TIME}})
    check_arrays(table_of(tmp_path / "log.mat"))
    assert np.array_equal(table_of(tmp_path / "log.mat", "run").columns["force"], FORCE)


def test_hdf5_with_units_and_mat_7_3(tmp_path):
    h5py = pytest.importorskip("h5py")
    for name, before in (("log.h5", 0), ("log.mat", 512)):
        with h5py.File(tmp_path / name, "w", userblock_size=before) as file:
            for key, values in arrays().items():
                file[f"run/{key}"] = np.asarray(values).T if before and key == "pose" else values
            file["run/pose"].attrs["unit"] = "mm"
        if before:
            with open(tmp_path / name, "r+b") as file:
                file.write(b"MATLAB 7.3 MAT-file")
        found = table_of(tmp_path / name, "run")
        check_arrays(found)
        assert found.units == {f"pose_{i}": "mm" for i in range(3)}


# --- messages


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_bags_of_ros_2_without_ros(tmp_path, storage):
    write_bag(folder := tmp_path / "bag", storage)
    (file,) = folder.glob("bag.*")
    for path in (folder, file):
        force, readings = table_of(path, "/geometry_msgs/msg/WrenchStamped"), table_of(path, "/std_msgs/msg/Float64MultiArray")
        np.testing.assert_array_equal(force.columns["wrench.force.z"], 60e3 * bad_files.DEPTH)
        np.testing.assert_allclose(force.columns["time"], 100.0 + bad_files.TIME, atol=1e-9)  # of the header
        np.testing.assert_allclose(readings.columns["time"], 100.003 + bad_files.TIME, atol=1e-6)  # of the recorder: no header
        np.testing.assert_array_equal(readings.columns["data_3"], bad_files.READING[:, 3])


def test_constants_of_a_type_of_message_are_no_columns():
    typesys = pytest.importorskip("rosbags.typesys")
    kinds = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).types
    columns = TopicColumns("/range", Path("a.mcap"))
    header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](1, 0), "")
    for i in range(10):
        columns.add(kinds["sensor_msgs/msg/Range"](header, 1, 0.1, 0.0, 4.0, float(i)), i * 10**9)
    table, _ = columns.table()
    assert set(table.columns) == {"time", "radiation_type", "field_of_view", "min_range", "max_range", "range"}


def test_a_damaged_length_that_asks_for_all_memory_is_damage(tmp_path):
    """Of a small file; a large one may need more memory than there is."""
    path = tmp_path / "log.mcap"
    path.write_bytes(b"x")
    with (
        pytest.raises(FileError, match="^'log.mcap' could not be read as MCAP .MemoryError.: it is damaged"),
        damage_said(path, "MCAP"),
    ):
        raise MemoryError
    with path.open("r+b") as file:
        file.truncate(SMALL_FILE + 1)
    with pytest.raises(MemoryError), damage_said(path, "MCAP"):
        raise MemoryError


def write_json_mcap(path):
    writer_of = pytest.importorskip("mcap.writer")
    with path.open("wb") as file:
        writer = writer_of.Writer(file)
        writer.start()
        schema = writer.register_schema("force", "jsonschema", b"{}")
        channel = writer.register_channel("/force", "json", schema)
        picture = writer.register_schema("foxglove.CompressedImage", "protobuf", b"")
        other = writer.register_channel("/camera", "protobuf", picture)
        for i, force in enumerate(FORCE):
            message = json.dumps({"timestamp": {"sec": i, "nsec": 5}, "value": force, "raw": [i, 2 * i], "unit": "N"})
            writer.add_message(channel, i * 10**9, message.encode(), i * 10**9)
            writer.add_message(other, i * 10**9, b"?", i * 10**9)
        writer.finish()
    return path


def test_mcap_with_json(tmp_path):
    path = write_json_mcap(tmp_path / "log.mcap")
    table = table_of(path, "/force")
    assert np.array_equal(table.columns["value"], FORCE) and table.columns["raw_1"][3] == 6.0
    assert table.columns["time"][2] == 2.000000005
    assert "/camera (foxglove.CompressedImage) is not read" in read_log(path).notes[0]


def test_what_json_may_hold_besides_numbers_is_left_out():
    columns = TopicColumns("/force", Path("a.mcap"))
    for i in range(10):
        message = {"force": float(i), "count": 10**400, "ragged": [1, [2, 3]], "point_step": 4, "raw": [1, 2.5]}
        columns.add(message, i * 10**9)
    table, _ = columns.table()
    assert set(table.columns) == {"time", "force", "count", "point_step", "raw_0", "raw_1"}
    assert np.isnan(table.columns["count"]).all() and table.columns["force"][3] == 3.0


def test_mcap_with_topics_of_both_versions_of_ros(tmp_path):
    """Their headers have one name and different fields: each channel has types of its own."""
    writer_of = pytest.importorskip("mcap.writer")
    rule, path = "=" * 80, tmp_path / "both.mcap"
    forms = {
        "ros1": f"Header header\nfloat64 value\n{rule}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id",
        "ros2": f"std_msgs/Header header\nfloat64 value\n{rule}\nMSG: std_msgs/Header\n"
        f"builtin_interfaces/Time stamp\nstring frame_id\n{rule}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec",
    }
    with path.open("wb") as file:
        writer = writer_of.Writer(file)
        writer.start()
        for number, (name, text) in enumerate(forms.items()):
            schema = writer.register_schema(("skin/Force", "skin/msg/Force")[number], f"{name}msg", text.encode())
            channel = writer.register_channel(f"/{name}", ("ros1", "cdr")[number], schema)
            for i, force in enumerate(FORCE):
                stamp = struct.pack("<IIII", i, i, 5, 0) if name == "ros1" else b"\0\1\0\0" + struct.pack("<iII4x", i, 5, 1)
                writer.add_message(channel, i * 10**9, stamp + struct.pack("<d", force), i * 10**9)
        writer.finish()
    for name in forms:
        columns = table_of(path, f"/{name}").columns
        assert np.array_equal(columns["value"], FORCE) and columns["time"][2] == 2.000000005


# --- what cannot be read is one sentence


@pytest.mark.parametrize("kind", ["mcap", "db3", "npz", "mat", "h5"])
def test_a_log_that_is_cut_off_is_one_sentence(tmp_path, kind):
    path = tmp_path / f"log.{kind}"
    (content,) = [content for name, content in bad_files.log_files(kind).items() if name.endswith(kind)]
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(FileError, match=r"^'log.*: .*copy it again|^'log.* holds no array") as caught:
        read_log(path)
    assert str(caught.value).count(". ") == 0


@pytest.mark.parametrize("name", ["log.csv", "log.mcap", "log.h5"])
def test_a_fifo_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(FileError, match="is a FIFO"):
        read_log(tmp_path / name)


def test_headers_that_promise_more_than_there_is_take_no_memory(tmp_path):
    with zipfile.ZipFile(tmp_path / "log.npz", "w") as archive:
        header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (999999999999, 8), }".ljust(117) + b"\n"
        archive.writestr("a.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header)
    with pytest.raises(FileError, match="cut it into several files"):
        read_log(tmp_path / "log.npz")
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("force", (10**11, 10), "f8", chunks=(1000, 10))
    with pytest.raises(FileError, match="cut it into several files"):
        read_log(tmp_path / "log.h5")
    content = bytearray(bad_files.log_files("mcap")["log.mcap"])
    place = content.index(b"\x06", 8)  # the chunk: its length, two times, and the size of what is in it
    content[place + 1 + 8 + 16 : place + 1 + 8 + 24] = struct.pack("<Q", 1 << 50)
    (tmp_path / "log.mcap").write_bytes(content)
    with pytest.raises(FileError, match="chunk of 1,125,899,906,842,624 bytes"):
        read_log(tmp_path / "log.mcap")


def test_what_leads_out_of_a_file_is_not_followed(tmp_path):
    h5py = pytest.importorskip("h5py")
    (tmp_path / "secret").write_bytes(np.arange(40.0).tobytes())
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["time"] = TIME
        file.create_dataset("stolen", (40,), "f8", external=[(str(tmp_path / "secret"), 0, 320)])
        file["link"] = h5py.ExternalLink("other.h5", "/x")
    log = read_log(tmp_path / "log.h5")
    assert list(log.tables[0].columns) == ["time"] and "'stolen' lies in another file" in log.notes[0]


def test_pickles_are_not_opened(tmp_path):
    class Evil:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "opened"),)

    np.savez(tmp_path / "log.npz", evil=np.array([Evil()], object), t=TIME)
    assert list(table_of(tmp_path / "log.npz").columns) == ["t"]
    assert not (tmp_path / "opened").exists()


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.csv", b"", "is empty"),
        ("a.csv", b"a,b\n" * 20, "holds no numbers"),
        ("a.csv", b"\xff\xfe\x00t" * 20, "not a text file"),
        ("a.csv", b"1" * (2 << 20), "characters: this is no table"),
        ("a.pdf", b"%PDF-1.7 and so on", "no log that is known"),
        ("a.bag", b"#ROSBAG V2.0\n" + b"\xff" * 300, "damaged or cut off"),
        ("a.mcap", b"\x89MCAP0\r\n" + b"\xff" * 300, "damaged or cut off"),
        ("a.h5", b"\x89HDF\r\n\x1a\n" + b"\xff" * 300, "damaged or cut off"),
    ],
)
def test_what_is_no_log_is_one_sentence(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=sentence):
        read_log(tmp_path / name)


def test_a_folder_without_a_bag_and_a_missing_file_are_named(tmp_path):
    with pytest.raises(FileError, match="holds no bag"):
        read_log(tmp_path)
    with pytest.raises(FileError, match="There is no file"):
        read_log(tmp_path / "gone.csv")


def test_a_fifo_in_the_folder_of_a_bag_is_not_waited_for(tmp_path):
    write_bag(folder := tmp_path / "bag")
    (folder / "metadata.yaml").unlink()
    os.mkfifo(folder / "metadata.yaml")
    with pytest.raises(FileError, match="is a FIFO"):
        read_log(folder)
