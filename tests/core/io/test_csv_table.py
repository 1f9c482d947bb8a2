# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables from CSV files: what is accepted, and complaints that name the line and the column."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.errors import FileError
from palpate.core.io.csv_table import harmless_cell, read_table


def write(folder, text):
    """Return the path of a table with this text."""
    path = folder / "table.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_recordings_keep_empty_cells_as_nan(tmp_path):
    table = read_table(write(tmp_path, '\ufefftime,"texel, left"\r\n0,1.5\r\n\r\n1, \r\n"2",-3e-2\r\n,4\r\n'))
    assert table.names == ["time", "texel, left"]
    np.testing.assert_array_equal(table.values, [[0, 1.5], [1, np.nan], [2, -0.03], [np.nan, 4]])


@pytest.mark.parametrize("cell, words", [("soft", "'soft' for depth"), ("inf", "inf for depth"), ("nan", "nan for depth")])
def test_complaints_name_line_and_column(tmp_path, cell, words):
    with pytest.raises(FileError, match=f"Line 4 of 'table.csv' has {words}"):
        read_table(write(tmp_path, f"depth,force\n1,2\n\n{cell},3\n"))
    with pytest.raises(FileError, match="Line 2 of 'table.csv' has 2 cells and the header has 3"):
        read_table(write(tmp_path, "depth,force,note\n1,2\n3\n"))


@pytest.mark.parametrize(
    ("name", "cell"),
    [
        ("=cmd|' /C calc'!A0 x", "'=cmd|' /C calc'!A0 x"),
        ("+1", "'+1"),
        ("-finger", "'-finger"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("\t =1", "'\t =1"),
        ("pad;=1", "pad;'=1"),
        ("Finger-A = 1;", "Finger-A = 1;"),
        ("texel_0", "texel_0"),
    ],
)
def test_no_name_is_a_formula(name, cell):
    assert harmless_cell(name) == cell
