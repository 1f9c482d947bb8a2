# SPDX-License-Identifier: GPL-3.0-or-later
"""What makes a name no sure one, although the effect is in the model: it may be what the formulas of others lack, or lie within
what these recordings do not tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...effects.engine.registry import form_of
from ...model.effect import Effect
from ..fitting.least_squares import Fit
from .candidates import READ_OFF, is_spatial
from .direct_estimates import coarsest
from .forward_selection import FORCES, READINGS, Account, Ground, friction_kinds
from .identifiability import BENDS, PASSED_ON, RESTS, SETTLES, alike, bend_of
from .screening import Views

if TYPE_CHECKING:
    from .diagnosis import Diagnosis

EXPLAINED = 0.5
"""Share of the gap that must be closed for the verdict "explained", and for a sure name."""
PART, APART = 0.35, 1.5
"""Share from which on an effect is a sure name although much is left, where all others leave so many times as much."""
AGAIN = 1.75
"""So many times as bad more freedom for the formulas that are there must be, for a further effect to be more than that."""
SMALL, NEARLY_ALL = 0.1, 0.65
"""One of several that closes a smaller share of the whole gap may be what the others' formulas lack: it is no sure name, unless
it closes so much of what they leave, as what a formula lacks seldom looks like another effect."""
UNSURE = 0.45
"""Highest confidence of a name that is not meant as sure."""
TOGETHER = 0.8
"""Correlation over the texels from which on two effects with a number for each are one: an offset that fades under load takes
off everywhere what it has put on."""


def least_share(name: str, leaves: dict[str, float]) -> float:
    """Least share of the gap to be closed for a sure name, by how many times as much the other kinds leave.

    Steps are seen in the readings themselves. Friction has but one other kind, and to be ahead of that says little.
    """
    if name == "quantization":
        return 0.0
    apart = min(leaves.values(), default=np.inf) > APART and name not in friction_kinds()
    return PART if apart else EXPLAINED


def is_doubtful(effect: Effect, account: Account, fitted: Sequence[Effect], ground: Ground) -> bool:
    """Whether one of several effects may only be what the formula of another lacks."""
    gain, step = account.gains.get(effect.name), account.steps.get(effect.name)
    if _is_of_the_dead(effect, fitted) or _another_does_more(effect, account, fitted, ground):
        return True
    if step is not None and step.worse(step.again, effect.name) < AGAIN:
        return True
    if gain is None or gain.of_all >= SMALL:
        return False
    if gain.of_left < NEARLY_ALL:
        return True
    own = [np.asarray(value) for value in effect.values.values() if isinstance(value, tuple)]
    if own and any(is_spatial(form_of(other.name, other.form)) for other in fitted if other is not effect):
        return True  # at the rim a texel has fewer neighbours: a formula that is off there looks like numbers per texel
    others = [np.asarray(v) for other in fitted if other is not effect for v in other.values.values() if isinstance(v, tuple)]
    pairs = [np.corrcoef(a, b)[0, 1] for a in own for b in others if np.ptp(a) > 0 and np.ptp(b) > 0]
    return any(abs(r) > TOGETHER for r in pairs)


def may_be_bent(effect: Effect, account: Account) -> bool:
    """Whether something larger was found beside an effect with a number for each texel.

    Where much is left that nothing explains, such numbers bend to that.
    """
    mine = account.gains[effect.name].of_all if effect.name in account.gains else 0.0
    larger = any(gain.of_all > mine for name, gain in account.gains.items() if name != effect.name)
    return larger and effect.name not in READ_OFF and any(isinstance(value, tuple) for value in effect.values.values())


def _another_does_more(effect: Effect, account: Account, fitted: Sequence[Effect], ground: Ground) -> bool:
    """Whether one that does the same closes more already, so that this may be what its formula lacks.

    Load spreading and crosstalk both pass something on to the neighbours. A law of contact and a readout that bend, in turn,
    bend the reading like one; the law alone bends the net force.
    """

    def share(name: str) -> float:
        return account.gains[name].of_all if name in account.gains else 0.0

    same = PASSED_ON if effect.name in PASSED_ON else () if ground.both or effect.name not in BENDS else BENDS
    return any(share(other.name) > share(effect.name) for other in fitted if other.name in same and other.name != effect.name)


def _is_of_the_dead(effect: Effect, fitted: Sequence[Effect]) -> bool:
    """Whether what an effect says of each texel is mostly said of dead ones: a little that they still answer."""
    for other in fitted:
        dead = np.asarray(other.values.get("dead", 0.0))
        for value in effect.values.values():
            if other is not effect and isinstance(value, tuple) and dead.shape:
                moved = (np.asarray(value) - np.median(value)) ** 2
                if float(moved[dead > 0.5].sum()) > 0.5 * float(moved.sum()):
                    return True
    return False


def doubted(result: Diagnosis, views: Views, account: Account, ground: Ground) -> set[str]:
    """Names that are not sure for what else there is, or is not, in the model.

    What is named beside what is unclear may be a part of that: all of it where the recordings cannot tell, since any curve
    that they bring out could be either's; else what is small. What closes less than a step of the readings may lie within it.
    Friction goes with the load: where the normal force is off by more than what a law of friction closes, that may be why.
    Without rest, what moves by itself may be a part of what settles, where that is unclear.
    """
    small = {name for name, gain in account.gains.items() if gain.of_all < SMALL}
    unsure = small if result.ambiguous else set()
    names = {one.name for one in result.named}
    bend = bend_of(result.of("fit"), result.best.model)
    if any(alike(result.coverage, name, bend) for name in names):
        unsure |= names - set(READ_OFF)
    if result.coverage.rest < RESTS and {name for pair in result.ambiguous for name in pair} & set(SETTLES):
        unsure |= set(SETTLES)
    step = coarsest(views.whole, result.base.model)
    size = {name: abs(gain.of_all) * ground.gap(ground.main) for name, gain in account.gains.items()}
    if "quantization" not in names and ground.main == READINGS:
        unsure |= {name for name, square in size.items() if square < (step / result.noise[READINGS].deviation) ** 2}
    for name in names & set(friction_kinds()) if ground.both else ():
        closed = account.gains[name].of_all * ground.gap(FORCES) * ground.count[FORCES]
        if closed < _normal_squares(views, account.fit, float(ground.floor[FORCES])):
            unsure.add(name)
    return unsure


def _normal_squares(views: Views, found: Fit, floor: float) -> float:
    """Squares of the residual of the net normal force, beyond those of noise (`floor` of each value)."""
    normal = views.whole[0].predictor.rig.texels.normal.mean(axis=0)
    residual = np.concatenate([share.residual(found.model)[:, -3:] @ normal for share in views.whole])
    return max(float(residual @ residual) - floor * len(residual), 0.0)
