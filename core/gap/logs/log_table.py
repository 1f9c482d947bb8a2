# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of a log: columns of numbers that share one clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...errors import FileError

LARGEST_FILE = 2 * 2**30
"""Bytes of a log."""
MOST_VALUES = 100_000_000
"""Numbers of a log that are read: 0.8 GB, far more than a fit can use."""
MOST_COLUMNS = 5000
FEWEST_ROWS = 8
"""Samples of a trial, see :mod:`..dataset.rig`; shorter arrays are settings and no recordings."""
LARGEST_NUMBER = 1e30
"""Numbers of a larger magnitude count as missing."""


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
    kind : str
        Of the file, as "CSV".
    tables : tuple of LogTable
    notes : tuple of str
        What was left out, one sentence each.
    label : str
        Name by which answers know it, where the name of the file alone is not enough.
    """

    path: Path
    kind: str
    tables: tuple[LogTable, ...]
    notes: tuple[str, ...] = ()
    label: str = ""

    @property
    def name(self) -> str:
        """Name by which answers know the file."""
        return self.label or self.path.name

    @property
    def stem(self) -> str:
        """The name without its ending, fit for that of a recording."""
        return self.name.removesuffix(self.path.suffix).replace("/", "_")


def with_distinct_names(logs: Sequence[LogFile]) -> list[LogFile]:
    """Return logs of which those in several folders with the same name are called ``FOLDER/NAME``.

    Raises
    ------
    FileError
        Two are still called the same.
    """
    paths = [log.path for log in logs]
    names = [path.name for path in paths]
    if len(set(names)) < len(names):
        logs = [replace(log, label=f"{log.path.absolute().parent.name}/{log.path.name}") for log in logs]
    names = [log.name for log in logs]
    for one in names:
        if names.count(one) > 1:
            raise FileError(f"Two logs are called '{one}': rename one, so that each recording has a name.")
    return list(logs)


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
        found[~(np.abs(found) <= LARGEST_NUMBER)] = np.nan
    return found
