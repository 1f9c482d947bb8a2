# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig translates a logger's columns and units; what does not fit gets a sentence."""

import numpy as np
import pytest
from rig_files import RIG, TEXELS, refusal, table, write

from palpate.core.gap.dataset.column_names import read_column
from palpate.core.gap.dataset.rig import read_rig

COLUMNS = """
[columns]
time = { name = "t", unit = "ms" }
x = { unit = "mm" }
z = { name = "height", unit = "mm", factor = -1 }
y = "sideways"
texel = { name = "R{}", first = 1, unit = "1/x", factor = 1000 }
force_z = { name = "Fz", unit = "mN" }
"""


def logged():
    """The table of rig_files as another logger writes it: other names, milliseconds, millimetres and resistances."""
    header, *rows = table()
    names = {"time": "t", "y": "sideways", "z": "height"} | {f"texel_{i}": f"R{i + 1}" for i in range(TEXELS)}
    scale = {"time": 1e3, "x": 1e3, "z": -1e3}
    out = [[names.get(name, name) for name in header]]
    for row in rows:
        values = [(name, float(cell)) for name, cell in zip(header, row, strict=True)]
        texel = [name.startswith("texel") for name, _ in values]
        cells = [1e3 / (1.0 + v) if is_texel else v * scale.get(n, 1.0) for (n, v), is_texel in zip(values, texel, strict=True)]
        out.append([f"{cell:.12g}" for cell in cells])
    return out


def with_columns(words=COLUMNS):
    return RIG.replace("[sensor]", f"{words}\n[sensor]", 1)


def test_names_and_units_are_translated(tmp_path):
    plain = read_rig(write(tmp_path)).trials[0]
    rig = read_rig(write(tmp_path, with_columns(), press=logged(), again=logged()))
    found = rig.trials[0]
    np.testing.assert_allclose(found.time, plain.time, atol=1e-9)
    np.testing.assert_allclose(found.position, plain.position, atol=1e-9)
    np.testing.assert_allclose(found.reading, 1.0 + plain.reading, rtol=1e-9)
    assert found.force is None and not rig.warnings  # a force that no file has is no mistake


def test_zero_and_missing_are_words_of_a_rig_as_of_answers_about_logs(tmp_path):
    plain = read_rig(write(tmp_path)).trials[0].reading
    header, *rows = logged()
    texel = [name.startswith("R") for name in header]
    rows = [[f"{float(cell) + 2.0:.12g}" if is_texel else cell for cell, is_texel in zip(row, texel)] for row in rows]
    rows[4][header.index("R3")] = "-1"
    words = COLUMNS.replace("factor = 1000", "factor = 1000, zero = 2, missing = -1")
    found = read_rig(write(tmp_path, with_columns(words), press=[header, *rows], again=[header, *rows])).trials[0].reading
    assert np.argwhere(np.isnan(found)).tolist() == [[4, 2]]
    np.testing.assert_allclose(np.nan_to_num(found - 1.0 - plain), 0.0, atol=1e-8)
    column = {"name": "R{}", "count": 2, "unit": "1/x", "factor": 1e3, "zero": 2, "missing": -1}
    answered = read_column("texel", column, "texel")
    assert answered.names == ("R0", "R1")
    in_si = answered.in_si("texel", np.array([3.0, 2.0, -1.0, 4.0]))
    np.testing.assert_array_equal(in_si, [1e3, np.nan, np.nan, 5e2])


def test_a_column_of_the_net_force(tmp_path):
    rows = logged()
    press = [[*rows[0], "Fz"], *([*row, "-250"] for row in rows[1:])]
    trial = read_rig(write(tmp_path, with_columns(), press=press, again=logged())).trials[0]
    np.testing.assert_allclose(trial.force[:, 2], -0.25)


BAD = {
    "no such column": (COLUMNS.replace('"height"', '"hight"'), "no column 'hight'"),
    "no such quantity": (COLUMNS + 'colour = "c"\n', "not a word of this format"),
    "no such unit": (COLUMNS.replace('"ms"', '"fortnight"'), "write one of s, ms"),
    "unit of texels": (COLUMNS.replace('"1/x"', '"kOhm"'), "stands in [sensor]"),
    "no number": (COLUMNS.replace("R{}", "R"), "where the texel's number stands"),
    "factor": (COLUMNS.replace("factor = -1", "factor = 0"), "other than zero"),
    "first": (COLUMNS.replace("first = 1", "first = -1"), "first texel"),
    "a list": (COLUMNS.replace('y = "sideways"', "y = [1]"), "write the name of the column"),
    "a table of its own": ("columns = 3", "no [columns]"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_does_not_fit_gets_a_sentence(tmp_path, name):
    words, said = BAD[name]
    assert said in refusal(tmp_path, with_columns(words), press=logged(), again=logged())


def test_zero_has_no_inverse_and_two_columns_are_one_too_many(tmp_path):
    rows = logged()
    rows[4][rows[0].index("R3")] = "0"
    assert "Line 5 of 'press.csv' has zero for R3" in refusal(tmp_path, with_columns(), press=rows, again=logged())
    rows = logged()
    double = [[*rows[0], "z"], *([*row, "1"] for row in rows[1:])]
    assert "remove one of them" in refusal(tmp_path, with_columns(), press=double, again=logged())
