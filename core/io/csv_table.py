# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of measurements: CSV files with one header line, whose columns say what they are and in which unit.

A column is called by its quantity, ``compression``, and is then in SI units, or by quantity and unit, ``compression (mm)``,
``compression [mm]`` or ``compression_mm``. Commas, semicolons and tabs separate; lines that begin with # are skipped.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Mapping

import numpy as np

from ..errors import FileError

UNITS: dict[str, dict[str, float]] = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "s": {"s": 1.0, "ms": 1e-3},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "kg": {"kg": 1.0, "g": 1e-3},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6},
}
"""SI unit → units that a column may be written in, and what one of them is worth."""

LARGEST = 200 * 2**20
"""Longest file that is read, bytes: a table of measurements that is fitted at once has some thousands of lines."""


def read_columns(path: str | os.PathLike, quantities: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Read the columns of a CSV file that are asked for, in SI units.

    Parameters
    ----------
    path : path
    quantities : mapping
        Name of a quantity → its SI unit, a key of :data:`UNITS`. Columns of other names are left out.

    Returns
    -------
    dict of (m,) float
        The quantities that the file has, in order of the file. Every value is finite.

    Raises
    ------
    FileError
        There is no such file, it is no table, a unit is not known, or a cell is no number.
    """
    rows = _rows(path)
    if not rows:
        raise FileError(f"'{path}' is empty: give a CSV file whose first line names its columns.")
    _, header = rows[0]
    found: dict[str, tuple[int, float]] = {}
    for place, cell in enumerate(header):
        for name, unit in quantities.items():
            factor = _factor(path, cell.strip(), name, unit)
            if factor is None:
                continue
            if name in found:
                raise FileError(f"'{path}' has two columns for {name}: leave only one of them.")
            found[name] = (place, factor)
    if not found:
        raise FileError(f"'{path}' has none of the columns {', '.join(quantities)}: its first line must name them.")
    if len(rows) == 1:
        raise FileError(f"'{path}' has a header and no measurements: add a line for each.")
    return {name: np.array([_number(path, row, place, name) for row in rows[1:]]) * f for name, (place, f) in found.items()}


def _rows(path: str | os.PathLike) -> list[tuple[int, list[str]]]:
    """Lines of the table with their numbers in the file, without comments and empty ones."""
    try:
        if os.path.getsize(path) > LARGEST:
            raise FileError(f"'{path}' is larger than {LARGEST // 2**20} MB: give a shorter table, a fit needs no more.")
        with open(path, encoding="utf-8-sig", newline="") as file:
            text = file.read()
    except FileNotFoundError as error:
        raise FileError(f"There is no file '{path}': check its name and folder.") from error
    except UnicodeDecodeError as error:
        raise FileError(f"'{path}' is not a text file: save the table as CSV in UTF-8.") from error
    except OSError as error:
        raise FileError(f"'{path}' cannot be read ({error.strerror}): check its name and permissions.") from error
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        return []
    separator = max(",;\t", key=lines[0][1].count)
    cells = csv.reader([line for _, line in lines], delimiter=separator)
    return [(number, row) for (number, _), row in zip(lines, cells, strict=True)]


def _factor(path: str | os.PathLike, cell: str, name: str, unit: str) -> float | None:
    """What a column's numbers are multiplied by to be in `unit`; None when the column is another quantity."""
    match = re.fullmatch(rf"{re.escape(name)}(?:\s*[(\[]\s*(.+?)\s*[)\]]|_(\S+))?", cell, flags=re.IGNORECASE)
    if match is None:
        return None
    written = match[1] or match[2] or unit
    if written not in UNITS[unit]:
        raise FileError(
            f"Column '{cell}' of '{path}' is in a unit that is not known here: write {name} in one of {', '.join(UNITS[unit])}."
        )
    return UNITS[unit][written]


def _number(path: str | os.PathLike, row: tuple[int, list[str]], place: int, name: str) -> float:
    line, cells = row
    text = cells[place].strip() if place < len(cells) else ""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise FileError(f"Line {line} of '{path}' has '{text}' for {name}, which is no number: correct it or remove the line.")
    return value
