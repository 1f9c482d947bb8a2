# SPDX-License-Identifier: GPL-3.0-or-later
"""What an experiment hands over: rows that compare numbers, and pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Row:
    """One number beside the paper's.

    Attributes
    ----------
    what : str
    printed : str
        The paper's own, or a dash.
    expected, measured : str
        What has to come out by a closed form or by the errata, and what came out.
    kept : bool or None
        The measured number is within its tolerance; None where there is nothing to keep.
    note : str
        The tolerance and its reason, or what is wrong with the print.
    """

    what: str
    printed: str
    expected: str
    measured: str
    kept: bool | None
    note: str = ""


def compare(what: str, printed: str, expected: float, measured: float, tolerance: float, unit: str, note: str = "") -> Row:
    """Return the row of a number that has to be `expected` within an absolute `tolerance`, shown to a tenth of that."""
    decimals = min(max(0, math.ceil(1 - math.log10(tolerance))), 9)
    kept = bool(abs(measured - expected) <= tolerance)
    words = f"within {tolerance:.2g} {unit}".rstrip() + (f"; {note}" if note else "")
    return Row(
        what, printed, f"{expected:.{decimals}f} {unit}".rstrip(), f"{measured:.{decimals}f} {unit}".rstrip(), kept, words
    )


def below(what: str, printed: str, measured: float, limit: float, unit: str, note: str = "") -> Row:
    """Return the row of a number that has to stay below `limit`."""
    return Row(what, printed, f"< {limit:.3g} {unit}".rstrip(), f"{measured:.3g} {unit}".rstrip(), bool(measured < limit), note)


@dataclass(frozen=True)
class Picture:
    """A figure: its PNG, and the PDF beside it where it is no render."""

    path: Path
    caption: str
    wide: bool = False


@dataclass
class Chapter:
    """One experiment.

    Attributes
    ----------
    title : str
    where : str
        Table, figure or section of the paper.
    text : str
        What was done, in plain sentences.
    rows : list of Row
    pictures : list of Picture
    """

    title: str
    where: str
    text: str
    rows: list[Row] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)

    @property
    def kept(self) -> bool:
        """True when no row is outside its tolerance."""
        return all(row.kept is not False for row in self.rows)
