# SPDX-License-Identifier: GPL-3.0-or-later
"""Files are whole or not there, equal data are equal bytes, and a damaged file is one clear sentence."""

from __future__ import annotations

import copy
import errno
import importlib.util
import json
import math
import os
import stat
import sys
import zipfile
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from sample_bake import manifest, read_exr, tactile_frame

from palpate.core.errors import FileError, PalpateError
from palpate.core.geometry.grid_layout import GridLayout
from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.geometry.texels import texels_from_region
from palpate.core.geometry.texture_maps import uv_layout
from palpate.core.io import file_writing, recording_npz, tactile_exr
from palpate.core.io.bake_folder import OWN_DIGEST, folder_names, read_manifest, write_manifest
from palpate.core.io.file_writing import atomic_write, require_space, writable_file, writable_folder
from palpate.core.io.recording_npz import load_recording, save_recording
from palpate.core.io.tactile_exr import CHANNELS, describe, write_exr
from palpate.core.model.recording import SENSOR_FIELDS, Frame, Recording, SensorRecording, VectorReadings
from palpate.core.model.sensor import Effect, Sensor
from palpate.core.model.sensor_parameters import Painted, SensorParameters

on_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at Linux's /proc and /dev")


@contextmanager
def assert_one_sentence(*words):
    """Check that the body is refused in a single line that has these words."""
    with pytest.raises(FileError) as error:
        yield
    text = str(error.value)
    assert isinstance(error.value, PalpateError)
    assert "\n" not in text and text.endswith(".") and ":" in text
    for word in words:
        assert str(word) in text


# --- writing whole files


def test_objects_are_not_written(tmp_path):
    with pytest.raises(ValueError, match="would run code"):
        recording_npz.write_arrays(tmp_path / "a.npz", {"a": np.array([object()])})
    assert os.listdir(tmp_path) == []


def test_new_and_replaced_file(tmp_path):
    target = tmp_path / "a.txt"
    for content in ("first", "second"):
        with atomic_write(target) as temporary:
            assert temporary.parent == tmp_path and temporary.suffix == ".txt" and temporary != target
            temporary.write_text(content)
        assert target.read_text() == content
        assert os.listdir(tmp_path) == ["a.txt"]


