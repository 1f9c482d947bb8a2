# SPDX-License-Identifier: GPL-3.0-or-later
"""One table of many rigs: base model, amended model and a model made by hand, on recordings that were not fitted."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import FileError, read_errors_said
from ...io.csv_table import is_number
from ...io.input_files import read_bounded
from ..dataset.rig import Rig
from ..selection.findings import Diagnosis
from .comparison import GapErrors

HEADER = ("rig", "base", "Palpate", "by hand", "Palpate / by hand", "named, with confidence")
LARGEST_TABLE = 1 << 20
"""Bytes of a file of errors by hand; longer ones are something else."""


@dataclass(frozen=True)
class TableRow:
    """One rig.

    Attributes
    ----------
    name : str
    base, amended : float
        Error on the check recordings as a share of the range of all readings (see :func:`.comparison.nrmse`).
    by_hand : float or None
        That of a model made by hand; None if none is known.
    said : str
        The names of the effects with their confidences, or the verdict.
    """

    name: str
    base: float
    amended: float
    by_hand: float | None
    said: str

    @property
    def ratio(self) -> float | None:
        """Error of the amended model over that of the model made by hand."""
        return None if self.by_hand is None else self.amended / self.by_hand


def require_check(rig: Rig) -> None:
    """Raise :class:`FileError` unless a rig has recordings that are not fitted."""
    if not any(trial.use == "check" for trial in rig.trials):
        raise FileError(f"Rig '{rig.name}' has no recording with use = \"check\": give it one, by which the table can judge.")


def row_of(result: Diagnosis, errors: GapErrors, by_hand: float | None = None) -> TableRow:
    """Return the row of a diagnosis whose rig has check recordings."""
    before, after = errors.base["check"], errors.amended["check"]
    assert before is not None and after is not None  # require_check
    said = ", ".join(f"`{found.name}` {found.confidence:.2f}" for found in result.findings) or result.verdict
    return TableRow(result.rig.name, before, after, by_hand, said)


def median_ratio(rows: Iterable[TableRow]) -> float | None:
    """Return the median error over that by hand; None if none is known."""
    ratios = [row.ratio for row in rows if row.ratio is not None]
    return float(np.median(ratios)) if ratios else None


def cells(rows: Sequence[TableRow]) -> list[tuple[str, ...]]:
    """Return the rows as text, the header first and the median last."""
    table: list[tuple[str, ...]] = [HEADER]
    for row in rows:
        own = ("", "") if row.by_hand is None or row.ratio is None else (f"{row.by_hand:.2%}", f"{row.ratio:.2f}")
        table.append((row.name, f"{row.base:.2%}", f"{row.amended:.2%}", *own, row.said))
    median = median_ratio(rows)
    return table if median is None else [*table, ("median", "", "", "", f"{median:.2f}", "")]


def markdown(rows: Sequence[TableRow]) -> str:
    """Return the table in Markdown."""
    header, *body = ("| " + " | ".join(one.replace("|", "\\|") for one in row) + " |" for row in cells(rows))
    return "\n".join([header, "| --- | ---: | ---: | ---: | ---: | --- |", *body]) + "\n"


def read_by_hand(path: Path, rigs: Iterable[str]) -> Mapping[str, float]:
    """Return the errors of models by hand by the name of the rig, from a CSV file with the columns rig and error.

    Raises
    ------
    FileError
        The file cannot be read, has other columns, an error that is no positive number, or a rig that is not among `rigs`.
    """
    known = set(rigs)
    with read_errors_said(path):
        text = read_bounded(path, LARGEST_TABLE).decode("utf-8-sig", "replace")
    rows = list(csv.reader(text.splitlines()))
    if not rows or [cell.strip() for cell in rows[0]] != ["rig", "error"]:
        raise FileError(f"'{path.name}' should begin with the line rig,error: write the errors of the models by hand below it.")
    found: dict[str, float] = {}
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        where = f"Line {number} of '{path.name}'"
        if len(row) != 2 or row[0].strip() not in known:
            raise FileError(f"{where} names no rig of the table: write the name of a rig and its error, as in rig,0.0113.")
        if not (is_number(row[1]) and 0.0 < float(row[1]) < math.inf):
            raise FileError(f"{where} has the error {row[1].strip()!r:.40}: write a share of the range above zero, as 0.0113.")
        found[row[0].strip()] = float(row[1])
    return found
