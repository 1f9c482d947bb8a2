# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs are read as docs/rig-format.md says, and each bad one gets a sentence that names what, where, and what to do."""

import json
from dataclasses import asdict

import numpy as np
import pytest
import trimesh
from rig_files import RIG, TEXELS, table, write

from palpate.benchmarks._recordings import Recording
from palpate.core.errors import PalpateError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.io import csv_table
from palpate.core.model.sensor_parameters import SensorParameters


def edited(row, column, value, **options):
    rows = table(**options)
    rows[row][rows[0].index(column)] = value
    return rows


def with_values(column, factor, add=0.0):
    rows = table()
    at = rows[0].index(column)
    return [rows[0], *([*row[:at], str(float(row[at]) * factor + add), *row[at + 1 :]] for row in rows[1:])]


def without(column, **options):
    rows = table(**options)
    at = rows[0].index(column)
    return [row[:at] + row[at + 1 :] for row in rows]


def test_a_rig_is_read(tmp_path):
    rows = edited(4, "texel_3", "")
    rig = read_rig(write(tmp_path, press=rows))
    assert [trial.use for trial in rig.trials] == ["fit", "check"]
    assert len(rig.texels) == TEXELS
    # Texel 0 is row 0, column 0; columns run along +x, rows along +y, the grid is centred in z = 0.
    np.testing.assert_allclose(rig.texels.position[:3], [[-0.0015, -0.004, 0], [0.0015, -0.004, 0], [-0.0015, 0.0, 0]])
    assert rig.parameters.k == 80.0 and rig.parameters.cn == pytest.approx(0.8)  # 1 % of k in number
    assert rig.parameters.max_penetration == 0.012  # twice the thickness
    trial = rig.trials[0]
    assert trial.stimulus == "pose" and trial.position.shape == (20, 3)
    assert np.isnan(trial.reading[3, 3]) and np.isnan(trial.reading).sum() == 1


def test_a_rig_knows_every_word_that_a_sensor_file_knows(tmp_path):
    """Choices and whole numbers too; a pad that follows Hunt and Crossley is described as anywhere else."""
    words = {**asdict(SensorParameters()), "normal_law": "hunt-crossley", "exponent": 1.25, "points_per_texel": 4, "unit": "V"}
    text = "\n".join(f"{key} = {json.dumps(value)}" for key, value in words.items())
    rig = read_rig(write(tmp_path, RIG.replace("k = 80.0", text)))
    assert rig.parameters == SensorParameters(**words)
    assert rig.given == set(words)


def test_other_stimuli_meshes_and_forces(tmp_path):
    trimesh.creation.box((0.02, 0.02, 0.02)).export(tmp_path / "pad.ply")
    rig = RIG.replace("grid = { rows = 3, columns = 2, pitch = [0.003, 0.004] }", 'mesh = "pad.ply"')
    names = ("depth", "slide_x", "slide_y", "force_x", "force_z")
    press, again = table(names=names, texels=0), table(names=("force",), texels=8)
    found = read_rig(write(tmp_path, rig, press=press, again=again))
    assert len(found.texels) == 8
    one, two = found.trials
    assert one.stimulus == "depth" and one.reading is None
    assert np.isnan(one.force[:, 1]).all() and not np.isnan(one.force[:, [0, 2]]).any()
    assert two.stimulus == "force" and two.reading.shape == (20, 8)


def test_an_indenter_whose_faces_point_inwards_is_turned(tmp_path):
    solid = trimesh.creation.box((0.02, 0.02, 0.02))
    solid.invert()
    solid.export(tmp_path / "probe.ply")
    indenter = next(line for line in RIG.splitlines() if line.startswith("shape"))
    with pytest.warns(UserWarning, match="faces of 'the indenter' point inwards"):
        mesh = read_rig(write(tmp_path, RIG.replace(indenter, 'mesh = "probe.ply"'))).indenter.mesh
    assert trimesh.Trimesh(mesh.vertices, mesh.triangles).volume == pytest.approx(8e-6)


