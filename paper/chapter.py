# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of an experiment: rows that compare numbers, and pictures."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Row:
    """One number beside the paper's number.

    Attributes
    ----------
    what : str
    printed : str
        The paper's number, or a dash.
    expected, measured : str
        The number required by a closed form or by a correction of the paper, and the number computed here.
    kept : bool or None
        True if the computed number is within its tolerance; None if it is not judged.
    note : str
        The tolerance and its reason, or an error in the printed number.
    """

    what: str
    printed: str
    expected: str
    measured: str
    kept: bool | None
    note: str = ""


def compare(what: str, printed: str, expected: float, measured: float, tolerance: float, unit: str, note: str = "") -> Row:
    """Return the row of a number that has to equal `expected` within the absolute `tolerance`; a tenth of it is displayed."""
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
    """A figure: its PNG, and beside it a PDF unless it is a render."""

    path: Path
    caption: str
    wide: bool = False


def draw_both(stem: Path, draw: Callable[[Path], object]) -> Path:
    """Draw a figure as PDF and as PNG, and return the PNG."""
    for kind in (".pdf", ".png"):
        draw(stem.with_suffix(kind))
    return stem.with_suffix(".png")


@dataclass
class Chapter:
    """One experiment.

    Attributes
    ----------
    title : str
    where : str
        Table, figure or section of the paper.
    text : str
        What was done.
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
        """True if no row is outside its tolerance."""
        return all(row.kept is not False for row in self.rows)
