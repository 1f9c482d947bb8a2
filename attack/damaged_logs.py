# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs of every format that ``palpate rig new`` reads, and files of answers, damaged; what is believed becomes a rig."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.logs.answers import answers_text, confirmed, read_answers
from palpate.core.gap.logs.log_file import read_log
from palpate.core.gap.logs.new_rig import write_rig
from palpate.core.gap.logs.proposal import propose
from palpate.core.jobs.job_runner import run_job

from .damaged_files import Files, Reader, damaged_archive, damaged_bytes, damaged_table, damaged_tree, toml_bytes

COUNT = 60
TIME = np.arange(COUNT) / 20.0
DEPTH = np.interp(TIME, [0.0, 1.0, 1.5, 2.0, 3.0], [0.0, 0.0, 1e-3, 1e-3, 0.0])
READING = 100.0 + 60e3 * DEPTH[:, None] * np.array([1.0, 0.9, 1.1, 1.0])
TABLE = "t (s),depth (mm),R1,R2,R3,R4\n" + "".join(
    f"{t:.3f},{1e3 * d:.4f},{','.join(f'{value:.2f}' for value in row)}\n"
    for t, d, row in zip(TIME, DEPTH, READING, strict=True)
)
ANSWERS = {
    "format": "palpate-log-answers/1",
    "name": "small",
    "sensor": {"grid": {"rows": 2, "columns": 2, "pitch": [0.003, 0.003]}, "unit": "counts"},
    "logger": [
        {
            "files": ["log.csv"],
            "columns": {
                "time": {"name": "t (s)", "unit": "s"},
                "depth": {"name": "depth (mm)", "unit": "mm", "zero": 0.0, "factor": 1.0},
                "texel": {"name": "R{}", "first": 1, "count": 4, "unit": "counts"},
            },
        }
    ],
    "recording": [{"name": "one", "files": ["log.csv"], "use": "fit", "from": 0.1, "to": 2.9}],
}
WRENCH, ARRAY = "geometry_msgs/msg/WrenchStamped", "std_msgs/msg/Float64MultiArray"


# --- good logs


@cache
def arrays_npz() -> bytes:
    """An NPZ file."""
    file = io.BytesIO()
    np.savez(file, time=TIME, depth=DEPTH, taxels=READING.reshape(COUNT, 2, 2))
    return file.getvalue()


@cache
def arrays_mat(is_compressed: bool) -> bytes:
    """A MAT file of version 5 with arrays and a structure."""
    import scipy.io

    file = io.BytesIO()
    inner = {"force": 60e3 * DEPTH, "label": "pad"}
    scipy.io.savemat(file, {"time": TIME, "depth": DEPTH, "taxels": READING, "ft": inner}, do_compression=is_compressed)
    return file.getvalue()


@cache
def arrays_hdf5(is_chunked: bool) -> bytes:
    """An HDF5 file with groups and units."""
    import h5py

    file = io.BytesIO()
    with h5py.File(file, "w") as written:
        group = written.create_group("press")
        how = {"chunks": (20,), "compression": "gzip"} if is_chunked else {}
        group.create_dataset("time", data=TIME, **how)
        group.create_dataset("depth", data=1e3 * DEPTH, **how).attrs["unit"] = "mm"
        group.create_dataset("taxels", data=READING)
    return file.getvalue()


@cache
def json_mcap(is_checked: bool) -> bytes:
    """An MCAP file with messages in JSON; without checksums damage reaches the decoders."""
    from mcap.writer import CompressionType, Writer

    file = io.BytesIO()
    writer = Writer(file, compression=CompressionType.NONE, enable_crcs=is_checked, enable_data_crcs=is_checked)
    writer.start()
    schema = writer.register_schema("Press", "jsonschema", b'{"type": "object"}')
    channel = writer.register_channel("/press", "json", schema)
    for i in range(COUNT):
        stamp = round(1e9 * TIME[i])
        message = {"depth": float(DEPTH[i]), "taxels": READING[i].tolist()}
        writer.add_message(channel, stamp, json.dumps(message).encode(), stamp)
    writer.finish()
    return file.getvalue()


