# SPDX-License-Identifier: GPL-3.0-or-later
"""The verdict on a rig: a confidence and rivals for each effect in the model, and a reason for each kind that is not in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...effects.engine.registry import library
from ...model.effect import Effect
from .candidates import NOT_FITTED, candidates
from .confidence import EXPLAINED, UNSURE_CONFIDENCE, is_doubtful, least_share, may_absorb_misfit, unsure_names
from .findings import Diagnosis, Finding
from .forward_selection import (
    FORCES,
    LEAST_IMPROVEMENT,
    LEAST_STRUCTURE,
    READINGS,
    GapSizes,
    SelectionState,
    SelectionStep,
    means_of,
)
from .identifiability import SPREADING, curvature_ratio, hardly_distinguishable, indistinguishable, unidentifiable
from .view_set import ViewSet

RIVAL_RATIO = 1.35
"""Another kind is a rival of an effect if it leaves at most this many times as much of the gap, and closes nearly as much.
Set on the cases of benchmarks/_hidden with one hidden effect."""
HARDLY_DISTINGUISHABLE_RATIO = 3.0
"""The same for kinds that are hard to distinguish from it (see :func:`.identifiability.hardly_distinguishable`)."""
RIVAL_EXPONENT = -4.0
"""Weight of an effect among n others that are r₁ … rₙ times as bad: 1 / (1 + Σ rᵢ⁻⁴), as of likelihoods that fall fast."""
UNRESOLVED_TIMES = 2.0
"""A spreading effect that leaves less than this many times what no fit can resolve has the sensor's own formula."""
MOST_MEAN_SQUARE = 2.0
"""Mean square of the base model's residual, in units of the noise, up to which a residual without structure is no gap."""


def conclude(result: Diagnosis, view_set: ViewSet, state: SelectionState, gap_sizes: GapSizes) -> None:
    """Write verdict, findings, groups of rivals and ruled-out kinds into a result that has its models already."""
    _judge_effects(result, state, gap_sizes)
    unsure = unsure_names(result, view_set, state, gap_sizes)
    result.findings = [
        replace(one, confidence=min(one.confidence, UNSURE_CONFIDENCE)) if one.name in unsure else one
        for one in result.findings
    ]
    _rule_out(result, state.first, gap_sizes)


def _judge_effects(result: Diagnosis, state: SelectionState, gap_sizes: GapSizes) -> None:
    """Write the verdict and, for each effect of the model, a finding with its confidence and rivals."""
    effects = result.best.model.effects
    fitted = [effect for effect in effects if effect.name != "noise"]
    closed = [gap_sizes.closed_share(state.means, quantity) for quantity in (READINGS, FORCES)]
    is_open = any(gap_sizes.has_gap(quantity) and closed[quantity] < EXPLAINED for quantity in (READINGS, FORCES))
    result.verdict = _verdict(result, gap_sizes, is_open)
    for index, effect in enumerate(effects):
        times_worse, leaves = _alternatives(effect, state, {e.name for e in effects})
        rivals = _rivals(effect, state, result, times_worse, gap_sizes)
        weight = 1.0 / (1.0 + sum(ratio**RIVAL_EXPONENT for ratio in times_worse.values()))
        share = closed[gap_sizes.quantity_for(effect.name)] if fitted else 1.0
        confidence = weight * (0.5 + 0.5 * share if share >= least_share(effect.name, leaves) else 0.5 * share)
        absorbs = is_open and may_absorb_misfit(effect, state)
        if rivals or (len(fitted) > 1 and (absorbs or is_doubtful(effect, state, fitted, gap_sizes))):
            confidence = min(confidence, UNSURE_CONFIDENCE)
        if rivals:
            result.ambiguous.append((effect.name, *rivals))
        nearest = min(times_worse, key=lambda name: times_worse[name], default="")
        result.findings.append(
            Finding(index, effect.name, effect.form, round(confidence, 3), rivals, nearest, leaves.get(nearest, np.inf))
        )


