# SPDX-License-Identifier: GPL-3.0-or-later
"""What a kind states for the rest of the package: how recordings show it, how it is searched for, and how it is drawn.

The gap analysis, the plans of experiments, the reports and the documentation know no effect by its name. They read what
:class:`.specification.Kind` and :class:`.specification.Form` state in the words of this module.
"""

from __future__ import annotations

from dataclasses import dataclass, field

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
