# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of text as loggers, spreadsheets and scripts write them.

Columns are separated by commas, semicolons, tabs or blanks. A header is not needed; a line of units below it is known as such.
Lines that begin with ``#`` or ``%`` are comments, the last of which may hold the header. A comma may stand for the decimal
point where semicolons, tabs or blanks separate.
"""

from __future__ import annotations

import csv
from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ....errors import FileError
from ....io.regular_file import open_regular
from ..log_table import FEWEST_ROWS, LogFile, LogTable, cleaned, require_size

LARGEST_TEXT = 512 * 2**20
"""Bytes of a file of text."""
LONGEST_LINE = 1 << 20
"""Characters."""
_SAMPLE = 50
"""Lines from which the form of the table is judged."""
_MISSING = {"", "nan", "na", "n/a", "none", "null", "-", "inf", "-inf", "+inf"}


def read_text(path: Path) -> LogFile:
    """Read a table of text; raise FileError if it is none."""
    if path.stat().st_size > LARGEST_TEXT:
        raise FileError(f"'{path.name}' holds more than {LARGEST_TEXT >> 20} MB: cut it into several files.")
    try:
        with open_regular(path, "r", encoding="utf-8-sig", errors="strict", newline=None) as file:
            lines: list[str] = []
            comments: list[str] = []
            while line := file.readline(LONGEST_LINE + 1):
                if len(line) > LONGEST_LINE:
                    raise FileError(f"A line of '{path.name}' has more than {LONGEST_LINE:,} characters: this is no table.")
                text = line.strip("\r\n")
                if text.lstrip().startswith(("#", "%")):
                    comments = [text.lstrip().lstrip("#%").strip()] if not lines else comments
                elif text.strip():
                    lines.append(text)
    except UnicodeDecodeError as error:
        raise FileError(f"'{path.name}' is not a text file in UTF-8: export the table as CSV.") from error
    if len(lines) < FEWEST_ROWS:
        raise FileError(f"'{path.name}' has {len(lines)} lines: a log needs at least {FEWEST_ROWS} samples.")
    separator = _separator(lines[:_SAMPLE])
    decimal = "," if separator != "," and _has_decimal_commas(lines[:_SAMPLE], separator) else "."
    names, units, first = _header(lines, comments, separator, decimal)
    return _table(path, lines[first:], (names, units), separator, decimal, len(lines) - first)


def _separator(lines: Sequence[str]) -> str:
    """Return the character that separates the cells of most lines into the same number; a blank stands for any blanks."""

    def evenness(mark: str) -> tuple[int, int]:
        counts = [len(_cells(line, mark)) for line in lines]
        usual = max(set(counts), key=counts.count)
        return (counts.count(usual) if usual > 1 else 0), usual

    return max(";\t, ", key=evenness)  # of equal ones the first: a comma may be a decimal point between semicolons


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    return [cell.strip() for cell in line.split(separator)]


def _has_decimal_commas(lines: Sequence[str], separator: str) -> bool:
    cells = [cell for line in lines for cell in _cells(line, separator)]
    return any("," in cell and _number(cell, ",") is not None for cell in cells)


def _number(cell: str, decimal: str) -> float | None:
    """Return the number of a cell, NaN if it is missing, None if it is text."""
    if cell.lower() in _MISSING:
        return float("nan")
    try:
        return float(cell.replace(",", ".") if decimal == "," else cell)
    except ValueError:
        return None


def _header(
    lines: Sequence[str], comments: Sequence[str], separator: str, decimal: str
) -> tuple[list[str], dict[str, str], int]:
    """Return the names of the columns, their units by name, and the number of the first line of numbers."""

    def is_text(line: str) -> bool:
        return all(_number(cell, decimal) is None or not cell for cell in _cells(line, separator))

    width = max(len(_cells(line, separator)) for line in lines[: 2 * _SAMPLE])
    first = 0
    while first < min(len(lines), _SAMPLE) and is_text(lines[first]):
        first += 1
    head = [_cells(line, separator) for line in lines[:first]]
    if not head and comments and len(_cells(comments[-1], separator)) == width:
        head = [_cells(comments[-1], separator)]
    wide = [cells for cells in head if len(cells) == width]
    if not wide:
        return [f"column_{i + 1}" for i in range(width)], {}, first
    names, below = wide[0], wide[1] if len(wide) > 1 else []
    names = [name or f"column_{i + 1}" for i, name in enumerate(names)]
    seen: dict[str, int] = {}
    for i, name in enumerate(names):
        seen[name] = seen.get(name, 0) + 1
        if seen[name] > 1:
            names[i] = f"{name} {seen[name]}"
    units = {name: unit.strip("[]() ") for name, unit in zip(names, below) if unit.strip("[]() ")}
    return names, units, first


def _table(
    path: Path, lines: Sequence[str], head: tuple[list[str], dict[str, str]], separator: str, decimal: str, count: int
) -> LogFile:
    """Return the numbers of the lines; columns of text are left out and named."""
    names, units = head
    require_size(count * len(names), len(names), path)
    values, text = array("d"), [0] * len(names)
    for line in lines:
        cells = _cells(line, separator)
        for i in range(len(names)):
            number = _number(cells[i], decimal) if i < len(cells) else float("nan")
            if number is None:
                text[i] += 1
                number = float("nan")
            values.append(number)
    found = cleaned(np.frombuffer(values, float).reshape(-1, len(names)))
    notes, columns = [], {}
    for i, name in enumerate(names):
        if np.isnan(found[:, i]).all():
            notes.append(f"'{path.name}': the column '{name}' holds no numbers and was left out.")
            continue
        if text[i]:
            notes.append(f"'{path.name}': {text[i]} cells of '{name}' are text and count as missing.")
        columns[name] = found[:, i]
    if not columns:
        raise FileError(f"'{path.name}' holds no numbers: give a table of measurements, a column for each quantity.")
    return LogFile(path, "table of text", (LogTable("", columns, units),), tuple(notes))
