# SPDX-License-Identifier: GPL-3.0-or-later
"""Identifiability: which effects cannot be found in some recordings, or not be distinguished from another one, whatever is
fitted.

Each effect shows in one feature of the recordings, its signature: hysteresis, for example, in readings that differ after
unloading. Recordings without this feature do not identify the effect, however well its formula fits.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects.engine.registry import names_in_family, names_known_from
from ..forward.predictor import Model, Predictor
from .noise_floor import Coverage

NEVER_UNLOADED = "the sensor was never unloaded, and this effect shows after unloading"
KNOWN_FROM_UNLOADING, KNOWN_FROM_TIMING = names_known_from("unloading"), names_known_from("timing")
KNOWN_FROM_REST, KNOWN_FROM_PLACES = names_known_from("rest"), names_known_from("places")
KNOWN_FROM_CYCLES = names_known_from("cycles")
"""Effects that are known from a feature of recordings (see :data:`...effects.engine.specification.FEATURES`)."""
NONLINEAR, LATE, LOOPS = names_in_family("nonlinear"), names_in_family("late"), names_in_family("loop")
"""Effects that resemble each other (see :data:`...effects.engine.specification.FAMILIES`)."""
SINGLE_SPEED_RATIO = 1.5
"""Ratio of fast to slow loading below which all loading was at one speed."""
NEVER_AT_REST = "no texel rested for long, and no two loads were held: drift and creep are indistinguishable"
LEAST_UNLOADED_SHARE = 0.1
"""Share of a trial, from the first to the last time that a texel is unloaded, from which on a drift would show there."""
DISTINCT_LOAD_RATIO = 1.5
"""Ratio of the largest to the smallest load that was held, from which on creep, which is proportional to the load, differs from
drift."""
LEAST_CYCLES = 2
"""Number of loading cycles in one trial from which on a later cycle can be compared with the first."""
LOOP_CURVATURE = 3.0
"""Ratio of a curve's steepest to its flattest eighth up to which it may be the loading curve of a hysteresis loop that takes
two thirds of the force."""
SHORT_HOLD = 0.5
"""Creep does not show in holds that are shorter than this, s."""
CURVE_PARTS = 8
"""Number of equal parts of the load over which the slopes of a curve are compared."""


def unidentifiable(coverage: Coverage) -> dict[str, str]:
    """Return the kinds of effects that recordings cannot identify, each with the reason."""
    said = {} if coverage.unloading else dict.fromkeys(KNOWN_FROM_UNLOADING, NEVER_UNLOADED)
    if coverage.unloaded_share < LEAST_UNLOADED_SHARE and coverage.held_load_ratio < DISTINCT_LOAD_RATIO:
        said |= dict.fromkeys(KNOWN_FROM_REST, NEVER_AT_REST)
    return said


def indistinguishable(coverage: Coverage, name: str, curvature: float = np.inf) -> tuple[str, ...]:
    """Return the kinds that recordings cannot distinguish from one of this name, however much better one of them fits.

    A sensor need not follow any of the formulas, so a better fit is no evidence if the signature of the effect is not recorded.

    Parameters
    ----------
    coverage : Coverage
    name : str
    curvature : float
        Of the fitted curve (see :func:`curvature_ratio`).
    """
    groups: list[tuple[str, ...]] = []
    one_speed = coverage.speed_ratio < SINGLE_SPEED_RATIO
    if not coverage.unloading and name in NONLINEAR and curvature < LOOP_CURVATURE:
        groups.append((name, *LOOPS))
    if not coverage.unloading and one_speed and coverage.longest_hold == 0.0:  # time and depth are proportional
        groups.append((*((name,) if name in NONLINEAR else NONLINEAR), *KNOWN_FROM_TIMING))
    if not coverage.load_moves:
        groups.append(KNOWN_FROM_PLACES)
    if coverage.unloading and coverage.cycles < LEAST_CYCLES:
        still = one_speed and coverage.longest_hold < SHORT_HOLD
        groups.append((*KNOWN_FROM_CYCLES, *LATE) if still else KNOWN_FROM_CYCLES)
    return tuple(dict.fromkeys(other for group in groups if name in group for other in group if other != name))


def curvature_ratio(predictors: Sequence[Predictor], model: Model) -> float:
    """Return the ratio of the steepest to the flattest eighth of a model's curve of reading over load.

    Parameters
    ----------
    predictors : sequence of Predictor
        The curve is that of the texel with the largest load in these trials.
    model : Model
    """
    deepest = max(predictors, key=lambda one: float(one.stimulus.load.max(initial=0.0)))
    texel = int(np.argmax(deepest.stimulus.load.max(axis=0)))
    load, reading = deepest.stimulus.load[:, texel], deepest.predict(model).reading[:, texel]
    order = np.argsort(load)
    curve = np.interp(np.linspace(0.0, load.max(), CURVE_PARTS + 1), load[order], reading[order])
    steep = np.abs(np.diff(curve))
    return float(steep.max() / max(float(steep.min()), 1e-9 * float(steep.max()), 1e-300))
