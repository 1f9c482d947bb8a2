# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of numbers from CSV files with one header line. Every complaint about a cell names its line and its column.

Programs write them, with commas and without comments. Tables that people and instruments write are read by :mod:`.text_table`.
"""

from __future__ import annotations

import csv
import math
import os
import re
from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..errors import FileError, read_errors_said
from .input_files import open_regular

UNITS: dict[str, dict[str, float]] = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "s": {"s": 1.0, "ms": 1e-3},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "kg": {"kg": 1.0, "g": 1e-3},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6},
    "°C": {"°C": 1.0, "degC": 1.0, "C": 1.0, "K": 1.0, "°F": 1.0 / 1.8, "degF": 1.0 / 1.8},
}
"""SI unit → units that a column may be written in, and the SI value of one of them; of temperatures the value of one degree."""


LARGEST_NUMBER = 1e30
"""Numbers of a larger magnitude are refused: nothing that is measured is so large, and sums of their squares overflow."""


LARGEST_TABLE = 512 * 2**20
"""Bytes: some hundred million numbers would fill the memory long before a fit ends."""


@dataclass(frozen=True)
class Table:
    """A table that was read.

    Attributes
    ----------
    names : list of str
        Of the columns, as in the header.
    values : (rows, columns) float
        NaN where a cell is empty.
    """

    names: list[str]
    values: np.ndarray


def read_table(path: str | os.PathLike) -> Table:
    """Read a CSV file, all of whose lines have the same number of cells.

    Raises
    ------
    FileError
        The file cannot be read, is too large, has no header or no data, or a cell is not a finite number.
    """
    path = Path(path)
    with open_table(path) as file:
        lines = csv.reader(file, strict=True)
        names = _header(next((cells for cells in lines if _is_filled(cells)), []), path)
        values = _values(lines, names, path)
    if len(values) == 0:
        raise FileError(f"'{path.name}' has a header and no data: there are no measurements below its header, add them.")
    return Table(names, values)


@contextmanager
def open_table(path: Path) -> Iterator[IO[str]]:
    """Open a file whose text is a table.

    Raises
    ------
    FileError
        It cannot be read or is too large, or the body of the ``with`` statement meets bytes that are no UTF-8, or a
        :class:`csv.Error`.
    """
    try:
        with read_errors_said(path), open_regular(path, "r", encoding="utf-8-sig") as file:
            size = path.stat().st_size
            if size > LARGEST_TABLE:
                raise FileError(
                    f"'{path.name}' holds {size / 1e9:.1f} GB and at most {LARGEST_TABLE / 1e9:.1f} GB are read: "
                    "cut it into several files, or keep fewer samples per second."
                )
            yield file
    except UnicodeDecodeError as error:
        raise FileError(f"'{path.name}' is not a text file in UTF-8: export the table as CSV.") from error
    except csv.Error as error:
        raise FileError(f"'{path.name}' is not a table ({error}): export it as CSV, with quotation marks closed.") from error


def harmless_cell(text: str) -> str:
    """Return the text of a cell so that no spreadsheet takes it for a formula.

    A spreadsheet computes a cell that begins with ``=``, ``+``, ``-`` or ``@``, and a formula can start programs. An object
    of a .blend may be called ``=cmd|…``. An apostrophe before it makes it text, also behind what other languages
    use as separator.
    """
    return re.sub(r"(^|[;|\t\r\n])(\s*)(?=[=+\-@\uff1d\uff0b\uff0d\uff20])", r"\1'\2", text)


def _is_filled(cells: list[str]) -> bool:
    """Return False for the cells of an empty line."""
    return len(cells) > 1 or any(map(str.strip, cells))


def _header(cells: list[str], path: Path) -> list[str]:
    """Return the names of the columns that the first line has."""
    names = [name.strip() for name in cells]
    if not any(names):
        raise FileError(f"'{path.name}' is empty: it needs a first line that names its columns, and numbers below.")
    if len(names) == 1 and any(mark in names[0] for mark in ";\t"):
        raise FileError(f"The columns of '{path.name}' are not separated by commas: export it with a comma as separator.")
    if all(is_number(name) for name in names):
        raise FileError(f"'{path.name}' begins with numbers, not with column names: write `time` and the others in line 1.")
    twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
    if twice is not None:
        raise FileError(f"Column '{twice}' is twice in the header of '{path.name}': rename or remove one of them.")
    return names


def is_number(text: str) -> bool:
    """Return True if Python reads a text as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _complain(path: Path, line: int, names: Sequence[str], cells: Sequence[str]) -> None:
    """Raise for the first cell of a line that is no finite number."""
    for name, cell in zip(names, cells, strict=True):
        text = cell.strip()
        if not text or is_number(text) and abs(float(text)) <= LARGEST_NUMBER:
            continue
        what = f"{text[:40]}" if is_number(text) else f"'{text[:40]}'"
        which = ", which nothing measured can be" if is_number(text) and math.isfinite(float(text)) else ""
        raise FileError(f"Line {line} of '{path.name}' has {what} for {name}{which}: write a number, or leave the cell empty.")


def _values(lines: Any, names: list[str], path: Path) -> np.ndarray:
    """(rows, columns) float: the cells of the lines that a reader of :mod:`csv` has left."""
    values, width = array("d"), len(names)
    for count, cells in enumerate(filter(_is_filled, lines)):
        if len(cells) != width:
            raise FileError(
                f"Line {lines.line_num} of '{path.name}' has {len(cells)} cells and the header has {width}: "
                "leave a missing value's cell empty, but keep its comma."
            )
        try:
            values.extend(map(float, cells))
        except ValueError:  # an empty cell, or a text that is not a number
            _complain(path, lines.line_num, names, cells)
            del values[count * width :]
            values.extend(float(cell.strip() or "nan") for cell in cells)
            continue
        if not sum(map(abs, values[count * width :])) <= LARGEST_NUMBER:  # false for NaN, too
            _complain(path, lines.line_num, names, cells)
    return np.frombuffer(values, float).reshape(-1, width) if values else np.zeros((0, width))
