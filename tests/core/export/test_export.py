# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake read back from its folder is the bake, and every export says the same numbers with their units."""

import csv
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sample_bake import grid_texels, recording_of, round_texels, write_sensor

from palpate.core.errors import FileError, PalpateError
from palpate.core.export import exporter, formats
from palpate.core.export.exporter import export
from palpate.core.export.format_table import FORMATS
from palpate.core.figures import color_maps
from palpate.core.figures.figure_style import FigureStyle
from palpate.core.io.bake_reader import frame_index, read_bake
from palpate.core.io.hidden_folder import LIST_NAME
from palpate.core.io.recording_npz import load_sensor, save_sensor
from palpate.core.jobs import run_job
from palpate.core.model.sensor_parameters import Painted, SensorParameters


def put(folder, name, texels, painted=None, digest="d"):
    """Write the folder of one sensor as a bake leaves it."""
    recording = recording_of(texels)
    recording.sensors["pad"].slip[:] = 0.01
    return write_sensor(folder, name, texels, painted, replace(recording, digest=digest), SensorParameters(unit="V", gain=2.0))


@pytest.fixture
def bake(tmp_path):
    put(tmp_path / "bake", "pad", grid_texels(), Painted(friction=np.linspace(0.5, 2.0, 15)))
    put(tmp_path / "bake", "tip/1", round_texels())
    return read_bake(tmp_path / "bake")


@pytest.mark.parametrize("texels", [grid_texels(), round_texels()], ids=["grid", "uv"])
def test_sensors_come_back_bit_for_bit(tmp_path, texels):
    save_sensor(tmp_path / "a.npz", texels, Painted(gain=np.arange(1.0, len(texels) + 1)))
    found, painted = load_sensor(tmp_path / "a.npz")
    for name in ("vertex", "position", "normal", "tangent", "area"):
        assert getattr(found, name).tobytes() == getattr(texels, name).tobytes()
    assert type(found.layout) is type(texels.layout) and found.layout.shape == texels.layout.shape
    values = np.random.default_rng(0).random(len(texels))
    assert found.layout.image(values).tobytes() == texels.layout.image(values).tobytes()
    assert painted.gain.tolist() == list(range(1, len(texels) + 1)) and painted.k is None


def test_a_folder_gives_all_its_sensors(bake, tmp_path):
    assert list(bake.texels) == ["pad", "tip/1"] == list(bake.recording.sensors)
    assert bake.parameters["pad"].unit == "V"
    assert list(bake.select(["tip/1"]).recording.sensors) == ["tip/1"]
    assert list(read_bake(tmp_path / "bake" / "pad").texels) == ["pad"]
    with pytest.raises(FileError, match="choose from pad, tip/1"):
        bake.select(["thumb"])
    with pytest.raises(FileError, match="from 1 to 10"):
        frame_index(bake.recording, 11)


def test_sensors_of_two_runs_are_not_mixed(tmp_path):
    put(tmp_path, "a", grid_texels(), digest="one")
    put(tmp_path, "b", grid_texels(), digest="two")
    with pytest.raises(FileError, match="of different bakes"):
        read_bake(tmp_path)


@pytest.mark.parametrize("what", ["missing", "empty"])
def test_no_bake_is_one_sentence(tmp_path, what):
    if what == "empty":
        (tmp_path / "empty").mkdir()
    with pytest.raises(FileError, match="bake first"):
        read_bake(tmp_path / what)


