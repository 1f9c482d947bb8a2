# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of numbers from CSV files, read line by line so that every complaint can name its line."""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ...errors import FileError

LARGEST = 512 * 1024**2
"""Bytes of CSV that are read from one file; some hundred million numbers would fill the memory long before a fit ends."""


def read_table(path: Path) -> tuple[list[str], np.ndarray]:
    """Read a CSV file with one header line.

    Returns
    -------
    names : list of str
        Of the columns, as in the header.
    values : (rows, columns) float
        NaN where a cell is empty.

    Raises
    ------
    FileError
        The file cannot be read, is too large, has no header or no data, or a cell is not a finite number.
    """
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise FileError(
                f"'{path.name}' holds {size / 1e9:.1f} GB and at most {LARGEST / 1e9:.1f} GB are read: "
                "cut it into several trials, or keep fewer samples per second."
            )
        with path.open(encoding="utf-8-sig", newline="") as file:
            names = _header(file.readline(), path)
            values = _rows(file, names, path)
    except UnicodeDecodeError as error:
        raise FileError(f"'{path.name}' is not text in UTF-8: export it as a plain CSV file.") from error
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({error.strerror}): check the `file` of its trial.") from error
    if len(values) == 0:
        raise FileError(f"'{path.name}' has a header and no data: record the trial again or take it out of the rig.")
    return names, values


def _header(line: str, path: Path) -> list[str]:
    names = [name.strip() for name in next(csv.reader([line]), [])]
    if not any(names):
        raise FileError(f"'{path.name}' is empty: record the trial again or take it out of the rig.")
    if len(names) == 1 and any(mark in names[0] for mark in ";\t"):
        raise FileError(f"The columns of '{path.name}' are not separated by commas: export it with a comma as separator.")
    if all(_is_number(name) for name in names):
        raise FileError(f"'{path.name}' begins with numbers, not with column names: write `time` and the others in line 1.")
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise FileError(f"Column '{name}' is twice in the header of '{path.name}': rename or remove one of them.")
        seen.add(name)
    return names


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _rows(file: Iterable[str], names: list[str], path: Path) -> np.ndarray:
    values, width = array("d"), len(names)
    for number, line in enumerate(file, start=2):
        if not line.strip():
            continue
        cells = line.rstrip("\r\n").split(",")
        if len(cells) != width:
            raise FileError(
                f"Line {number} of '{path.name}' has {len(cells)} cells and the header has {width}: "
                "leave a missing value's cell empty, but keep its comma."
            )
        try:
            row = [float(cell) if cell and not cell.isspace() else math.nan for cell in cells]
        except ValueError:
            name, cell = next((n, c) for n, c in zip(names, cells, strict=True) if c.strip() and not _is_number(c))
            raise FileError(
                f"Line {number} of '{path.name}' has '{cell.strip()[:40]}' for {name}: write a number, or leave the cell empty."
            ) from None
        if not all(map(math.isfinite, row)):
            for name, cell, value in zip(names, cells, row, strict=True):
                if cell.strip() and not math.isfinite(value):
                    raise FileError(
                        f"Line {number} of '{path.name}' has {cell.strip()} for {name}: "
                        "leave the cell empty where a value is missing."
                    )
        values.extend(row)
    return np.frombuffer(values, float).reshape(-1, width) if values else np.zeros((0, width))
