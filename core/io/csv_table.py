# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of numbers from CSV files with one header line. Every complaint about a cell names its line and its column.

Two kinds of tables are read, see :class:`CsvFormat`: recordings, which programs write, and measurements, which people type.
:func:`read_table` reads all columns, :func:`read_columns` those of given quantities in SI units. For the latter, the header of
a column is a quantity, ``compression``, when its numbers are in SI units, or a quantity and a unit: ``compression (mm)``,
``compression [mm]`` or ``compression_mm``.
"""

from __future__ import annotations

import csv
import math
import os
import re
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import FileError, read_errors_said
from .regular_file import open_regular

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


@dataclass(frozen=True)
class CsvFormat:
    """What a table may look like.

    Attributes
    ----------
    separators : str
        Characters that may separate cells; the one that is most frequent in the header does.
    comments : bool
        Lines that begin with # are skipped.
    missing : bool
        A cell may be empty and is then NaN.
    largest : int, bytes
        Longer files are refused.
    """

    separators: str
    comments: bool
    missing: bool
    largest: int


RECORDINGS = CsvFormat(separators=",", comments=False, missing=True, largest=512 * 2**20)
"""Long tables that programs write. Some hundred million numbers would fill the memory long before a fit ends."""
MEASUREMENTS = CsvFormat(separators=",;\t", comments=True, missing=False, largest=200 * 2**20)
"""Tables that people type or export from spreadsheets; some thousands of lines are enough for a fit."""


@dataclass(frozen=True)
class Table:
    """A table that was read.

    Attributes
    ----------
    names : list of str
        Of the columns, as in the header.
    values : (rows, columns) float
        NaN where a cell is empty and may be.
    """

    names: list[str]
    values: np.ndarray


def read_table(
    path: str | os.PathLike, form: CsvFormat = RECORDINGS, choose: Callable[[list[str]], Sequence[int]] | None = None
) -> Table:
    """Read a CSV file.

    Parameters
    ----------
    path : path
    form : CsvFormat
    choose : callable, optional
        Returns the numbers of the columns to read, given the names of all. Cells of other columns may hold anything. Without
        it all columns are read, their names must differ, and all lines must have the same number of cells.

    Raises
    ------
    FileError
        The file cannot be read, is too large, has no header or no data, or a cell is not a finite number.
    """
    path = Path(path)
    try:
        with read_errors_said(path):
            table = _read(path, form, choose)
    except UnicodeDecodeError as error:
        raise FileError(f"'{path.name}' is not a text file in UTF-8: export the table as CSV.") from error
    except csv.Error as error:
        raise FileError(f"'{path.name}' is not a table ({error}): export it as CSV, with quotation marks closed.") from error
    if len(table.values) == 0:
        raise FileError(f"'{path.name}' has a header and no data: there are no measurements below its header, add them.")
    return table


def _read(path: Path, form: CsvFormat, choose: Callable[[list[str]], Sequence[int]] | None) -> Table:
    size = path.stat().st_size
    if size > form.largest:
        raise FileError(
            f"'{path.name}' holds {size / 1e9:.1f} GB and at most {form.largest / 1e9:.1f} GB are read: "
            "cut it into several files, or keep fewer samples per second."
        )
    with open_regular(path, "r", encoding="utf-8-sig", newline="") as file:
        lines = _lines(file, form)
        names, separator = _header(lines, path, form)
        chosen = None if choose is None else list(choose(names))
        if chosen is None:
            _check_names(names, path)
        values = _values(lines, names, chosen, separator, _Context(path, form))
    return Table(names if chosen is None else [names[i] for i in chosen], values)


def read_columns(path: str | os.PathLike, quantities: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Read the columns of given quantities from a table of measurements, in SI units.

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
        As :func:`read_table`; or the file has none of the quantities, one of them twice, or in an unknown unit.
    """
    found: dict[str, float] = {}

    def choose(names: list[str]) -> list[int]:
        chosen = []
        for number, cell in enumerate(names):
            for name, unit in quantities.items():
                factor = _unit_factor(path, cell, name, unit)
                if factor is None:
                    continue
                if name in found:
                    raise FileError(f"'{path}' has two columns for {name}: leave only one of them.")
                found[name] = factor
                chosen.append(number)
        if not found:
            raise FileError(f"'{path}' has none of the columns {', '.join(quantities)}: its first line must name them.")
        return chosen

    table = read_table(path, MEASUREMENTS, choose)
    return {name: table.values[:, i] * factor for i, (name, factor) in enumerate(found.items())}


