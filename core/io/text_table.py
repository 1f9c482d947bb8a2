# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of text as instruments, loggers, spreadsheets and scripts write them.

Columns are separated by commas, semicolons, tabs or blanks; a comma may stand for the decimal point where it does not separate.
The table begins at the first run of lines of numbers. The lines directly above it, with as many fields, are names and units;
what is above these, ``key,value`` lines of an instrument, is none of the table. Lines that begin with ``#`` or ``%`` are
comments, the last of which may hold the names.
"""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

import numpy as np

from ..errors import FileError
from .csv_table import LARGEST_NUMBER, UNITS, open_table

LONGEST_LINE = 1 << 20
"""Characters."""
MOST_VALUES = 100_000_000
"""Numbers that are read: 0.8 GB, far more than a fit can use."""
SAMPLE = 400
"""Lines within which the table has to begin, and from which its form is judged."""
FIRST_RUN = 8
"""Lines of numbers at which a table begins, or as many as there are."""
MISSING = {"", "nan", "na", "n/a", "none", "null", "-", "inf", "-inf", "+inf"}
SEPARATORS = ";\t, "
"""Of equal ones the first: a comma may be a decimal point between semicolons."""
LONGEST_UNIT = 6
"""Characters of a unit that is not in brackets."""


@dataclass(frozen=True)
class TextTable:
    """A table that was read.

    Attributes
    ----------
    names : list of str
        Of the columns; ``column_1``, … where the file has none.
    units : dict of str to str
        By the names of columns, where a line of units is below these.
    values : (rows, columns) float
        NaN where a cell is empty, or holds text or no finite number.
    lines : (rows,) int
        Number of each row in the file.
    wrong : dict of str to list of (int, str)
        Line and text of the cells of a column that hold no finite number.
    notes : tuple of str
        What of the header was not used, and why.
    """

    names: list[str]
    units: dict[str, str]
    values: np.ndarray
    lines: np.ndarray
    wrong: dict[str, list[tuple[int, str]]]
    notes: tuple[str, ...] = ()


def read_text_table(path: str | os.PathLike) -> TextTable:
    """Read a table of text.

    Raises
    ------
    FileError
        The file cannot be read, is too large, is no text in UTF-8, or holds no lines of numbers.
    """
    path = Path(path)
    with open_table(path) as file:
        lines, comments = _lines(file, path)
    if not lines:
        raise FileError(f"'{path.name}' is empty: it needs lines of numbers, and above them a line that names the columns.")
    form, first = _form([text for _, text in lines[:SAMPLE]], path)
    head = [form.cells(text) for _, text in lines[:first]]
    names, units, notes = _header(head, comments, form, [form.cells(text) for _, text in lines[first : first + SAMPLE]], path)
    count = (len(lines) - first) * len(names)
    if count > MOST_VALUES:
        raise FileError(
            f"'{path.name}' holds {count:,} numbers in {len(names):,} columns and at most {MOST_VALUES:,} are read: cut it "
            "into several files, or keep fewer samples per second."
        )
    values, wrong = _values(lines[first:], names, form)
    numbers = np.array([number for number, _ in lines[first:]])
    return TextTable(names, units, values, numbers, wrong, tuple(f"'{path.name}': {note}" for note in notes))


QUANTITY_NAMES = {
    "compression": ("compression", "extension", "displacement", "deformation", "deflection", "indentation", "depth"),
    "force": ("force", "load", "standard force"),
    "mass": ("mass", "weight"),
    "pressure": ("pressure", "stress", "compressive stress"),
    "velocity": ("velocity", "speed", "sliding velocity"),
    "time": ("time", "elapsed time", "test time"),
}
"""Quantity → what instruments call it; the first that a file has counts."""


def read_columns(path: str | os.PathLike, quantities: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Read the columns of given quantities from a table of measurements, in SI units.

    The name of a column is a quantity, ``compression``, or another word for it (:data:`QUANTITY_NAMES`). Its unit is in the
    name, as ``compression (mm)`` or ``compression_mm``, or in the line below; without one its numbers are in SI units.

    Parameters
    ----------
    path : path
    quantities : mapping
        Name of a quantity → its SI unit, a key of :data:`.csv_table.UNITS`. Columns of other names are left out.

    Returns
    -------
    dict of (m,) float
        The quantities that the file has. Every value is finite.

    Raises
    ------
    FileError
        As :func:`read_text_table`; or the file has none of the quantities, one of them twice or in an unknown unit, or a cell
        of one is no finite number.
    """
    table, found = read_text_table(path), {}
    for quantity, si in quantities.items():
        for word in QUANTITY_NAMES.get(quantity, (quantity,)):
            matches = [(name, unit) for name in table.names if (unit := _unit_of(name, word, table.units)) is not None]
            if len(matches) > 1:
                raise FileError(f"'{path}' has two columns for {quantity}: leave only one of them.")
            if matches:
                found[quantity] = _in_si(path, table, *matches[0], quantity, si)
                break
    if not found:
        raise FileError(f"'{path}' has none of the columns {', '.join(quantities)}: the line above its numbers must name them.")
    return found


