# SPDX-License-Identifier: GPL-3.0-or-later
"""What a kind states for the rest of the package: how recordings show it, how it is searched for, and how it is drawn.

The gap analysis, the plans of experiments, the reports and the documentation know no effect by its name. They read what
:class:`.specification.Kind` and :class:`.specification.Form` state in the words of this module.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

FEATURES = {
    "unloading": "what is different after unloading; the loading curve alone could be that of a nonlinear spring",
    "timing": "what happens at one depth at different times, or at one time after different speeds",
    "rest": "what happens while a texel is without load, or in the same way under different loads",
    "places": "how neighbours differ as the load moves; at one place it is some pattern of texels that grows with the load",
    "cycles": "how a second cycle differs from the first; in a single cycle it lowers the unloading curve",
}
"""Features of recordings by which an effect is known. Recordings without them do not identify it, however well it fits."""
FAMILIES = {
    "nonlinear": "bends the curve of reading over load",
    "loop": "opens a loop between loading and unloading at any speed; the loading curve of the loop is bent as well",
    "late": "answers late, so that it lowers the unloading curve of a single cycle",
}
"""Families of effects that resemble each other, so that a better fit says little which of them acts."""

FIT, SILENT_TEXELS, STEPS, SCATTER = "fit", "silent texels", "steps", "scatter"
FOUND_BY = {
    FIT: "a fit of its formulas",
    SILENT_TEXELS: "readings that hardly follow the load",
    STEPS: "steps in the readings",
    SCATTER: "the residual of the final model; predictions are without it",
}
"""How an effect is found in recordings."""
SIGNATURES = {
    "pull": "readings below zero where it predicts a pull",
    "unloaded": "readings without load, from the beginning of the trials on",
    "end": "it comes to an end within the session",
}
"""What a fit of an effect must show to be reported under its name, if it may otherwise stand for something else."""
NEEDS = {
    "temperature": "temperatures that were recorded and vary",
    "clock": "recordings of which a session says how the time went on between them",
    "no clock": "recordings of which each begins with an untouched sensor",
    "signed channels": "channels of which some rise and others fall under the same load",
    "axes": "the same, with a number of channels that is a multiple of three",
}
"""What recordings must hold for an effect, or a form of it, to be a candidate."""
DRAWINGS = {
    "time": "reading over time, for a course of depths",
    "depth": "force over depth, for a course of depths",
    "force": "reading over force",
    "speed": "friction at 1 N over the sliding speed",
    "pressings": "peak reading of each of forty pressings under steady sliding",
    "row": "readings of a column of texels with a load on one of them",
    "texel": "readings of single texels under the same load",
    "ball": "forces of a ball along a column of texels",
}
"""Experiments in which effects are drawn."""


class Run(Protocol):
    """What one untouched sensor did, as columns see it. Forces are without units: 1 is the base model's largest force."""

    @property
    def time(self) -> np.ndarray:
        """Times of the samples, (T,) s."""

    @property
    def load(self) -> np.ndarray:
        """The base model's normal force of each texel, (T, n)."""

    @property
    def elastic(self) -> np.ndarray:
        """The same without damping, (T, n); positive exactly where there is contact."""

    @property
    def work(self) -> np.ndarray:
        """Work done on each texel so far, pressing and sliding, (T, n); 1 is the largest of all runs."""


class Recordings(Protocol):
    """All fitted recordings of a rig, as columns see them."""

    @property
    def place(self) -> np.ndarray:
        """Places of the texels in their plane, in pitches, (n, 2)."""

    @property
    def rows(self) -> np.ndarray | None:
        """Row and column of each texel, (n, 2); None if they are not in a grid."""

    @property
    def duration(self) -> float:
        """Of the longest run, s."""

    @property
    def full_path(self) -> float:
        """Load that was put on the texel that was pressed most, over all of its presses; full load is 1."""


Columns = Callable[[np.ndarray, Run, Recordings], list[np.ndarray]]
"""From the signal (T, n) before an effect, the columns (T, n) that it can add to it."""


def no_columns(x: np.ndarray, run: Run, recorded: Recordings) -> list[np.ndarray]:
    """For variants that are parameters of single texels alone."""
    return []


@dataclass(frozen=True)
class Variant:
    """What an effect can add to a signal whatever its formula: all sums of some columns, each with a coefficient.

    Formulas of the same effect from other papers lie near this cone. An effect whose formulas have two directions, as
    hysteresis that leads or trails, has a variant for each. The columns are functions of numpy arrays; those with memory are
    made from :mod:`.signal_operators`, which they import when they are called.

    Attributes
    ----------
    rank : float
        Place on the way from the contact to the reading, among the variants in contact or among the others: lower acts first.
    columns : callable
    is_signed : bool
        Whether the coefficients may be negative.
    name : str
        Which direction; empty if there is one only.
    in_contact : bool
        Whether it acts on forces, so that the net force shows it as well.
    after_clip : bool
        Whether it acts after damping was added and the force was clipped at zero, so that a texel can pull.
    texel_columns : tuple of str
        Of which parameters of single texels it consists besides: "gain", "offset", "rate", "fading".
    needs_neighbours : bool
        Whether it passes something from texel to texel.
    displaces : bool
        Whether it moves the texels, so that it changes what the base model is told and adds nothing to a signal. Its
        coefficients are the parameters of the form "rigid".
    kind : str
        Name of the effect, which the :class:`.specification.Kind` writes.
    """

    rank: float
    columns: Columns = no_columns
    is_signed: bool = False
    name: str = ""
    in_contact: bool = False
    after_clip: bool = False
    texel_columns: tuple[str, ...] = ()
    needs_neighbours: bool = False
    displaces: bool = False
    kind: str = ""

    @property
    def label(self) -> str:
        """Kind and direction."""
        return f"{self.kind}/{self.name}" if self.name else self.kind


def _twenty_seconds() -> np.ndarray:
    return np.linspace(0, 20, 2001)


def _press_and_hold() -> np.ndarray:
    return 0.002 * np.interp(_twenty_seconds(), [0, 1, 1.3, 12, 12.3, 20], [0, 0, 1, 1, 0, 0])


def cycles(count: int, time: np.ndarray, depth: float = 0.002) -> np.ndarray:
    """Return the course of the depth (m) in so many presses in the form of a cosine."""
    return depth * 0.5 * (1 - np.cos(2 * np.pi * count * time / time[-1]))


@dataclass(frozen=True, eq=False)
class Drawing:
    """The experiment in which the documentation draws the forms of an effect.

    Attributes
    ----------
    over : str
        One of :data:`DRAWINGS`.
    time, depth : (T,) float, s and m
        Course of the depth, for a drawing over time or depth: a press that is held, if none is given.
    values : dict of str to dict
        By the name of a form, values that replace its defaults.
    """

    over: str = "time"
    time: np.ndarray = field(default_factory=_twenty_seconds)
    depth: np.ndarray = field(default_factory=_press_and_hold)
    values: dict[str, dict[str, float]] = field(default_factory=dict)
