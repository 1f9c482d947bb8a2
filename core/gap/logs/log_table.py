# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of a log: columns of numbers that share one clock."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...errors import FileError
from ...io.csv_table import LARGEST_NUMBER
from ...io.text_table import MOST_VALUES
from ..dataset.column_names import PRESSURES
from .column_behaviour import is_clock

LARGEST_FILE = 2 * 2**30
"""Bytes of a log."""
MOST_COLUMNS = 5000
FEWEST_ROWS = 8
"""Samples of a trial, see :mod:`..dataset.rig`; shorter arrays are settings and no recordings."""
MOST_FRAME_ROWS = 512
"""Rows of a matrix that may be a frame; longer ones are recordings. Chosen by eye: a tactile array has fewer rows."""


@dataclass(frozen=True)
class LogTable:
    """Columns of equal length.

    Attributes
    ----------
    name : str
        Topic of a bag, group of an HDF5 file; empty where a file has one table.
    columns : dict of str to (T,) float
        By their names in the file; NaN where a value is missing.
    units : dict of str to str
        Of the columns for which the file states one.
    grids : dict of str to (int, int)
        Rows and columns of arrays of pictures, by the name of the array; its columns are ``NAME_0``, ``NAME_1``, …
    """

    name: str
    columns: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    grids: dict[str, tuple[int, int]] = field(default_factory=dict)

    @property
    def sample_count(self) -> int:
        """Number of samples."""
        return len(next(iter(self.columns.values())))

    def full_name(self, column: str) -> str:
        """Return the name of a column that no other table of the file has."""
        return f"{self.name}/{column}" if self.name else column


@dataclass(frozen=True)
class LogFile:
    """A log.

    Attributes
    ----------
    path : Path
    tables : tuple of LogTable
    notes : tuple of str
        What was left out, one sentence each.
    label : str
        Name by which answers know it, where the name of the file alone is not enough.
    has_frames : bool
        True if several files are this log together, a sample each.
    """

    path: Path
    tables: tuple[LogTable, ...]
    notes: tuple[str, ...] = ()
    label: str = ""
    has_frames: bool = False

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Values of all columns, by the names that no other table of the file has."""
        return {table.full_name(name): values for table in self.tables for name, values in table.columns.items()}

    @property
    def name(self) -> str:
        """Name by which answers know the file."""
        return self.label or self.path.name

    @property
    def stem(self) -> str:
        """The name without its ending, fit for that of a recording."""
        return self.name.removesuffix(self.path.suffix).replace("/", "_")


def with_distinct_names(logs: Sequence[LogFile], named: Sequence[str] = ()) -> list[LogFile]:
    """Return logs of which those in several folders with the same name are called ``FOLDER/NAME``; frames are one log.

    Parameters
    ----------
    logs : sequence of LogFile
    named : sequence of str
        What answers name; frames stay files of their own if it is one of these.

    Raises
    ------
    FileError
        Two are still called the same.
    """
    found = list(logs)
    if not {log.path.name for log in found} & set(named):
        found = _joined_frames(found)
    if len({log.path.name for log in found}) < len(found):
        found = [replace(log, label=f"{log.path.absolute().parent.name}/{log.path.name}") for log in found]
    names = [log.name for log in found]
    for one in names:
        if names.count(one) > 1:
            raise FileError(f"Two logs are called '{one}': rename one, so that each recording has a name.")
    return found


def _joined_frames(logs: list[LogFile]) -> list[LogFile]:
    """Return logs that are matrices of one shape without names and clock as one log, a sample for each file.

    The number in the name of a file, with the unit behind it, is the load; the samples are in its order.
    """
    numbers = [match for log in logs if (match := re.search(r"(\d+(?:\.\d+)?)\s*([A-Za-z]*)$", log.path.stem))]
    is_plain = all(len(log.tables) == 1 and next(iter(log.tables[0].columns)) == "column_1" for log in logs)
    if not len(numbers) == len(logs) > 1 or not is_plain:
        return logs
    frames = [np.stack(list(log.tables[0].columns.values()), axis=1) for log in logs]
    rows, columns = frames[0].shape
    if any(frame.shape != (rows, columns) for frame in frames) or rows > MOST_FRAME_ROWS or columns < 2:
        return logs
    if any(is_clock(column) for frame in frames for column in frame.T):
        return logs
    loads, unit = np.array([float(match[1]) for match in numbers]), numbers[0][2]
    order = np.argsort(loads, kind="stable")
    texels = np.stack(frames)[order].reshape(len(frames), -1)
    name = f"pressure ({unit})" if unit in PRESSURES else "load"
    table = LogTable(
        "",
        {name: loads[order], **{f"texel_{i}": np.ascontiguousarray(one) for i, one in enumerate(texels.T)}},
        {name: unit} if unit and name == "load" else {},
        {"texel": (rows, columns)},
    )
    note = f"{len(logs)} files are taken for frames of {rows} × {columns} texels, in the order of the {name} in their names."
    return [replace(logs[0], tables=(table,), notes=(note, *logs[0].notes), label=f"{len(logs)} frames", has_frames=True)]


def require_size(values: int, columns: int, path: Path) -> None:
    """Raise FileError where a file holds, or says that it holds, more than is read."""
    if values > MOST_VALUES or columns > MOST_COLUMNS:
        raise FileError(
            f"'{path.name}' holds {values:,} numbers in {columns:,} columns and at most {MOST_VALUES:,} in {MOST_COLUMNS:,} "
            "are read: cut it into several files, or keep fewer samples per second."
        )


def cleaned(values: np.ndarray) -> np.ndarray:
    """Return numbers as float64, with NaN for what is infinite or too large to be measured."""
    found = np.array(values, dtype=float)
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(found) <= LARGEST_NUMBER, found, np.nan)