def test_error_in_the_body_keeps_the_old_file(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("old")
    for error in (ValueError, KeyboardInterrupt, GeneratorExit):
        with pytest.raises(error), atomic_write(target) as temporary:
            temporary.write_text("half")
            raise error
        assert target.read_text() == "old" and os.listdir(tmp_path) == ["a.txt"]


def test_full_disk(tmp_path, monkeypatch):
    target = tmp_path / "a.txt"
    target.write_text("old")

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(file_writing.os, "replace", full)
    with assert_one_sentence(target, "free some space"), atomic_write(target) as temporary:
        temporary.write_text("new")
    assert target.read_text() == "old" and os.listdir(tmp_path) == ["a.txt"]


def test_link_stays_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    link = tmp_path / "link.txt"
    link.symlink_to(tmp_path / "real" / "a.txt")
    with atomic_write(link) as temporary:
        temporary.write_text("text")
    assert link.is_symlink() and (tmp_path / "real" / "a.txt").read_text() == "text"


def test_umask_decides_who_may_read(tmp_path):
    before = os.umask(0o027)
    try:
        with atomic_write(tmp_path / "a") as temporary:
            temporary.write_text("text")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o640


def assert_cannot_write(path, *words):
    """Check that nothing can be written at `path`."""
    with assert_one_sentence(*words), atomic_write(path) as temporary:
        temporary.write_text("never")


def test_wrong_places(tmp_path):
    (tmp_path / "file").write_text("text")
    assert_cannot_write(tmp_path / "missing" / "a.exr", tmp_path / "missing", "does not exist")
    assert_cannot_write(tmp_path / "file" / "a.exr", tmp_path / "file", "is a file")
    assert_cannot_write(tmp_path / "file" / "deeper" / "a.exr", tmp_path / "file", "is a file")
    assert_cannot_write(tmp_path, tmp_path, "is a folder")
    assert_cannot_write(tmp_path / ("x" * 250), tmp_path, "shorter")
    assert os.listdir(tmp_path) == ["file"] and (tmp_path / "file").read_text() == "text"


def test_a_file_is_checked_before_there_is_work(tmp_path):
    assert writable_file(tmp_path / "a" / "b" / "c.png") == tmp_path / "a" / "b" / "c.png"
    assert (tmp_path / "a" / "b").is_dir() and not any((tmp_path / "a" / "b").iterdir())
    (tmp_path / "link").symlink_to(tmp_path / "a" / "b" / "c.png")
    assert writable_file(tmp_path / "link") == tmp_path / "a" / "b" / "c.png"
    for place in (tmp_path / "a", "", "a\0b", tmp_path / ("x" * 300)):
        with pytest.raises(FileError):
            writable_file(place)
            raise AssertionError(place)


@on_linux
def test_places_where_not_even_root_may_write():
    assert_cannot_write("/proc/a.exr", "/proc")
    with assert_one_sentence("/proc"):
        writable_folder("/proc")
    assert_cannot_write("/dev/null", "/dev/null", "device")
    assert Path("/dev/null").is_char_device()


def test_read_only_folder(tmp_path, monkeypatch):
    def forbidden(*_):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(file_writing.os, "open", forbidden)
    assert_cannot_write(tmp_path / "a.exr", tmp_path, "read-only")
    with assert_one_sentence(tmp_path, "read-only"):
        writable_folder(tmp_path)


def test_read_only_file(tmp_path, monkeypatch):
    target = tmp_path / "a.exr"
    target.write_text("old")
    target.chmod(0o444)
    monkeypatch.setattr(file_writing.os, "access", lambda path, mode: path != target)  # root may write anything
    assert_cannot_write(target, target, "read-only")
    assert target.read_text() == "old"


def test_writable_folder(tmp_path):
    assert writable_folder(tmp_path) == tmp_path
    with assert_one_sentence(tmp_path / "new"):
        writable_folder(tmp_path / "new")
    assert writable_folder(tmp_path / "new", create=True).is_dir()
    assert writable_folder(tmp_path / "new", create=True).is_dir()
    assert writable_folder(tmp_path / "x" / "y" / "z", create=True).is_dir()
    for name in ("", " ", "a\0b", "x" * 300, "x" * 5000):
        with pytest.raises(FileError) as error:
            writable_folder(name, create=True)
        assert "\n" not in str(error.value) and str(error.value).endswith(".")
    (tmp_path / "file").write_text("")
    for place in ("file", "file/deeper"):
        with assert_one_sentence(tmp_path / "file"):
            writable_folder(tmp_path / place, create=True)
    assert sorted(os.listdir(tmp_path)) == ["file", "new", "x"]


def test_a_disk_that_is_too_small_is_named(tmp_path):
    require_space(tmp_path / "not" / "yet", 1.0, "The bake")
    with pytest.raises(FileError, match=r"^The bake needs up to 1\d+ MB and the disk of '.*yet' has \d+ MB left: free"):
        require_space(tmp_path / "not" / "yet", 1e24, "The bake")


def test_a_drive_that_is_not_there_is_named(monkeypatch):
    """As Z: on Windows, of which no folder exists."""
    monkeypatch.setattr(os.path, "exists", lambda _: False)
    with pytest.raises(FileError, match="is on a drive that is not there: choose another folder"):
        require_space("Z:/bakes", 1.0, "The bake")


# --- names


def test_folder_names():
    names = ["Pad", "pad", "Pad 2", "a/b", "a_b", "..", "", "CON", "nul.x", "Daumen ü", "触" * 300, "a\\b", " a", "a\n"]
    chosen = folder_names(names)
    assert list(chosen) == names
    for plain in ("Pad", "Pad 2", "a_b", "Daumen ü"):
        assert chosen[plain] == plain
    folded = [name.casefold() for name in chosen.values()]
    assert len(set(folded)) == len(names)
    for name in chosen.values():
        assert name and name.strip(" .") == name and len(name.encode()) < 250
        assert not set(name) & set('/\\:*?"<>|\n') and name.split(".")[0].lower() not in ("con", "nul")
    assert chosen == folder_names(names)
    assert folder_names(["a/b"])["a/b"] == chosen["a/b"]  # whoever else is there
    stems = folder_names(["Index finger", "Index_finger"], "_")
    assert stems["Index finger"] == "Index_finger" != stems["Index_finger"]


# --- the manifest


def test_manifest_round_trip(tmp_path):
    path = write_manifest(tmp_path, manifest())
    assert path == tmp_path / "manifest.json" and os.listdir(tmp_path) == ["manifest.json"]
    assert read_manifest(tmp_path) == manifest()
    content = json.loads(path.read_text(encoding="utf-8"))
    assert content["format"] == "palpate-bake/1" and content["sensor"] == "Pad ü/1" and content["dt"] == 1 / 3e4
    before = path.read_bytes()
    write_manifest(tmp_path, read_manifest(tmp_path))
    assert path.read_bytes() == before


def test_a_manifest_of_an_older_version_is_one_sentence(tmp_path):
    path = write_manifest(tmp_path, manifest())
    content = json.loads(path.read_bytes())
    for missing in (OWN_DIGEST, "files"):
        path.write_text(json.dumps({key: value for key, value in content.items() if key != missing}), encoding="utf-8")
        with pytest.raises(FileError, match="is of an older version, which did not vouch for the files of a bake: bake again"):
            read_manifest(tmp_path)


@pytest.mark.parametrize("change", [{"fps": 25.0}, {"unit": "N"}, {"parameters": {"k": 58.6}}, {"warnings": []}, {"new": 1}])
def test_a_manifest_vouches_for_itself(tmp_path, change):
    path = write_manifest(tmp_path, manifest())
    path.write_text(json.dumps({**json.loads(path.read_bytes()), **change}), encoding="utf-8")
    with pytest.raises(FileError, match="its content is not what was baked"):
        read_manifest(tmp_path)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), object()])
