# SPDX-License-Identifier: GPL-3.0-or-later
"""What a recording cannot tell, whatever is fitted to it: effects whose mark was never brought out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..fitting.noise_floor import Coverage
from ..forward.predictor import Model, Predictor

NEVER_UNLOADED = "nothing was ever unloaded, so that what it leaves behind cannot show"
LEAVES_BEHIND = ("hysteresis", "softening", "adhesion", "wear")
"""Known by what is different after the load was taken back. A formula of theirs also bends the way up, and there it is no more
than a spring that is not straight."""


BY_TIME = ("creep", "lag", "drift")
"""Known by what happens at one depth at different times, or at one time after different speeds."""
ONE_SPEED = 1.5
"""Ratio of fast to slow loading below which all of it was done at one speed."""


NEVER_AT_REST = (
    "nothing was left without load for long, nor held at unlike loads, so that moving by itself and settling under load are one"
)
RESTS = 0.1
"""Share of a trial from the first to the last time that a texel carries nothing, from which on a drift would show there."""
SETTLES = ("creep", "drift")
"""Both make a reading move while nothing else does."""
LEVELS = 1.5
"""Largest by smallest of the loads that were held, from which on settling, which goes with the load, is told from a drift."""


BY_PLACE = ("load-spreading", "crosstalk", "gain-mismatch", "misalignment")
"""Known by how neighbours differ as the load moves on: at one place each is some pattern of texels that grows with the load."""
BY_CYCLE = ("hysteresis", "softening", "wear")
"""Known by how a second cycle differs from the first: in one alone, each makes the way back lie below the way in."""
PASSED_ON = ("load-spreading", "crosstalk")
"""Both pass a part of what a texel carries on to those around it. A sensor does so in its own pattern, and which formula comes
nearer to that says little about which it is."""
BENDS = ("stiffening", "saturation", "dead-zone")
"""A curve that is not straight: so is the way in of whatever has a loop."""
LOOP = 3.0
"""Ratio of a curve's steepest to its flattest eighth up to which it may be the way in of a loop that takes two thirds of the
force."""
SHORT = 0.5
"""Seconds of a hold below which it tells nothing of settling."""


def untold(coverage: Coverage) -> dict[str, str]:
    """Return the kinds of effects that recordings cannot tell, each with the reason."""
    said = {} if coverage.unloading else dict.fromkeys(LEAVES_BEHIND, NEVER_UNLOADED)
    if coverage.rest < RESTS and coverage.levels < LEVELS:
        said["drift"] = NEVER_AT_REST
    return said


def confounded(coverage: Coverage) -> tuple[str, ...]:
    """Return the kinds that recordings cannot tell from a spring that is not straight.

    Where a load only ever grew, at one speed and without a hold, time and depth are one. What is counted in time may be the
    reason for a bend, and is weighed as a rival; the bend alone is the simpler explanation, and nothing in time joins it.
    """
    one = not coverage.unloading and coverage.rates < ONE_SPEED and coverage.longest_hold == 0.0
    return BY_TIME if one else ()


def alike(coverage: Coverage, name: str, bend: float = np.inf) -> tuple[str, ...]:
    """Return the kinds that recordings cannot tell from one of this name, however much better one of them fits.

    The sensor need follow none of the formulas: a better fit is no evidence where the mark of the effect was not brought out.

    Parameters
    ----------
    coverage : Coverage
    name : str
    bend : float
        How many times as steep as its flattest eighth the steepest of the fitted curve is (see :func:`bend_of`).
    """
    groups: list[tuple[str, ...]] = []
    if not coverage.unloading and name in BENDS and bend < LOOP:
        groups.append((name, "hysteresis"))
    if not coverage.roams:
        groups.append(BY_PLACE)
    if coverage.unloading and coverage.cycles < 2:
        still = coverage.rates < ONE_SPEED and coverage.longest_hold < SHORT
        groups.append((*BY_CYCLE, "creep", "lag") if still else BY_CYCLE)
    return tuple(dict.fromkeys(other for group in groups if name in group for other in group if other != name))


def nearly_alike(coverage: Coverage, name: str) -> tuple[str, ...]:
    """Return the kinds that must fit far worse than one of this name to be told from it.

    Load spreading and crosstalk both pass something on to the neighbours. Without rest, settling and moving by itself differ
    only in how they go with the load.
    """
    groups = [PASSED_ON, *([SETTLES] if coverage.rest < RESTS else [])]
    return tuple(other for group in groups if name in group for other in group if other != name)


def bend_of(predictors: Sequence[Predictor], model: Model) -> float:
    """Return how many times as steep as its flattest eighth the steepest of a model's curve is, of the texel pressed most."""
    deepest = max(predictors, key=lambda one: float(one.stimulus.pressed_by.max(initial=0.0)))
    texel = int(np.argmax(deepest.stimulus.pressed_by.max(axis=0)))
    load, reading = deepest.stimulus.pressed_by[:, texel], deepest.predict(model).reading[:, texel]
    order = np.argsort(load)
    slopes = np.diff(np.interp(np.linspace(0.0, load.max(), 9), load[order], reading[order]))
    steep = np.abs(slopes)
    return float(steep.max() / max(float(steep.min()), 1e-9 * float(steep.max()), 1e-300))