BAD = {
    "missing column time": (dict(press=without("time")), "no column `time`"),
    "missing column of the pose": (dict(press=without("y")), "no column y"),
    "missing texel": (dict(press=without("texel_4")), "no column texel_4"),
    "texel numbered wrong": (dict(press=edited(0, "texel_4", "texel_9")), "no column texel_4"),
    "no stimulus": (dict(press=table(names=())), "no stimulus"),
    "two stimuli": (dict(press=table(names=("depth", "force"))), "more than one stimulus"),
    "no response": (dict(press=table(texels=0)), "no response"),
    "time backwards": (dict(press=edited(7, "time", "0.01")), "goes backwards at line 8"),
    "time stands": (dict(press=edited(7, "time", "0.1")), "stands still at line 8"),
    "time in milliseconds": (dict(press=with_values("time", 1e3)), "seconds"),
    "nan": (dict(press=edited(7, "texel_2", "nan")), "Line 8 of 'press.csv' has nan for texel_2"),
    "huge": (dict(press=edited(7, "texel_2", "1e308")), "Line 8 of 'press.csv' has 1e308 for texel_2, which nothing"),
    "endless cell": (dict(press='time,depth,texel_0\n0,"' + "1" * 200_000), "not a table"),
    "semicolons": (dict(press="time;depth;texel_0\n0;0;0\n"), "comma"),
    "no header": (dict(press="\n".join(",".join(row) for row in table()[1:])), "begins with numbers"),
    "column twice": (dict(press=edited(0, "texel_0", "texel_1")), "twice"),
    "empty file": (dict(press=""), "empty"),
    "empty trial": (dict(press=table(samples=0)), "no data"),
    "one sample": (dict(press=table(samples=1)), "one sample"),
    "millimetres": (dict(press=with_values("z", 1e3, add=300.0)), "in metres"),
    "depth in millimetres": (dict(press=edited(7, "depth", "2.5", names=("depth",))), "in metres"),
    "binary": (dict(press=None), "not a text file"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_recordings_get_a_sentence(tmp_path, name):
    files, words = BAD[name]
    path = write(tmp_path, **{key: rows for key, rows in files.items() if rows is not None})
    if name == "binary":
        (tmp_path / "press.csv").write_bytes(b"\xff\xfe\x00\x81" * 20)
    with pytest.raises(PalpateError, match=".") as caught:
        read_rig(path)
    message = str(caught.value)
    assert words in message and "press" in message
    assert message.endswith(".") and "\n" not in message and len(message) < 300


BAD_RIGS = {
    "other format": (('"palpate-rig/1"', '"palpate-rig/9"'), "not a rig"),
    "no TOML": (("[sensor]", "[sensor"), "not TOML"),
    "no sensor": (("[sensor]", "[senser]"), "senser"),
    "unknown word": (("thickness", "thicknes"), "thicknes"),
    "no shape": (("shape = { sphere = 0.008 }", ""), "needs either a shape or a mesh"),
    "unknown shape": (("sphere", "cone"), "cone"),
    "negative radius": (("0.008", "-0.008"), "above zero"),
    "unit that is no text": (("k = 80.0", "k = 80.0\nunit = 3"), "unit"),
    "k that is text": (("80.0", '"80"'), "give a number"),
    "k below zero": (("80.0", "-80.0"), "above zero"),
    "no such law": (("k = 80.0", 'k = 80.0\nnormal_law = "cubic"'), "use one of linear, hunt-crossley"),
    "half a point": (("k = 80.0", "k = 80.0\npoints_per_texel = 1.5"), "whole number"),
    "five points": (("k = 80.0", "k = 80.0\npoints_per_texel = 5"), "points_per_texel"),
    "empty unit": (("k = 80.0", 'k = 80.0\nunit = " "'), "unit"),
    "rows": (("rows = 3", "rows = 0"), "rows"),
    "texel count": (("rows = 3", "rows = 4"), "6 texel columns and the sensor has 8"),
    "no trial": (('[[trial]]\nfile = "press.csv"\n[[trial]]\nfile = "again.csv"\nuse = "check"', ""), "no [[trial]]"),
    "use": (('use = "check"', 'use = "test"'), "fit"),
    "nothing to fit": (('file = "press.csv"', 'file = "press.csv"\nuse = "check"'), "to fit"),
    "twice": (('"again.csv"', '"press.csv"'), "once"),
    "no such file": (('"again.csv"', '"never.csv"'), "not there"),
    "outside": (('"again.csv"', '"../again.csv"'), "outside the rig's folder"),
    "absolute": (('"again.csv"', '"/etc/passwd"'), "outside the rig's folder"),
    "NUL in a name": (('"again.csv"', '"again\\u0000.csv"'), "control characters"),
    "endless name": (('"again.csv"', '"' + 300 * "a" + '.csv"'), "at most 255"),
    "endless name in bytes": (('"again.csv"', '"' + 200 * "ä" + '.csv"'), "not there"),
    "name that is a list": (('name = "pad under a ball"', "name = [1]"), "write a text"),
    "nested": (("k = 80.0", "k = " + 5000 * "[" + 5000 * "]"), "nests"),
    "endless number": (("k = 80.0", "k = " + 5000 * "9"), "not TOML"),
    "huge number": (("k = 80.0", "k = " + 400 * "9"), "give a number"),
    "huge pitch": (("0.003, 0.004", "0.003, 1e308"), "pitch"),
    "huge grid": (("rows = 3", "rows = " + 400 * "9"), "rows"),
    "no name": (('"again.csv"', "3"), "names no file"),
}


@pytest.mark.parametrize("name", BAD_RIGS)
def test_bad_rigs_get_a_sentence(tmp_path, name):
    (old, new), words = BAD_RIGS[name]
    assert old in RIG
    folder = tmp_path / "inside"
    folder.mkdir()
    (tmp_path / "again.csv").write_text("time\n")
    with pytest.raises(PalpateError) as caught:
        read_rig(write(folder, RIG.replace(old, new)))
    message = str(caught.value)
    assert words in message and message.endswith(".") and "\n" not in message


def test_a_link_out_of_the_folder_is_refused(tmp_path):
    folder = tmp_path / "inside"
    folder.mkdir()
    path = write(folder)
    (folder / "again.csv").rename(tmp_path / "again.csv")
    (folder / "again.csv").symlink_to(tmp_path / "again.csv")
    with pytest.raises(PalpateError, match="outside the rig's folder"):
        read_rig(path)


def test_all_zeros_are_refused(tmp_path):
    rows = [[*row[:4], *(["0"] * TEXELS if i else row[4:])] for i, row in enumerate(table())]
    with pytest.raises(PalpateError, match="All responses"):
        read_rig(write(tmp_path, press=rows, again=rows))


def test_channels_that_say_nothing_are_named(tmp_path):
    rows = table()
    press = [rows[0], *([*row[:-2], "", "5"] for row in rows[1:])]
    warnings = read_rig(write(tmp_path, press=press, again=press)).warnings
    assert warnings[0].startswith("texel_4: no values in any recording")
    assert warnings[1].startswith("texel_5: one value only")


def test_ten_gigabytes_are_refused_without_reading_them(tmp_path):
    path = write(tmp_path)
    with open(tmp_path / "press.csv", "r+b") as file:
        file.truncate(10 * 10**9)  # a sparse file: it takes no room
    with pytest.raises(PalpateError, match=r"10\.0 GB"):
        read_rig(path)


def test_a_missing_rig_and_missing_stimulus_values(tmp_path):
    with pytest.raises(PalpateError, match="no rig"):
        read_rig(tmp_path / "none.toml")
    rig = read_rig(write(tmp_path, press=edited(10, "z", "")))
    z = rig.trials[0].position[:, 2]
    assert z[9] == pytest.approx(0.5 * (z[8] + z[10]))
    assert any("interpolated" in warning for warning in rig.warnings)
    lines = write(tmp_path).with_name("press.csv").read_text().splitlines()
    at = lines[0].split(",").index("z")
    for i in range(1, len(lines)):
        cells = lines[i].split(",")
        lines[i] = ",".join([*cells[:at], "", *cells[at + 1 :]])
    with pytest.raises(PalpateError, match="Every cell of column 'z' in 'press.csv' is empty"):
        read_rig(write(tmp_path, press="\n".join(lines) + "\n"))


def test_columns_without_meaning_are_said(tmp_path):
    rig = read_rig(write(tmp_path, press=table(names=("x", "y", "z", "humidity"))))
    assert any("humidity" in warning for warning in rig.warnings)
    assert csv_table.LARGEST_TABLE < 10**9


def test_recordings_become_rigs_with_empty_cells_where_nothing_was_measured(tmp_path):
    time, nan = np.arange(10) * 0.1, np.nan
    reading = np.where(np.arange(10) < 5, 1.0, nan)
    columns = {"time": time, "force": time, "texel_0": reading, "texel_1": reading[::-1]}
    made = Recording("two", 'grid = { rows = 1, columns = 2, pitch = 0.01 }\nunit = "V"', [("press", "fit", columns)])
    rig = read_rig(made.write(tmp_path))
    np.testing.assert_array_equal(rig.trials[0].reading, np.stack([reading, reading[::-1]], axis=1))