@cache
def ros_bag(kind: str) -> Files:
    """A bag of ROS 1 (``bag``) or ROS 2 (``db3``, ``mcap``): a wrench and an array of readings."""
    from rosbags import rosbag1, rosbag2
    from rosbags.rosbag2.enums import StoragePlugin
    from rosbags.typesys import Stores, get_typestore

    is_first = kind == "bag"
    store = get_typestore(Stores.ROS1_NOETIC if is_first else Stores.ROS2_HUMBLE)
    own = store.types
    vector, stamps = own["geometry_msgs/msg/Vector3"], own["builtin_interfaces/msg/Time"]
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / ("log.bag" if is_first else "log")
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        with rosbag1.Writer(path) if is_first else rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
            force = writer.add_connection("/ft", WRENCH, typestore=store)
            array = writer.add_connection("/taxels", ARRAY, typestore=store)
            code = store.serialize_ros1 if is_first else store.serialize_cdr
            for i in range(COUNT):
                stamp = round(1e9 * (100.0 + TIME[i]))
                when = stamps(*divmod(stamp, 10**9))
                header = own["std_msgs/msg/Header"](*((i,) if is_first else ()), when, "tool")
                wrench = own["geometry_msgs/msg/Wrench"](vector(0.0, 0.0, 60e3 * float(DEPTH[i])), vector(0.0, 0.0, 0.0))
                writer.write(force, stamp, code(own[WRENCH](header, wrench), WRENCH))
                layout = own["std_msgs/msg/MultiArrayLayout"]([], 0)
                writer.write(array, stamp, code(own[ARRAY](layout, READING[i]), ARRAY))
        files = [path] if path.is_file() else sorted(path.iterdir())
        return {f"log/{file.name}" if path.is_dir() else file.name: file.read_bytes() for file in files}


# --- readers


def use(name: str, folder: Path) -> None:
    """Read a log, propose what it is, and write a rig where nothing is open."""
    log = read_log(folder / name)
    for table in log.tables:
        assert {len(column) for column in table.columns.values()} == {table.sample_count}, "columns of several lengths"
        assert not any(np.isinf(column).any() for column in table.columns.values()), "a number that is not finite"
    answers = confirmed(propose([log]))
    answers_text(answers)
    sensor = {"grid": {"rows": 2, "columns": 2, "pitch": [0.003, 0.003]}, "unit": "counts"}
    complete = replace(answers, sensor=sensor)
    if not list(complete.open_questions()):
        _believed(run_job(write_rig([log], complete, folder / "rig")).path)


def _answer(folder: Path) -> None:
    """Write a rig by answers."""
    answers = read_answers(folder / "answers.toml")
    answers_text(answers)
    _believed(run_job(write_rig([read_log(folder / "log.csv")], answers, folder / "rig")).path)


def _believed(path: Path) -> None:
    for trial in read_rig(path).trials:
        assert np.isfinite(trial.time).all() and (np.diff(trial.time) > 0).all(), "times that do not rise"


def _one(name: str, content: st.SearchStrategy[bytes]) -> st.SearchStrategy[Files]:
    return content.map(lambda damaged: {name: damaged})


def _either(made: Callable[[bool], bytes]) -> st.SearchStrategy[bytes]:
    """Damage a file that was written in one of two ways."""
    return st.booleans().flatmap(lambda way: damaged_bytes(made(way)))


def _bags(kind: str) -> st.SearchStrategy[Files]:
    """Bags of which one file is damaged."""
    files = ros_bag(kind)
    return st.sampled_from(sorted(files)).flatmap(
        lambda name: damaged_bytes(files[name]).map(lambda damaged: {**files, name: damaged})
    )


@cache
def readers() -> dict[str, Reader]:
    """Return all readers by name."""
    answers = st.one_of(damaged_tree(ANSWERS).map(toml_bytes), damaged_bytes(toml_bytes(ANSWERS)))
    found = [
        Reader("log: table", _one("log.csv", damaged_table(TABLE, ",")), partial(use, "log.csv")),
        Reader("log: NPZ", _one("log.npz", damaged_archive(arrays_npz())), partial(use, "log.npz")),
        Reader("log: MAT", _one("log.mat", _either(arrays_mat)), partial(use, "log.mat")),
        Reader("log: HDF5", _one("log.h5", _either(arrays_hdf5)), partial(use, "log.h5")),
        Reader("log: MCAP", _one("log.mcap", _either(json_mcap)), partial(use, "log.mcap")),
        Reader("log: bag of ROS 1", _bags("bag"), partial(use, "log.bag")),
        Reader("log: bag of ROS 2, SQLite", _bags("db3"), partial(use, "log")),
        Reader("log: bag of ROS 2, MCAP", _bags("mcap"), partial(use, "log")),
        Reader("log: answers", answers.map(lambda text: {"answers.toml": text, "log.csv": TABLE.encode()}), _answer),
    ]
    return {reader.name: reader for reader in found}