def table(path):
    with open(path, newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array(rows, float)


def test_csv_holds_every_texel_and_the_sums(bake, tmp_path):
    run_job(export(bake, "csv", tmp_path / "out"))
    assert sorted(path.name for path in (tmp_path / "out").iterdir())[:3] == [LIST_NAME, "bodies.csv", "pad"]
    felt = bake.recording.sensors["pad"]
    header, rows = table(tmp_path / "out" / "pad" / "normal_force.csv")
    assert header[:3] == ["frame", "time", "texel_0"] and len(header) == 17
    assert rows[:, 0].tolist() == list(range(1, 11))
    np.testing.assert_allclose(rows[:, 1], bake.recording.times, rtol=1e-8)
    np.testing.assert_allclose(rows[:, 2:], felt.normal_force, rtol=1e-8)
    np.testing.assert_allclose(table(tmp_path / "out" / "pad" / "shear_y.csv")[1][:, 2:], felt.shear[:, :, 1], rtol=1e-8)
    header, rows = table(tmp_path / "out" / "pad" / "sums.csv")
    assert rows[3, header.index("normal")] == pytest.approx(felt.normal_force[3].sum())
    header, rows = table(tmp_path / "out" / "pad" / "texels.csv")
    texels = bake.texels["pad"]
    np.testing.assert_allclose(rows[:, header.index("area")], texels.area, rtol=1e-8)
    np.testing.assert_array_equal(rows[:, header.index("row")], texels.layout.row)


def test_npz_and_hdf5_hold_the_same_arrays_in_full_precision(bake, tmp_path):
    h5py = pytest.importorskip("h5py")
    written = run_job(export(bake, "npz", tmp_path / "out")) + run_job(export(bake, "hdf5", tmp_path / "out"))
    assert all(path.is_file() for path in written)
    with h5py.File(tmp_path / "out" / "palpate.h5") as file, np.load(written[0]) as members:
        group = file["sensors/pad"]
        assert group["reading"].attrs["unit"] == "V"
        assert {group[key].attrs["unit"] for key in ("normal_force", "shear", "friction")} == {"N"}
        assert json.loads(group.attrs["parameters"])["gain"] == 2.0
        assert file["sensors/tip_1"].attrs["name"] == "tip/1"
        for key in ("normal_force", "shear", "reading", "net_torque", "texel_position", "texel_row"):
            assert group[key][()].tobytes() == members[key].tobytes()
        assert members["normal_force"].tobytes() == bake.recording.sensors["pad"].normal_force.tobytes()
        assert file["bodies/pad/pose"].shape == (10, 7)


def test_hdf5_without_its_package_says_how_to_get_it(bake, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(PalpateError, match="pip install h5py"):
        run_job(export(bake, "hdf5", tmp_path / "out"))


def test_png_has_one_scale_for_all_sensors(bake, tmp_path):
    from matplotlib.image import imread

    bake.recording.sensors["tip/1"].normal_force[4, 0] = 0.2
    run_job(export(bake, "png", tmp_path / "out", FigureStyle("PAPER", limit=0.4)))
    scale = json.loads((tmp_path / "out" / "pad" / "scale.json").read_text())
    assert scale["last_colour"] == 0.4 and scale["quantity"].endswith("(N)")
    picture = imread(tmp_path / "out" / "pad" / "tactile_0005.png")
    times = picture.shape[0] // 5
    force = bake.recording.sensors["pad"].normal_force[4].reshape(5, 3)
    seen = picture[times // 2 :: times, times // 2 :: times][::-1]  # row 0 is at the bottom
    np.testing.assert_allclose(seen[..., 0], 1.0 - force / 0.4, atol=0.003)
    assert (seen[..., 3] == 1.0).all()
    tip = imread(next((tmp_path / "out").glob("tip_1*")) / "tactile_0005.png")
    assert (tip[..., 3] == 0.0).any()  # nothing there
    assert np.isclose(tip[..., 0][tip[..., 3] > 0].min(), 0.5, atol=0.1)
    assert (color_maps.colors("PAPER", np.array([0.5])) == 0.5).all()


def test_every_format_is_in_the_table(bake, tmp_path):
    """A module of the package is a format, and its place in the table is its bit in a scene's choice."""
    assert list(FORMATS) == ["csv", "npz", "hdf5", "png", "mcap"]
    assert [exporter.exporter_for(name).name for name in FORMATS] == list(FORMATS)
    modules = {path.stem for path in Path(formats.__file__).parent.glob("*.py")} - {"__init__"}
    assert modules == {one.module for one in FORMATS.values()}
    with pytest.raises(PalpateError, match="choose from csv, npz, hdf5, png, mcap"):
        run_job(export(bake, "xls", tmp_path))


# --- an export after another one


@pytest.mark.parametrize("content", ["", "[]", "{", "[" * 100_000, '{"format": "palpate-export/1", "exports": {"npz": 3}}'])
def test_a_damaged_list_is_as_none(bake, tmp_path, content):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / LIST_NAME).write_text(content)
    run_job(export(bake, "npz", tmp_path / "out"))
    assert json.loads((tmp_path / "out" / LIST_NAME).read_text())["exports"]["npz"]["files"]


@pytest.mark.parametrize("kind", ["csv", "npz", "hdf5", "png", "mcap"])
def test_a_full_disk_is_one_sentence(bake, tmp_path, kind):
    """In a process of its own, whose files cannot grow: a library that writes by itself could take the tests with it."""
    pytest.importorskip("resource")
    script = FULL_DISK.format(bake=str(tmp_path / "bake"), kind=kind, out=str(tmp_path / "out"))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env={**os.environ, **PATH})
    assert done.returncode == 0, done.stderr
    assert re.search(r"could not be written \(.*\): ", done.stdout), done.stdout
    assert not list((tmp_path / "out").rglob("*partial*"))


FULL_DISK = """
import resource, signal
from palpate.core.errors import FileError
from palpate.core.io.hidden_folder import LIST_FORMAT, LIST_NAME
from palpate.core.export.exporter import export, exporter_for
from palpate.core.io.bake_reader import read_bake
from palpate.core.jobs import run_job
import matplotlib.image
bake = read_bake({bake!r})
exporter_for({kind!r})
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
try:
    run_job(export(bake, {kind!r}, {out!r}))
except FileError as error:
    print(error)
"""
PATH = {"PYTHONPATH": str(Path(exporter.__file__).parents[3])}


def test_hdf5_of_large_arrays_is_packed(tmp_path):
    """The numbers are the same, and the same bytes are written twice."""
    h5py = pytest.importorskip("h5py")
    write_sensor(tmp_path / "bake", "pad", grid_texels(), recording=recording_of(grid_texels(), 600))
    bake = read_bake(tmp_path / "bake")
    files = [run_job(export(bake, "hdf5", tmp_path / name))[0] for name in ("one", "two")]
    assert files[0].read_bytes() == files[1].read_bytes()
    with h5py.File(files[0]) as file:
        found = file["sensors/pad/shear"]
        assert found.chunks is not None and found.attrs["unit"] == "N"
        assert np.array_equal(found[:], bake.recording.sensors["pad"].shear)
        assert np.array_equal(file["bodies/pad/pose"][:], bake.recording.poses[:, 0])


def test_the_name_of_a_body_is_no_formula_in_a_table(bake, tmp_path):
    evil = "=cmd|' /C calc'!A0"
    recording = replace(bake.recording, body_names=(evil, *bake.recording.body_names[1:]))
    run_job(export(replace(bake, recording=recording), "csv", tmp_path / "out"))
    for path in (tmp_path / "out").rglob("*.csv"):
        with path.open(newline="", encoding="utf-8") as file:
            header = next(csv.reader(file))
        assert not [name for name in header if name[0] in "=+-@"]
        if path.name == "bodies.csv":
            assert header[2] == f"'{evil} x"