def _verdict(result: Diagnosis, gap_sizes: GapSizes, is_open: bool) -> str:
    """Verdict on the whole rig; `is_open` if the amended model leaves much of the gap."""
    effects = result.best.model.effects
    if all(effect.name == "noise" for effect in effects) and effects:
        return "explained"
    if effects:
        return "unexplained" if is_open else "explained"
    mean, gap = float(gap_sizes.base[gap_sizes.main_quantity]), gap_sizes.gap(gap_sizes.main_quantity)
    small = mean < MOST_MEAN_SQUARE or gap < LEAST_IMPROVEMENT
    quiet = result.base_structure.total < LEAST_STRUCTURE and small and result.line is None
    return "no gap" if quiet and not (gap_sizes.both and gap_sizes.has_gap(FORCES)) else "unexplained"


def _alternatives(effect: Effect, state: SelectionState, taken: set[str]) -> tuple[dict[str, float], dict[str, float]]:
    """How many times as bad each other kind is in the place of an effect, and how many times as much it leaves, by name."""
    step = state.steps.get(effect.name, SelectionStep([], []))
    own = step.of(effect.name)
    times_worse: dict[str, float] = {}
    leaves: dict[str, float] = {}
    for one, left in zip(step.ranked, step.remaining, strict=True):
        name = one.candidate.name
        if name not in taken and not (effect.name == "dead-texels" and one.candidate.has_texel_parameters):
            times_worse[name] = min(step.times_worse(left, effect.name), times_worse.get(name, np.inf))
            leaves[name] = min(left / own, leaves.get(name, np.inf))
    return times_worse, leaves


def _rivals(
    effect: Effect, state: SelectionState, result: Diagnosis, times_worse: dict[str, float], gap_sizes: GapSizes
) -> tuple[str, ...]:
    """Kinds that would do as well as an effect, and kinds that these recordings cannot distinguish from it."""
    taken = {e.name for e in state.fit.model.effects}
    own = state.steps.get(effect.name, SelectionStep([], [])).of(effect.name)
    unresolved = gap_sizes.unresolved(gap_sizes.quantity_for(effect.name))
    is_exact = effect.name in SPREADING and own < UNRESOLVED_TIMES * unresolved
    similar = () if is_exact else hardly_distinguishable(result.coverage, effect.name)
    near = [
        name
        for name, ratio in times_worse.items()
        if ratio < (HARDLY_DISTINGUISHABLE_RATIO if name in similar else RIVAL_RATIO)
    ]
    curvature = curvature_ratio(result.of("fit"), result.best.model)
    same = [name for name in indistinguishable(result.coverage, effect.name, curvature) if name not in taken]
    return tuple(dict.fromkeys([*near, *same]))


def _rule_out(result: Diagnosis, alone: SelectionStep, gap_sizes: GapSizes) -> None:
    """Write for each kind that was not found why; `alone` has those that were fitted on top of the base model."""
    tried: dict[str, float] = {}
    for one in alone.ranked:
        name = one.candidate.name
        closed = gap_sizes.closed_share(means_of(one.held_out, one.fit), gap_sizes.quantity_for(name))
        tried[name] = max(tried.get(name, 0.0), closed)
    named = {name for group in result.ambiguous for name in group} | {one.name for one in result.findings}
    possible = {c.name for c in candidates(result.of("fit"), result.base.model)}
    for kind in library().values():
        if kind.name in named:
            continue
        if kind.name in NOT_FITTED:
            why = "what is left does not tremble the more, the larger the reading"
        elif kind.name not in possible:
            why = unidentifiable(result.coverage).get(kind.name, "these recordings cannot show it")
        elif kind.name in tried and result.verdict != "no gap":
            why = f"alone it closes {tried[kind.name]:.0%} of the squared gap on unseen trials"
        elif result.verdict == "no gap":
            why = "nothing is left for it to explain"
        else:
            why = "a first look promised far less than what was fitted"
        result.ruled_out.append((kind.name, why))