def _unit_of(name: str, word: str, units: Mapping[str, str]) -> str | None:
    """Return the unit that a column states, empty if it states none; None if its name is no word for the quantity."""
    match = re.fullmatch(rf"{re.escape(word)}(?:\s*[(\[]\s*(.+?)\s*[)\]]|_(\S+))?", name, flags=re.IGNORECASE)
    return None if match is None else match[1] or match[2] or units.get(name, "")


def _in_si(path: str | os.PathLike, table: TextTable, name: str, unit: str, quantity: str, si: str) -> np.ndarray:
    if unit and unit not in UNITS[si]:
        raise FileError(
            f"Column '{name}' of '{path}' is in a unit that is not known here: write {quantity} in one of "
            f"{', '.join(UNITS[si])}."
        )
    values = table.values[:, table.names.index(name)]
    (bad,) = np.nonzero(~np.isfinite(values))
    if len(bad):
        line = int(table.lines[bad[0]])
        text = next((cell for number, cell in table.wrong.get(name, []) if number == line), "")
        raise FileError(
            f"Line {line} of '{Path(path).name}' has '{text[:40]}' for {quantity}: write a number, or remove the line."
        )
    return values * UNITS[si].get(unit, 1.0)


@dataclass(frozen=True)
class _Form:
    """How the cells of a file are written."""

    separator: str
    decimal: str
    width: int = 0

    def cells(self, line: str) -> list[str]:
        if self.separator == " ":
            return line.split()
        if '"' in line:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=self.separator), [])]
        return [cell.strip() for cell in line.split(self.separator)]

    def number(self, cell: str) -> float | None:
        """Return the number of a cell, NaN if it is missing, None if it is text."""
        try:
            found = float(cell.replace(",", ".") if self.decimal == "," else cell)
        except ValueError:
            return math.nan if cell.lower() in MISSING else None
        return found if abs(found) <= LARGEST_NUMBER else math.nan


def _lines(file: Iterator[str], path: Path) -> tuple[list[tuple[int, str]], list[str]]:
    """Return the lines that hold cells, with their numbers, and the last comment above them."""
    lines: list[tuple[int, str]] = []
    comments: list[str] = []
    for number, line in enumerate(file, start=1):
        if len(line) > LONGEST_LINE:
            raise FileError(f"A line of '{path.name}' has more than {LONGEST_LINE:,} characters: this is no table.")
        text = line.strip("\r\n")
        if text.lstrip().startswith(("#", "%")):
            comments = [text.lstrip().lstrip("#%").strip()] if not lines else comments
        elif text.strip(" "):
            lines.append((number, text))
    return lines, comments


def _form(lines: Sequence[str], path: Path) -> tuple[_Form, int]:
    """Return how the numbers are written, and the first line of the table: the form with the most lines of equal width."""
    found: list[tuple[tuple[int, int, int], _Form, int]] = []
    for order, separator in enumerate(SEPARATORS):
        for decimal in (".", ",") if separator != "," else (".",):
            form = _Form(separator, decimal)
            rows = [form.cells(line) for line in lines]
            widths = [_width(row, form) for row in rows]
            usual = max(set(widths) - {0}, key=widths.count, default=0)
            first = _first_row(widths, usual)
            if usual and first is not None:
                key = sum(width == usual for width in widths), min(usual, 2), -order - (decimal == ",")
                found.append((key, _Form(separator, decimal, usual), first))
    if not found:
        raise FileError(f"'{path.name}' holds no numbers: there are no measurements in it, give a table of them.")
    return max(found, key=itemgetter(0))[1:]


