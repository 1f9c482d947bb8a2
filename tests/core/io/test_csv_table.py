# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables from CSV files: what is accepted, and complaints that name the line and the column."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.errors import FileError
from palpate.core.io.csv_table import MEASUREMENTS, harmless_cell, read_columns, read_table


def write(folder, text):
    """Return the path of a table with this text."""
    path = folder / "table.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_recordings_keep_empty_cells_as_nan(tmp_path):
    table = read_table(write(tmp_path, '\ufefftime,"texel, left"\r\n0,1.5\r\n\r\n1, \r\n"2",-3e-2\r\n'))
    assert table.names == ["time", "texel, left"]
    np.testing.assert_array_equal(table.values, [[0, 1.5], [1, np.nan], [2, -0.03]])


def test_measurements_have_comments_units_and_columns_of_words(tmp_path):
    path = write(tmp_path, "# by hand\nforce_mN\tnote\tCompression [cm]\n# more\n250\tsoft\t2\n500\t\t3\n")
    found = read_columns(path, {"compression": "m", "force": "N"})
    assert list(found) == ["force", "compression"]
    np.testing.assert_allclose(found["force"], [0.25, 0.5])
    np.testing.assert_allclose(found["compression"], [0.02, 0.03])


@pytest.mark.parametrize(
    ("cell", "words"),
    [("soft", "'soft' for depth"), ("inf", "inf for depth"), ("nan", "nan for depth"), ("", "'' for depth")],
)
def test_complaints_name_line_and_column(tmp_path, cell, words):
    path = write(tmp_path, f"# by hand\n\ndepth;force\n1;2\n# more\n{cell};3\n")
    with pytest.raises(FileError, match=f"Line 6 of 'table.csv' has {words}"):
        read_table(path, MEASUREMENTS)
    with pytest.raises(FileError, match=f"Line 6 of 'table.csv' has {words}"):
        read_columns(path, {"depth": "m"})
    path = write(tmp_path, f"depth,force\n1,2\n\n{cell},3\n")
    if cell:
        with pytest.raises(FileError, match=f"Line 4 of 'table.csv' has {words}"):
            read_table(path)
    else:
        assert np.isnan(read_table(path).values[1, 0])


def test_a_short_line_of_measurements_is_told_only_where_a_wanted_cell_is_missing(tmp_path):
    path = write(tmp_path, "depth,force,note\n1,2\n3\n")
    assert list(read_columns(path, {"depth": "m"})["depth"]) == [1, 3]
    with pytest.raises(FileError, match="Line 3 of 'table.csv' has '' for force"):
        read_columns(path, {"force": "N"})
    with pytest.raises(FileError, match="Line 2 of 'table.csv' has 2 cells and the header has 3"):
        read_table(path)


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