def test_manifest_without_meaning_is_our_fault(tmp_path, value):
    with pytest.raises(ValueError):
        write_manifest(tmp_path, manifest(parameters={"k": value}))
    assert os.listdir(tmp_path) == []


def test_damaged_manifest(tmp_path):
    with assert_one_sentence(tmp_path, "does not exist"):
        read_manifest(tmp_path)
    path = write_manifest(tmp_path, manifest())
    whole = path.read_bytes()
    good = json.loads(whole)
    broken = [b"", b"{", b"[]", b"null", b"\xff\xfe", whole[: len(whole) // 2], b"[" * 100_000]
    for key in good:
        broken.append(json.dumps({k: v for k, v in good.items() if k != key}).encode())
        for wrong in (None, {"a": []}, [[1]], "text", True):
            if not isinstance(wrong, type(good[key])):
                broken.append(json.dumps({**good, key: wrong}).encode())
    broken.append(json.dumps({**good, "fps": float("nan")}).encode())
    broken.append(json.dumps({**good, "format": "palpate-bake/2"}).encode())
    for content in broken:
        path.write_bytes(content)
        with assert_one_sentence(path):
            read_manifest(tmp_path)
    path.unlink()
    path.mkdir()
    with assert_one_sentence(path):
        read_manifest(tmp_path)


# --- recordings


def recording(seed=0, frames=5, sensors=(("Pad", 6), ("a/b\\..", 3)), bodies=3, channels=False):
    """Return a recording of random numbers, with the awkward ones among them."""
    rng = np.random.default_rng(seed)
    parts = {}
    for name, count in sensors:
        felt = [tactile_frame(count, rng) for _ in range(frames)]
        values = {field: np.stack([getattr(frame, field) for frame in felt]) for field in SENSOR_FIELDS}
        values["shear"][0, 0] = -0.0, 5e-324
        values["reading"][0, :2] = np.finfo(float).max, -np.finfo(float).tiny
        shape = frames, 5, 3
        vectors = VectorReadings(
            rng.normal(size=shape), rng.random(shape) < 0.1, "mT", ("x", "y", "∥"), rng.normal(size=(5, 3))
        )
        parts[name] = SensorRecording(**values, channels=vectors if channels else None)
    return Recording(
        frames=np.arange(-1, frames - 1),
        times=np.arange(frames) / 24,
        sensors=parts,
        body_names=("Würfel", "ball", "")[:bodies],
        poses=rng.normal(size=(frames, bodies, 7)),
        velocities=rng.normal(size=(frames, bodies, 6)),
        dt=1 / 30000,
        digest="0123",
        warnings=("One.", "Zwei ⚠."),
        step_reason="Steps of 1 ms, ⚠.",
    )


def same(a, b):
    """Check that two recordings are equal bit for bit."""
    assert list(a.sensors) == list(b.sensors)
    for item in fields(Recording):
        if item.name == "sensors":
            continue
        x, y = getattr(a, item.name), getattr(b, item.name)
        if isinstance(x, np.ndarray):
            assert x.dtype == y.dtype and x.shape == y.shape and x.tobytes() == y.tobytes()
        else:
            assert x == y and type(x) is type(y)
    for name, sensor in a.sensors.items():
        other = b.sensors[name]
        for x, y in zip(sensor.arrays(), other.arrays(), strict=True):
            assert x.dtype == y.dtype and x.shape == y.shape and x.tobytes() == y.tobytes()
        if sensor.channels is not None:
            assert (sensor.channels.unit, sensor.channels.names) == (other.channels.unit, other.channels.names)
            assert np.array_equal(sensor.channels.place, other.channels.place)


def test_recording_round_trip(tmp_path):
    cases = recording(frames=1), recording(sensors=(), bodies=0), recording(sensors=(("x", 84),)), recording(channels=True)
    for case in (recording(), *cases):
        save_recording(tmp_path / "recording.npz", case)
        same(load_recording(tmp_path / "recording.npz"), case)
        assert os.listdir(tmp_path) == ["recording.npz"]


def test_same_recording_same_bytes(tmp_path, monkeypatch):
    save_recording(tmp_path / "a.npz", recording())
    monkeypatch.setattr("time.time", lambda: 2e9)
    other = copy.deepcopy(recording())
    other.poses = np.asfortranarray(other.poses)
    other.sensors["Pad"].shear = np.repeat(other.sensors["Pad"].shear, 2, axis=1)[:, ::2]
    save_recording(tmp_path / "another name.npz", other)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "another name.npz").read_bytes()
    save_recording(tmp_path / "c.npz", load_recording(tmp_path / "a.npz"))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "c.npz").read_bytes()
    save_recording(tmp_path / "d.npz", recording(seed=1))
    assert (tmp_path / "a.npz").read_bytes() != (tmp_path / "d.npz").read_bytes()


