# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake is believed only when its files are whole, hold what a bake holds, and belong together."""

import json
import shutil

import numpy as np
import pytest
from sample_bake import write_bake

from palpate.core.errors import FileError
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.npz import write_arrays


@pytest.fixture
def bake(tmp_path):
    write_bake(tmp_path / "bake")
    return tmp_path / "bake"


def change_array(path, name, change):
    """Write an archive again with one array changed; None leaves it out."""
    with np.load(path) as members:
        arrays = {key: members[key] for key in members.files}
    changed = change(arrays.pop(name))
    write_arrays(path, arrays if changed is None else {**arrays, name: changed})


def with_value(value):
    """Return a change that puts a value into an array's last place."""

    def change(array):
        array = array.copy()
        array.flat[-1] = value
        return array

    return change


GENERAL = {
    "left out": lambda array: None,
    "one entry fewer": lambda array: array[:-1],
    "one axis more": lambda array: array[..., None],
    "a single value": lambda array: array.flat[0],
    "empty": lambda array: array[:0],
    "complex": lambda array: array + 1j,
    "text": lambda array: array.astype("U8"),
    "half precision numbers of dates": lambda array: np.zeros(array.shape, "datetime64[s]"),
}
RECORDED = ["frames", "times", "poses", "velocities", "sensor_0/normal_force", "sensor_0/shear", "sensor_0/contact"]
RECORDED += ["sensor_0/reading", "sensor_0/net_torque", "sensor_0/centre_of_pressure"]
OF_PAD = ["vertex", "position", "normal", "tangent", "area", "layout/row", "layout/column", "layout/triangles", "painted/k"]
OF_CAP = ["layout/triangles", "layout/corner_uv", "layout/height", "layout/nearest"]
PLACES = [("pad/recording.npz", name) for name in RECORDED]
PLACES += [("pad/sensor.npz", name) for name in OF_PAD] + [("cap/sensor.npz", name) for name in OF_CAP]
MEANT = {("painted/k", "left out"), ("layout/triangles", "empty"), ("layout/triangles", "one entry fewer")}
MEANT |= {("layout/triangles", "left out"), ("layout/nearest", "left out"), ("layout/nearest", "a single value")}
MEANT |= {("layout/height", "a single value"), ("layout/height", "empty")}
"""What the format allows: painted factors, and what has a default, may be left out; a grid may have any of its triangles."""
ONE_VALUE = {"layout/height", "layout/nearest"}


@pytest.mark.parametrize(("file", "name"), PLACES)
def test_arrays_of_another_shape_or_type_are_refused(bake, tmp_path, file, name):
    read_bake(bake)
    for what, change in GENERAL.items():
        if (name, what) in MEANT or (name in ONE_VALUE and what in ("one entry fewer", "empty")):
            continue
        shutil.copytree(bake, tmp_path / "damaged", dirs_exist_ok=True)
        change_array(tmp_path / "damaged" / file, name, change)
        with pytest.raises(FileError, match=file.split("/")[1]):
            read_bake(tmp_path / "damaged")
            raise AssertionError(f"{name}, {what}: believed")


@pytest.mark.parametrize(
    ("file", "name", "change"),
    [
        ("pad/recording.npz", "frames", lambda frames: np.r_[frames[:-1], frames[-2]]),
        ("pad/recording.npz", "frames", lambda frames: frames[::-1]),
        ("pad/recording.npz", "frames", lambda frames: frames + 1),
        ("pad/recording.npz", "times", lambda times: times * 2),
        ("pad/recording.npz", "times", with_value(np.nan)),
        ("pad/recording.npz", "poses", with_value(np.inf)),
        ("pad/recording.npz", "poses", with_value(3.0)),
        ("pad/recording.npz", "sensor_0/normal_force", with_value(np.nan)),
        ("pad/recording.npz", "sensor_0/depth", with_value(-1.0)),
        ("pad/sensor.npz", "position", with_value(np.nan)),
        ("pad/sensor.npz", "normal", with_value(2.0)),
        ("pad/sensor.npz", "area", with_value(-1.0)),
        ("pad/sensor.npz", "layout/row", with_value(99)),
        ("pad/sensor.npz", "layout/row", with_value(-1)),
        ("pad/sensor.npz", "layout/column", with_value(1)),
        ("pad/sensor.npz", "layout/triangles", with_value(99)),
        ("pad/sensor.npz", "layout/rows", with_value(6)),
        ("pad/sensor.npz", "painted/k", with_value(0.0)),
        ("pad/sensor.npz", "painted/k", with_value(np.nan)),
        ("cap/sensor.npz", "layout/triangles", with_value(-1)),
        ("cap/sensor.npz", "layout/corner_uv", with_value(7.0)),
        ("cap/sensor.npz", "layout/margin", with_value(-3)),
    ],
)
def test_values_that_no_bake_has_are_refused(bake, file, name, change):
    change_array(bake / file, name, change)
    with pytest.raises(FileError, match=file.split("/")[1]):
        read_bake(bake)


@pytest.mark.parametrize(
    "change",
    [
        {"fps": 0.0},
        {"fps": -24.0},
        {"fps": 25.0},
        {"dt": 0.0},
        {"dt": 2e-4},
        {"frame_start": 2},
        {"frame_end": 11},
        {"frame_start": 10**30, "frame_end": 10**31},
        {"shape": [0, 3]},
        {"shape": [3, 5]},
        {"shape": [10**9, 10**9]},
        {"shape": [1e300, 1]},
        {"sensor": ""},
        {"sensor": "other"},
        {"body": "no such body"},
        {"parameters": {"k": "stiff"}},
        {"parameters": {"k": -1.0}},
        {"parameters": {"k": float("nan")}},
        {"parameters": {"k": 10**400}},
        {"parameters": {"unit": 3}},
        {"parameters": {"points_per_texel": 5}},
    ],
    ids=str,
)
def test_manifests_that_do_not_describe_the_bake_are_refused(bake, change):
    path = bake / "pad" / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(FileError, match="pad"):
        read_bake(bake)


def test_texels_of_another_sensor_are_refused(bake):
    shutil.copy(bake / "cap" / "sensor.npz", bake / "pad" / "sensor.npz")
    with pytest.raises(FileError, match="pixels"):
        read_bake(bake)


def test_a_recording_of_another_sensor_is_refused(bake):
    shutil.copy(bake / "cap" / "recording.npz", bake / "pad" / "recording.npz")
    with pytest.raises(FileError, match="it is of 'cap' and not of 'pad'"):
        read_bake(bake)


def test_a_sensor_is_read_once(bake):
    shutil.copytree(bake / "pad", bake / "pad copy")
    with pytest.raises(FileError, match="both hold the sensor 'pad'"):
        read_bake(bake)


def test_sensors_whose_bodies_move_differently_are_not_of_one_bake(bake):
    change_array(bake / "pad" / "recording.npz", "velocities", with_value(1.0))
    with pytest.raises(FileError, match="not of the same bake"):
        read_bake(bake)
