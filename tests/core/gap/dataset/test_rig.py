# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs are read as docs/rig-format.md says, and each bad one gets a sentence that names what, where, and what to do."""

import json
import re
from dataclasses import asdict, fields

import numpy as np
import pytest
import trimesh
from rig_files import RIG, TEXELS, refusal, table, write

from palpate.core.errors import PalpateError
from palpate.core.gap.dataset.column_names import QUANTITIES
from palpate.core.gap.dataset.rig import RIG_SENSOR_WORDS, RigWords, read_rig
from palpate.core.gap.dataset.trial import FAULT_KINDS, TrialWords
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


@pytest.mark.parametrize("kind", ["ply", "stl"])  # STL repeats the vertices of each triangle
def test_other_stimuli_meshes_and_forces(tmp_path, kind):
    trimesh.creation.box((0.02, 0.02, 0.02)).export(tmp_path / f"pad.{kind}")
    rig = RIG.replace("grid = { rows = 3, columns = 2, pitch = [0.003, 0.004] }", f'mesh = "pad.{kind}"')
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
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_recordings_get_a_sentence(tmp_path, name):
    files, words = BAD[name]
    message = refusal(tmp_path, **files)
    assert words in message and "press" in message


def trials(first, second=""):
    """Words more of the two trials."""
    return {'file = "press.csv"': f'file = "press.csv"\n{first}', 'file = "again.csv"': f'file = "again.csv"\n{second}'}


def before(table, words):
    """Words in front of a table of the rig."""
    return {table: f"{words}\n{table}"}


def sensor(words):
    return {"k = 80.0": f"k = 80.0\n{words}"}


SPHERE, SOME_PROBE = "shape = { sphere = 0.001 }", '[[probe]]\nname = "block"\n'
BAD_RIGS = [
    ({'"palpate-rig/1"': '"palpate-rig/9"'}, "not a rig"),
    ({"[sensor]": "[sensor"}, "not TOML"),
    ({"[sensor]": "[senser]"}, "senser"),
    ({"thickness": "thicknes"}, "thicknes"),
    ({"shape = { sphere = 0.008 }": ""}, "needs either a shape or a mesh"),
    ({"sphere": "cone"}, "cone"),
    ({"0.008": "-0.008"}, "above zero"),
    ({"80.0": '"80"'}, "give a number"),
    ({"80.0": "-80.0"}, "above zero"),
    (sensor('normal_law = "cubic"'), "use one of linear, hunt-crossley"),
    ({"80.0": 5000 * "[" + 5000 * "]"}, "nests"),
    ({"rows = 3": "rows = 0"}, "rows"),
    ({"rows = 3": "rows = 4"}, "6 texel columns and the sensor has 8"),
    # trials
    ({'[[trial]]\nfile = "press.csv"\n[[trial]]\nfile = "again.csv"\nuse = "check"': ""}, "no [[trial]]"),
    ({'use = "check"': 'use = "test"'}, "fit"),
    (trials('use = "check"'), "to fit"),
    ({'"again.csv"': '"press.csv"'}, "once"),
    ({'"again.csv"': '"never.csv"'}, "not there"),
    ({'"again.csv"': '"../again.csv"'}, "outside the rig's folder"),
    # sessions
    (trials('session = "s"\nstarted = 1', 'session = "s"\nstarted = 1.1'), "before 'press.csv' has ended"),
    (trials('session = "s"\nstarted = 1', 'session = "s"'), "have no started"),
    (trials('session = "s"\nstarted = 1', 'session = "s"\nstarted = "2026-05-04"'), "have no started"),
    (trials("started = 1"), "has started and no session"),
    (trials('session = "s"\nstarted = "soon"'), "started of Trial 1"),
    (trials('session = "s"\nstarted = 1e300'), "started of Trial 1"),
    (trials('session = " "'), "session of Trial 1"),
    (trials("tared = 1"), "tared of Trial 1"),
    (before("[sensor]", 'clock = "wall"'), 'write "absolute" or "own"'),
    (before("[sensor]", 'clock = "absolute"'), "overlap in time"),
    # numbers of recordings
    *((trials(words), "of Trial 1") for words in ("force_zero = 1", 'force_zero = [0, 0, "a"]', 'factor = "some"')),
    *((trials(words), "of Trial 1") for words in ("factor = -1", "factor = 0", "zero = true", "zero = [1]", "specimen = 3")),
    (trials('specimen = "A"'), "Trial 1"),
    *((sensor(f"contact_height = {value}"), "contact_height") for value in ('"some"', "2", "true", "[1]")),
    *((trials(f"contact_height = {value}"), "contact_height of Trial 1") for value in ('"some"', "2", "true", "[1]")),
    (trials("", 'contact_height = "free"'), "is free"),
    (trials("", 'repeats = "a"'), "Only one recording"),
    (trials("", "repeats = 3"), "repeats of Trial 2"),
    # probes
    (trials('probe = "ring"'), "(none)"),
    (trials('probe = "ring"') | before("[indenter]", SOME_PROBE + SPHERE), "(block)"),
    (before("[indenter]", f"[[probe]]\n{SPHERE}"), "name in"),
    (before("[indenter]", f"{SOME_PROBE}{SPHERE}\n" * 2), "twice"),
    (before("[indenter]", '[probe]\nname = "a"'), "has no [[probe"),
    (before("[indenter]", SOME_PROBE), "either a shape or a mesh"),
    # corrections
    *((before("[sensor]", f"[data]\ncorrect = {value}"), "clock-shift") for value in ('"some"', "3", '["signs"]', "[1]")),
]


@pytest.mark.parametrize(("changes", "words"), BAD_RIGS)
def test_bad_rigs_get_a_sentence(tmp_path, changes, words):
    text, folder = RIG, tmp_path / "inside"
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    folder.mkdir()
    (tmp_path / "again.csv").write_text("time\n")
    assert words in refusal(folder, text)


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
    assert "All responses" in refusal(tmp_path, press=rows, again=rows)


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
    header, *rows = table()
    at = header.index("z")
    empty = [header, *([*row[:at], "", *row[at + 1 :]] for row in rows)]
    assert "Every cell of column 'z' in 'press.csv' is empty" in refusal(tmp_path, press=empty)


def test_columns_without_meaning_are_said(tmp_path):
    rig = read_rig(write(tmp_path, press=table(names=("x", "y", "z", "humidity"))))
    assert any("humidity" in warning for warning in rig.warnings)


def test_every_key_column_and_fault_is_on_the_page(repository):
    """Parameters of the sensor are those of sensor.toml, of which the page names some."""
    rig_words = {one.name for one in fields(RigWords)} - {"sensor", "trial", "columns", "data", "indenter", "probe"}
    words = {*rig_words, *(one.name for one in fields(TrialWords)), *RIG_SENSOR_WORDS, *FAULT_KINDS}
    page = (repository / "docs" / "rig-format.md").read_text(encoding="utf-8")
    named = {word for code in re.findall(r"`([^`\n]+)`", page) for word in re.split(r"[\s=]+", code)}
    assert words | (set(QUANTITIES) - {"texel"}) <= named
    assert {f"[[{one}]]" for one in ("trial", "probe")} | {
        f"[{one}]" for one in ("sensor", "columns", "data", "indenter")
    } <= named