def test_numpy_alone_reads_a_recording(tmp_path):
    save_recording(tmp_path / "recording.npz", recording())
    with np.load(tmp_path / "recording.npz", allow_pickle=False) as members:
        header = json.loads(str(members["header"]))
        assert header["format"] == "palpate-recording/2" and header["sensors"] == ["Pad", "a/b\\.."]
        np.testing.assert_array_equal(members["sensor_1/shear"], recording().sensors["a/b\\.."].shear)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_recording_with_nan_is_our_fault(tmp_path, value):
    save_recording(tmp_path / "recording.npz", recording())
    before = (tmp_path / "recording.npz").read_bytes()
    for place in ("times", "poses", "velocities", "dt", "shear", "net_torque"):
        broken = copy.deepcopy(recording())
        if place == "dt":
            broken.dt = value
        else:
            getattr(broken.sensors["Pad"] if place in ("shear", "net_torque") else broken, place)[-1] = value
        with pytest.raises(ValueError):
            save_recording(tmp_path / "recording.npz", broken)
        assert (tmp_path / "recording.npz").read_bytes() == before
    short = recording()
    short.sensors["Pad"].depth = short.sensors["Pad"].depth[:-1]
    with pytest.raises(ValueError, match="sensor_0/depth"):
        save_recording(tmp_path / "recording.npz", short)
    short = recording()
    short.poses = short.poses.astype(object)
    with pytest.raises(ValueError, match="poses"):
        save_recording(tmp_path / "recording.npz", short)
    assert os.listdir(tmp_path) == ["recording.npz"]


