# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of text as instruments and people write them: names, units and numbers, and nothing lost in silence."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.errors import FileError
from palpate.core.io.text_table import read_columns, read_text_table

ROWS = [(0.1 * i, -0.05 * i, -1.0 * i) for i in range(12)]


def write(folder, text):
    path = folder / "table.csv"
    path.write_text(text, encoding="utf-8")
    return path


def body(separator=",", decimal=".", end=""):
    return "".join(separator.join(f"{x:.3f}".replace(".", decimal) for x in row) + end + "\n" for row in ROWS)


NAMES, UNITS = ["Time", "Extension", "Load"], {"Time": "s", "Extension": "mm", "Load": "N"}


@pytest.mark.parametrize(
    ("text", "names", "units"),
    [
        ("Time,Extension,Load\n" + body(end=","), NAMES, {}),
        ("Time;Extension;Load;\n(s);(mm);(N);\n" + body(";", ",", ";"), NAMES, UNITS),
        ("Specimen : Diameter,14.0,mm\nRate,6,mm/min\n\nTime,Extension,Load\n(s),(mm),(N)\n" + body(), NAMES, UNITS),
        ("By: A\nMotor speed\t6\nX\t0.667\n\nTime\tExtension\tLoad\ns\tmm\tN\n" + body("\t", ","), NAMES, UNITS),
        ("# rig 7\n% t z F\n" + body(" "), ["t", "z", "F"], {}),
        (body("  "), ["column_1", "column_2", "column_3"], {}),
        ('"Time (s)","Load, raw","x"\n' + body(), ["Time (s)", "Load, raw", "x"], {}),
    ],
    ids=["trailing", "semicolons", "preamble", "preamble of two", "comments", "blanks", "quotes"],
)
def test_names_units_and_numbers(tmp_path, text, names, units):
    table = read_text_table(write(tmp_path, text))
    assert (table.names, table.units, table.notes) == (names, units, ())
    np.testing.assert_allclose(table.values, ROWS, atol=1e-12)


@pytest.mark.parametrize(
    ("head", "names", "note"),
    [
        ("t,F", ["t", "F", "column_3"], "its header has 2 names for 3 columns: the last one has none"),
        ("t,z,F,extra", ["t", "z", "F"], "4 names for 3 columns: those at its end were not used"),
        ("only one", ["column_1", "column_2", "column_3"], ""),
    ],
)
def test_a_header_that_does_not_fit_is_said(tmp_path, head, names, note):
    table = read_text_table(write(tmp_path, f"{head}\n{body()}"))
    assert table.names == names and (note in table.notes[0] if note else not table.notes)


def test_a_first_column_that_counts_the_lines_has_no_name(tmp_path):
    table = read_text_table(write(tmp_path, "t z F\n" + "".join(f"{i} 0.{i} 1 2\n" for i in range(1, 9))))
    assert table.names == ["column_1", "t", "z", "F"] and "the first, which counts the lines," in table.notes[0]


def test_cells_without_a_number_are_known(tmp_path):
    table = read_text_table(write(tmp_path, "t,F,state\n" + "".join(f"{i},{'go' if i == 4 else i},ok\n" for i in range(12))))
    assert table.wrong["F"] == [(6, "go")] and len(table.wrong["state"]) == 12
    assert np.flatnonzero(np.isnan(table.values[:, 1])).tolist() == [4]


def test_quantities_have_the_names_and_units_of_instruments(tmp_path):
    path = write(tmp_path, "# by hand\nforce_mN\tnote\tCompression [cm]\n# more\n250\tsoft\t2\n500\t\t3\n")
    found = read_columns(path, {"compression": "m", "force": "N"})
    np.testing.assert_allclose(found["force"], [0.25, 0.5])
    np.testing.assert_allclose(found["compression"], [0.02, 0.03])
    path = write(tmp_path, "Bluehill,3\n\nTime;Extension;Load\ns;mm;kN\n" + body(";", ","))
    found = read_columns(path, {"compression": "m", "force": "N"})
    np.testing.assert_allclose(np.stack(list(found.values()), axis=1), np.array(ROWS)[:, 1:] * [1e-3, 1e3], atol=1e-12)


@pytest.mark.parametrize("cell", ["soft", "inf", "nan", ""])
def test_complaints_name_line_and_column(tmp_path, cell):
    path = write(tmp_path, f"# by hand\n\ndepth;force\n1;2\n# more\n{cell};3\n")
    with pytest.raises(FileError, match=f"Line 6 of 'table.csv' has '{cell}' for depth: write a number, or remove the line"):
        read_columns(path, {"depth": "m"})
    assert list(read_columns(path, {"force": "N"})["force"]) == [2, 3]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("depth,force\n", "no measurements"),
        ("a,b\n1,2\n2,3\n", "none of the columns depth, force"),
        ("depth (ell),force\n1,2\n2,3\n", "unit that is not known here"),
        ("force,force (mN)\n1,2\n2,3\n", "two columns for force"),
        ('depth,force\n1,2\n"2,3\n', "none of the columns"),
    ],
)
def test_what_is_no_measurement_is_one_sentence(tmp_path, text, words):
    with pytest.raises(FileError, match=words):
        read_columns(write(tmp_path, text), {"depth": "m", "force": "N"})
