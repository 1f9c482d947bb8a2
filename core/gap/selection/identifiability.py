# SPDX-License-Identifier: GPL-3.0-or-later
"""What a recording cannot tell, whatever is fitted to it: effects whose mark was never brought out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..fitting.noise_floor import Coverage
from ..forward.predictor import Model, Predictor

NEVER_UNLOADED = "nothing was ever unloaded, so that what it leaves behind cannot show"
KNOWN_FROM_UNLOADING = ("hysteresis", "softening", "adhesion", "wear")
"""Known by what is different after the load was taken back. A formula of theirs also bends the way up, and there it is no more
than a spring that is not straight."""


KNOWN_FROM_TIMING = ("creep", "lag", "drift")
"""Known by what happens at one depth at different times, or at one time after different speeds."""
SINGLE_SPEED_RATIO = 1.5
"""Ratio of fast to slow loading below which all of it was done at one speed."""


NEVER_AT_REST = (
    "nothing was left without load for long, nor held at unlike loads, so that moving by itself and settling under load are one"
)
LEAST_UNLOADED_SHARE = 0.1
"""Share of a trial from the first to the last time that a texel carries nothing, from which on a drift would show there."""
MOVING_BY_THEMSELVES = ("creep", "drift")
"""Both make a reading move while nothing else does."""
DISTINCT_LOAD_RATIO = 1.5
"""Largest by smallest of the loads that were held, from which on settling, which goes with the load, is told from a drift."""


KNOWN_FROM_PLACES = ("load-spreading", "crosstalk", "gain-mismatch", "misalignment")
"""Known by how neighbours differ as the load moves on: at one place each is some pattern of texels that grows with the load."""
KNOWN_FROM_CYCLES = ("hysteresis", "softening", "wear")
"""Known by how a second cycle differs from the first: in one alone, each makes the way back lie below the way in."""
SPREADING = ("load-spreading", "crosstalk")
"""Both pass a part of what a texel carries on to those around it. A sensor does so in its own pattern, and which formula comes
nearer to that says little about which it is."""
NONLINEAR = ("stiffening", "saturation", "dead-zone")
"""A curve that is not straight: so is the way in of whatever has a loop."""
LOOP_CURVATURE = 3.0
"""Ratio of a curve's steepest to its flattest eighth up to which it may be the way in of a loop that takes two thirds of the
force."""
SHORT_HOLD = 0.5
"""Seconds of a hold below which it tells nothing of settling."""


def unidentifiable(coverage: Coverage) -> dict[str, str]:
    """Return the kinds of effects that recordings cannot tell, each with the reason."""
    said = {} if coverage.unloading else dict.fromkeys(KNOWN_FROM_UNLOADING, NEVER_UNLOADED)
    if coverage.unloaded_share < LEAST_UNLOADED_SHARE and coverage.held_load_ratio < DISTINCT_LOAD_RATIO:
        said["drift"] = NEVER_AT_REST
    return said


def confounded(coverage: Coverage) -> tuple[str, ...]:
    """Return the kinds that recordings cannot tell from a spring that is not straight.

    Where a load only ever grew, at one speed and without a hold, time and depth are one. What is counted in time may be the
    reason for a bend, and is weighed as a rival; the bend alone is the simpler explanation, and nothing in time joins it.
    """
    one = not coverage.unloading and coverage.speed_ratio < SINGLE_SPEED_RATIO and coverage.longest_hold == 0.0
    return KNOWN_FROM_TIMING if one else ()


def indistinguishable(coverage: Coverage, name: str, curvature: float = np.inf) -> tuple[str, ...]:
    """Return the kinds that recordings cannot tell from one of this name, however much better one of them fits.

    The sensor need follow none of the formulas: a better fit is no evidence where the mark of the effect was not brought out.

    Parameters
    ----------
    coverage : Coverage
    name : str
    bend : float
        How many times as steep as its flattest eighth the steepest of the fitted curve is (see :func:`curvature_ratio`).
    """
    groups: list[tuple[str, ...]] = []
    if not coverage.unloading and name in NONLINEAR and curvature < LOOP_CURVATURE:
        groups.append((name, "hysteresis"))
    if not coverage.load_moves:
        groups.append(KNOWN_FROM_PLACES)
    if coverage.unloading and coverage.cycles < 2:
        still = coverage.speed_ratio < SINGLE_SPEED_RATIO and coverage.longest_hold < SHORT_HOLD
        groups.append((*KNOWN_FROM_CYCLES, "creep", "lag") if still else KNOWN_FROM_CYCLES)
    return tuple(dict.fromkeys(other for group in groups if name in group for other in group if other != name))


def hardly_distinguishable(coverage: Coverage, name: str) -> tuple[str, ...]:
    """Return the kinds that must fit far worse than one of this name to be told from it.

    Load spreading and crosstalk both pass something on to the neighbours. Without rest, settling and moving by itself differ
    only in how they go with the load.
    """
    groups = [SPREADING, *([MOVING_BY_THEMSELVES] if coverage.unloaded_share < LEAST_UNLOADED_SHARE else [])]
    return tuple(other for group in groups if name in group for other in group if other != name)


def curvature_ratio(predictors: Sequence[Predictor], model: Model) -> float:
    """Return how many times as steep as its flattest eighth the steepest of a model's curve is, of the texel pressed most."""
    deepest = max(predictors, key=lambda one: float(one.stimulus.load.max(initial=0.0)))
    texel = int(np.argmax(deepest.stimulus.load.max(axis=0)))
    load, reading = deepest.stimulus.load[:, texel], deepest.predict(model).reading[:, texel]
    order = np.argsort(load)
    slopes = np.diff(np.interp(np.linspace(0.0, load.max(), 9), load[order], reading[order]))
    steep = np.abs(slopes)
    return float(steep.max() / max(float(steep.min()), 1e-9 * float(steep.max()), 1e-300))