def assert_cannot_load(path, *words):
    """Check that reading gives one sentence with the path."""
    with assert_one_sentence(path, *words):
        load_recording(path)


def test_other_files_are_no_recordings(tmp_path):
    path = tmp_path / "other.npz"
    assert_cannot_load(path, "does not exist")
    assert_cannot_load(tmp_path)
    np.savez(path, a=np.zeros(3))
    assert_cannot_load(path, "not a recording")
    np.savez(path, header=np.array([{"a": 1}], dtype=object))  # a pickle is never opened
    assert_cannot_load(path)
    for header in ("[]", "{}", "nonsense", '{"format": "palpate-recording/9"}', '{"format": "palpate-recording/2"}'):
        np.savez(path, header=np.array(header))
        assert_cannot_load(path)
    with open(path, "wb") as file:
        np.save(file, np.zeros(3))
    assert_cannot_load(path)
    path.write_text("sensor,force\n")
    assert_cannot_load(path)
    save_recording(path, recording())
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    for gone in members:
        with zipfile.ZipFile(path, "w") as archive:
            for name, content in members.items():
                if name != gone:
                    archive.writestr(name, content)
        assert_cannot_load(path)


# --- tactile images


def grid_of(rows, columns, seed=0):
    """Return a grid whose texels come in any order."""
    order = np.random.default_rng(seed).permutation(rows * columns)
    return GridLayout(rows, columns, order // columns, order % columns)


METADATA = {"unit": "kPa", "sensor": "Daumen ü/1", "frame": "12", "time": "0.5", "digest": "ab" * 32, "palpate": "0.1.0"}


@pytest.mark.parametrize("shape", [(14, 6), (2, 2), (1, 7), (50, 33)])
def test_an_image_comes_back(tmp_path, shape):
    layout, frame = grid_of(*shape), tactile_frame(math.prod(shape))
    paths = [tmp_path / "a.exr", tmp_path / "b.exr"]
    for path in paths:
        write_exr(path, layout, frame, METADATA)
    assert paths[0].read_bytes() == paths[1].read_bytes() and len(os.listdir(tmp_path)) == 2
    channels, metadata = read_exr(paths[0])
    assert metadata == METADATA and set(channels) == set(CHANNELS)
    assert {(picture.dtype.name, picture.shape) for picture in channels.values()} == {("float32", shape)}
    for name, values in {
        "R": frame.normal_force,
        "G": frame.shear[:, 0],
        "B": frame.shear[:, 1],
        **{name: getattr(frame, name) for name in ("reading", "depth", "slip", "contact")},
    }.items():
        np.testing.assert_array_equal(channels[name][layout.row, layout.column], values.astype(np.float32))


def test_exr_of_a_texture_map(tmp_path):
    position = np.array([[0, 0, 0], [1, 0, 0], [2, 0.2, 0], [0, 1, 0], [1, 1.2, 0]]) * 1.0
    triangles = np.array([[0, 1, 3], [1, 4, 3], [1, 2, 4]])
    layout, _ = uv_layout(position, np.tile([0, 0, 1.0], (5, 1)), triangles)
    frame = tactile_frame(5)
    frame.contact[:] = [True, False, False, True, True]
    write_exr(tmp_path / "a.exr", layout, frame, {})
    channels, metadata = read_exr(tmp_path / "a.exr")
    assert metadata == {} and channels["R"].shape == layout.shape
    assert set(np.unique(channels["contact"])) == {0.0, 1.0}
    empty = layout.image(np.ones(5)) == 0
    assert empty.any()
    for picture in channels.values():
        assert (picture[empty] == 0).all()
    np.testing.assert_array_equal(channels["reading"], layout.image(frame.reading).astype(np.float32))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 3.5e38, -1e300])