def _unit_factor(path: str | os.PathLike, cell: str, name: str, unit: str) -> float | None:
    """Return the factor from a column's unit to `unit`; None when the column is another quantity."""
    match = re.fullmatch(rf"{re.escape(name)}(?:\s*[(\[]\s*(.+?)\s*[)\]]|_(\S+))?", cell, flags=re.IGNORECASE)
    if match is None:
        return None
    written = match[1] or match[2] or unit
    if written not in UNITS[unit]:
        raise FileError(
            f"Column '{cell}' of '{path}' is in a unit that is not known here: write {name} in one of {', '.join(UNITS[unit])}."
        )
    return UNITS[unit][written]


def harmless_cell(text: str) -> str:
    """Return the text of a cell so that no spreadsheet takes it for a formula.

    A spreadsheet computes a cell that begins with ``=``, ``+``, ``-`` or ``@``, and a formula can start programs. An object
    of a .blend may be called ``=cmd|…``. An apostrophe before it makes it text, also behind what other languages
    use as separator.
    """
    return re.sub(r"(^|[;|\t\r\n])(\s*)(?=[=+\-@\uff1d\uff0b\uff0d\uff20])", r"\1'\2", text)


def _lines(file: Iterable[str], form: CsvFormat) -> Iterator[tuple[int, str]]:
    """Yield the lines that hold cells, with their numbers in the file."""
    for number, line in enumerate(file, start=1):
        text = line.rstrip("\r\n")
        if text.strip() and not (form.comments and text.lstrip().startswith("#")):
            yield number, text


def _header(lines: Iterator[tuple[int, str]], path: Path, form: CsvFormat) -> tuple[list[str], str]:
    """Return the names of the columns and the separator."""
    _, line = next(lines, (0, ""))
    separator = max(form.separators, key=line.count)
    names = [name.strip() for name in next(csv.reader([line], delimiter=separator), [])]
    if not any(names):
        raise FileError(f"'{path.name}' is empty: it needs a first line that names its columns, and numbers below.")
    if len(names) == 1 and any(mark in names[0] for mark in ";\t"):
        raise FileError(f"The columns of '{path.name}' are not separated by commas: export it with a comma as separator.")
    return names, separator


def _check_names(names: list[str], path: Path) -> None:
    if all(_is_number(name) for name in names):
        raise FileError(f"'{path.name}' begins with numbers, not with column names: write `time` and the others in line 1.")
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise FileError(f"Column '{name}' is twice in the header of '{path.name}': rename or remove one of them.")
        seen.add(name)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class _Context:
    """Which file is read, and as what: for complaints."""

    path: Path
    form: CsvFormat

    def complain(self, line: int, names: Sequence[str], cells: Sequence[str]) -> None:
        """Raise for the first cell of a line that is no finite number."""
        remedy = "write a number, or leave the cell empty" if self.form.missing else "write a number, or remove the line"
        for name, cell in zip(names, cells, strict=True):
            text = cell.strip()
            if not text and self.form.missing:
                continue
            if not _is_number(text):
                raise FileError(f"Line {line} of '{self.path.name}' has '{text[:40]}' for {name}: {remedy}.")
            if not math.isfinite(float(text)):
                raise FileError(f"Line {line} of '{self.path.name}' has {text[:40]} for {name}: {remedy}.")
            if abs(float(text)) > LARGEST_NUMBER:
                raise FileError(
                    f"Line {line} of '{self.path.name}' has {text[:40]} for {name}, which nothing measured can be: {remedy}."
                )


def _values(
    lines: Iterator[tuple[int, str]], names: list[str], chosen: list[int] | None, separator: str, context: _Context
) -> np.ndarray:
    """(rows, columns) float: the chosen cells of all lines."""
    values, width = array("d"), len(names)
    heads = names if chosen is None else [names[i] for i in chosen]
    for number, line in lines:
        cells = line.split(separator) if '"' not in line else next(csv.reader([line], delimiter=separator))
        if chosen is not None:
            cells = [cells[i] if i < len(cells) else "" for i in chosen]
        elif len(cells) != width:
            raise FileError(
                f"Line {number} of '{context.path.name}' has {len(cells)} cells and the header has {width}: "
                "leave a missing value's cell empty, but keep its comma."
            )
        try:
            row = [float(cell) if cell and not cell.isspace() else math.nan for cell in cells]
        except ValueError:
            context.complain(number, heads, cells)
        if not all(-LARGEST_NUMBER <= value <= LARGEST_NUMBER for value in row):  # false for NaN, too
            context.complain(number, heads, cells)
        values.extend(row)
    return np.frombuffer(values, float).reshape(-1, len(heads)) if values else np.zeros((0, len(heads)))