def _width(row: Sequence[str], form: _Form) -> int:
    """Return the number of cells of a row of numbers, without empty ones at its end; 0 for text with less than half numbers."""
    width = _filled(row)
    numbers = [number for number in map(form.number, row[:width]) if number is not None]
    return width if any(number == number for number in numbers) and 2 * len(numbers) >= width else 0


def _first_row(widths: Sequence[int], usual: int) -> int | None:
    """Return the first line from which on lines of numbers of the usual width follow each other."""
    for first, width in enumerate(widths):
        run = widths[first : first + FIRST_RUN]
        if width == usual and 4 * sum(0 < one <= usual for one in run) >= 3 * len(run):
            return first
    return None


def _header(
    head: Sequence[list[str]], comments: Sequence[str], form: _Form, rows: Sequence[list[str]], path: Path
) -> tuple[list[str], dict[str, str], list[str]]:
    """Return the names of the columns, their units by name, and what was not used."""
    width, notes = form.width, []
    wide: list[list[str]] = []
    for cells in reversed(head):  # directly above the numbers
        if sum(map(bool, cells)) < 2 and width > 1 or all(form.number(cell) is not None for cell in cells):
            break
        wide.insert(0, cells)
    if not wide and comments:
        wide = [form.cells(comments[-1])]
        wide = wide if len(wide[0]) == width else []
    fitting = [cells for cells in wide if _filled(cells) == width or len(cells) == width]
    if len(fitting) > 1 and (len(wide) == 2 or _are_units(fitting[-1])):
        names, below = fitting[-2:]
    elif fitting:
        names, below = fitting[-1], []
    elif wide and width - 1 <= _filled(wide[-1]) <= 2 * width:
        names, below = wide[-1], []
        if _filled(names) < width:
            counts = [form.number(row[0]) for row in rows[:FIRST_RUN] if row]
            steps = [b - a for a, b in zip(counts, counts[1:]) if a is not None and b is not None]
            is_index = len(steps) == len(counts) - 1 > 0 and set(steps) == {1.0}
            names = ["column_1", *names] if is_index else [*names, f"column_{width}"]
            where = "first, which counts the lines," if is_index else "last"
            notes.append(f"its header has {width - 1} names for {width} columns: the {where} one has none.")
        else:
            notes.append(f"its header has {_filled(names)} names for {width} columns: those at its end were not used.")
    else:
        if wide:
            notes.append(f"its header was not used, because it has {_filled(wide[-1])} names for {width} columns.")
        return [f"column_{i + 1}" for i in range(width)], {}, notes
    names = [name or f"column_{i + 1}" for i, name in enumerate(names[:width])]
    seen: dict[str, int] = {}
    for i, name in enumerate(names):
        seen[name] = seen.get(name, 0) + 1
        if seen[name] > 1:
            names[i] = f"{name} {seen[name]}"
    units = {name: unit.strip("[]() ") for name, unit in zip(names, below) if unit.strip("[]() ")}
    return names, units, notes


def _filled(cells: Sequence[str]) -> int:
    """Return the number of cells without empty ones at the end."""
    return max((i + 1 for i, cell in enumerate(cells) if cell), default=0)


def _are_units(cells: Sequence[str]) -> bool:
    """Return True if a line of text below another one may be units: all in brackets, or short."""
    known = [cell for cell in cells if cell]
    return bool(known) and all(cell[0] in "[(" and cell[-1] in ")]" or len(cell) <= LONGEST_UNIT for cell in known)


def _values(
    lines: Sequence[tuple[int, str]], names: Sequence[str], form: _Form
) -> tuple[np.ndarray, dict[str, list[tuple[int, str]]]]:
    """Return the numbers of the lines, and the cells that hold none."""
    values = np.full((len(lines), len(names)), np.nan)
    wrong: dict[str, list[tuple[int, str]]] = {}
    for row, (number, text) in zip(values, lines, strict=True):
        for i, (name, cell) in enumerate(zip(names, form.cells(text))):
            found = form.number(cell)
            row[i] = value = math.nan if found is None else found
            if cell and math.isnan(value):
                wrong.setdefault(name, []).append((number, cell))
    return values, wrong
