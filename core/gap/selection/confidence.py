# SPDX-License-Identifier: GPL-3.0-or-later
"""What makes a name no sure one, although the effect is in the model: it may be what the formulas of others lack, or lie within
what these recordings do not tell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects.engine.registry import form_of
from ...model.effect import Effect
from ..fitting.least_squares import Fit
from .candidates import DIRECTLY_ESTIMATED, is_spatial
from .direct_estimates import coarsest_step
from .findings import Diagnosis
from .forward_selection import FORCES, READINGS, NoiseFloor, SelectionState, friction_kinds
from .identifiability import (
    LEAST_UNLOADED_SHARE,
    MOVING_BY_THEMSELVES,
    NONLINEAR,
    SPREADING,
    curvature_ratio,
    indistinguishable,
)
from .view_set import ViewSet

EXPLAINED = 0.5
"""Share of the gap that must be closed for the verdict "explained", and for a sure name."""
PARTLY_EXPLAINED, DISTINCT_RATIO = 0.35, 1.5
"""Share from which on an effect is a sure name although much is left, where all others leave so many times as much."""
REPEATED_RATIO = 1.75
"""So many times as bad more freedom for the formulas that are there must be, for a further effect to be more than that."""
SMALL_SHARE, NEARLY_ALL = 0.1, 0.65
"""One of several that closes a smaller share of the whole gap may be what the others' formulas lack: it is no sure name, unless
it closes so much of what they leave, as what a formula lacks seldom looks like another effect."""
UNSURE_CONFIDENCE = 0.45
"""Highest confidence of a name that is not meant as sure."""
SAME_PATTERN = 0.8
"""Correlation over the texels from which on two effects with a number for each are one: an offset that fades under load takes
off everywhere what it has put on."""


def least_share(name: str, leaves: dict[str, float]) -> float:
    """Least share of the gap to be closed for a sure name, by how many times as much the other kinds leave.

    Steps are seen in the readings themselves. Friction has but one other kind, and to be ahead of that says little.
    """
    if name == "quantization":
        return 0.0
    apart = min(leaves.values(), default=np.inf) > DISTINCT_RATIO and name not in friction_kinds()
    return PARTLY_EXPLAINED if apart else EXPLAINED


def is_doubtful(effect: Effect, state: SelectionState, fitted: Sequence[Effect], floor: NoiseFloor) -> bool:
    """Whether one of several effects may only be what the formula of another lacks."""
    improvement, step = state.improvements.get(effect.name), state.steps.get(effect.name)
    if _describes_dead_texels(effect, fitted) or _larger_effect_of_same_kind(effect, state, fitted, floor):
        return True
    if step is not None and step.times_worse(step.remaining_repeated, effect.name) < REPEATED_RATIO:
        return True
    if improvement is None or improvement.of_gap >= SMALL_SHARE:
        return False
    if improvement.of_remaining < NEARLY_ALL:
        return True
    own = [np.asarray(value) for value in effect.values.values() if isinstance(value, tuple)]
    if own and any(is_spatial(form_of(other.name, other.form)) for other in fitted if other is not effect):
        return True  # at the rim a texel has fewer neighbours: a formula that is off there looks like numbers per texel
    others = [np.asarray(v) for other in fitted if other is not effect for v in other.values.values() if isinstance(v, tuple)]
    pairs = [np.corrcoef(a, b)[0, 1] for a in own for b in others if np.ptp(a) > 0 and np.ptp(b) > 0]
    return any(abs(r) > SAME_PATTERN for r in pairs)


def may_absorb_misfit(effect: Effect, state: SelectionState) -> bool:
    """Whether something larger was found beside an effect with a number for each texel.

    Where much is left that nothing explains, such numbers bend to that.
    """
    mine = state.improvements[effect.name].of_gap if effect.name in state.improvements else 0.0
    larger = any(improvement.of_gap > mine for name, improvement in state.improvements.items() if name != effect.name)
    return (
        larger and effect.name not in DIRECTLY_ESTIMATED and any(isinstance(value, tuple) for value in effect.values.values())
    )


def _larger_effect_of_same_kind(effect: Effect, state: SelectionState, fitted: Sequence[Effect], floor: NoiseFloor) -> bool:
    """Whether one that does the same closes more already, so that this may be what its formula lacks.

    Load spreading and crosstalk both pass something on to the neighbours. A law of contact and a readout that bend, in turn,
    bend the reading like one; the law alone bends the net force.
    """

    def share(name: str) -> float:
        return state.improvements[name].of_gap if name in state.improvements else 0.0

    same = SPREADING if effect.name in SPREADING else () if floor.both or effect.name not in NONLINEAR else NONLINEAR
    return any(share(other.name) > share(effect.name) for other in fitted if other.name in same and other.name != effect.name)


def _describes_dead_texels(effect: Effect, fitted: Sequence[Effect]) -> bool:
    """Whether what an effect says of each texel is mostly said of dead ones: a little that they still answer."""
    for other in fitted:
        dead = np.asarray(other.values.get("dead", 0.0))
        for value in effect.values.values():
            if other is not effect and isinstance(value, tuple) and dead.shape:
                moved = (np.asarray(value) - np.median(value)) ** 2
                if float(moved[dead > 0.5].sum()) > 0.5 * float(moved.sum()):
                    return True
    return False


def unsure_names(result: Diagnosis, view_set: ViewSet, state: SelectionState, floor: NoiseFloor) -> set[str]:
    """Names that are not sure for what else there is, or is not, in the model.

    What is named beside what is unclear may be a part of that: all of it where the recordings cannot tell, since any curve
    that they bring out could be either's; else what is small. What closes less than a step of the readings may lie within it.
    Friction goes with the load: where the normal force is off by more than what a law of friction closes, that may be why.
    Without rest, what moves by itself may be a part of what settles, where that is unclear.
    """
    small = {name for name, improvement in state.improvements.items() if improvement.of_gap < SMALL_SHARE}
    unsure = small if result.ambiguous else set()
    names = {one.name for one in result.findings}
    curvature = curvature_ratio(result.of("fit"), result.best.model)
    if any(indistinguishable(result.coverage, name, curvature) for name in names):
        unsure |= names - set(DIRECTLY_ESTIMATED)
    if result.coverage.unloaded_share < LEAST_UNLOADED_SHARE and {name for pair in result.ambiguous for name in pair} & set(
        MOVING_BY_THEMSELVES
    ):
        unsure |= set(MOVING_BY_THEMSELVES)
    step = coarsest_step(view_set.whole, result.base.model)
    size = {name: abs(improvement.of_gap) * floor.gap(floor.main_quantity) for name, improvement in state.improvements.items()}
    if "quantization" not in names and floor.main_quantity == READINGS:
        unsure |= {name for name, square in size.items() if square < (step / result.noise[READINGS].deviation) ** 2}
    for name in names & set(friction_kinds()) if floor.both else ():
        closed = state.improvements[name].of_gap * floor.gap(FORCES) * floor.count[FORCES]
        if closed < _normal_squares(view_set, state.fit, float(floor.noise[FORCES])):
            unsure.add(name)
    return unsure


def _normal_squares(view_set: ViewSet, found: Fit, floor: float) -> float:
    """Squares of the residual of the net normal force, beyond those of noise (`floor` of each value)."""
    normal = view_set.whole[0].predictor.rig.texels.normal.mean(axis=0)
    residual = np.concatenate([share.residual(found.model)[:, -3:] @ normal for share in view_set.whole])
    return max(float(residual @ residual) - floor * len(residual), 0.0)