@pytest.mark.parametrize("channel", ["normal_force", "shear", "reading", "slip"])
def test_value_that_no_pixel_can_hold_is_our_fault(tmp_path, value, channel):
    frame = tactile_frame(4)
    getattr(frame, channel)[2] = value
    with pytest.raises(ValueError, match="texel 2"):
        write_exr(tmp_path / "a.exr", grid_of(2, 2), frame, METADATA)
    assert os.listdir(tmp_path) == []


def test_a_library_that_cannot_write_says_the_reason_of_the_system(tmp_path):
    if not os.path.exists("/dev/full"):
        pytest.skip("no disk that is always full")
    pictures = {"R": np.random.default_rng(0).random((200, 300), np.float32)}
    for path, number in (("/dev/full", errno.ENOSPC), (tmp_path / "missing" / "a.exr", errno.ENOENT)):
        with pytest.raises(OSError) as error:
            tactile_exr.write_image(path, pictures, {})
        assert error.value.errno == number


def test_a_name_that_is_no_text_is_written_as_far_as_it_is(tmp_path):
    write_exr(tmp_path / "a.exr", grid_of(2, 2), tactile_frame(4), {"sensor": "pad \udcff"})
    assert read_exr(tmp_path / "a.exr")[1] == {"sensor": "pad ?"}


def test_only_openimageio_can_write_where_the_process_is_linked_against_another_openexr(tmp_path, monkeypatch):
    monkeypatch.setattr(tactile_exr, "library", lambda: "OpenImageIO")
    if importlib.util.find_spec("OpenImageIO") is None:
        with pytest.raises(FileError, match="install it"):
            write_exr(tmp_path / "a.exr", grid_of(2, 2), tactile_frame(4), METADATA)
        return
    test_an_image_comes_back(tmp_path, (14, 6))


def test_the_library_reads_what_an_image_says_of_itself(tmp_path):
    """Units of every channel, whose it is, when, and what it was made from; all channels are 32-bit floats."""
    parameters = SensorParameters(k=123.0, unit="kPa")
    texels = texels_from_region(TriangleMesh(np.eye(3), np.array([[0, 1, 2]])), np.ones(3, bool))
    sensor = Sensor("Daumen ü/1", 0, texels, parameters)
    felt = tactile_frame(3)
    frame = Frame(12, 0.5, {sensor.name: felt}, np.zeros((1, 7)), np.zeros((1, 6)))
    write_exr(tmp_path / "a.exr", texels.layout, felt, describe(sensor, frame, "ab" * 32))
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert set(file.channels()) == set(CHANNELS)
        assert all(channel.type() == OpenEXR.FLOAT for channel in file.channels().values())
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION and file.header()["type"] == OpenEXR.scanlineimage
        about = {key[8:]: value for key, value in file.header().items() if key.startswith("palpate.")}
    assert (about["sensor"], about["frame"], float(about["time"])) == ("Daumen ü/1", "12", 0.5)
    assert {name: about[f"unit.{name}"] for name in CHANNELS} == {
        "R": "N", "G": "N", "B": "N", "reading": "kPa", "depth": "m", "slip": "m/s", "contact": "1"
    }  # fmt: skip
    assert about["digest"] == "ab" * 32 and len(about["parameters"]) == 64
    others = (
        replace(sensor, parameters=replace(parameters, k=124.0)),
        replace(sensor, painted=Painted(friction=np.ones(3))),
        replace(sensor, effects=(Effect("offset", "constant", {"offset": 1.0}),)),
    )
    hashes = {describe(other, frame, "")["parameters"] for other in (sensor, replace(sensor, body=1), *others)}
    assert len(hashes) == 4 and about["parameters"] in hashes
