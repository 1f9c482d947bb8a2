# SPDX-License-Identifier: GPL-3.0-or-later
"""The verdict on a rig: a confidence and rivals for each effect in the model, and a reason for each kind that is not in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...effects.engine.registry import kind_of, library
from ...effects.engine.specification import SILENT_TEXELS
from ...model.sensor import Effect
from ..fitting.noise_floor import MEASURED_REPEATS, is_scatter_of_repeats
from ..fitting.residual_tests import LEAST_STRUCTURE, ResidualStructure
from .candidates import NOT_FITTED, candidates
from .check_recordings import CheckedRecording
from .confidence import (
    CLEAR_LEAD,
    EXPLAINED,
    SURE,
    UNLIKELY_CONFIDENCE,
    UNSURE_CONFIDENCE,
    least_share,
    misfit_of_another,
    probability,
    unsettled_parameters,
    unsure_names,
)
from .findings import ClosedShares, Diagnosis, Finding
from .forward_selection import SelectionState, SelectionStep, means_of
from .gap_sizes import FORCES, LEAST_IMPROVEMENT, READINGS, GapSizes, friction_kinds, quantities_changed_by
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
FAULTY = "the data have faults that were not put right"
REFUTED = "the amended model fails on the check recordings"
"""Why a name is not sure, in words."""
MOST_MEAN_SQUARE = 2.0
"""Mean square of the base model's residual, in units of the noise, up to which a residual without structure is no gap. In a
check recording it may also be as many times that of the fitted ones."""


def conclude(result: Diagnosis, view_set: ViewSet, state: SelectionState, gap_sizes: GapSizes) -> None:
    """Write verdict, findings, groups of rivals and ruled-out kinds into a result that has its models already."""
    result.closed = _closed_shares(result, state, gap_sizes)
    result.unlike_fitted = _unlike_fitted(result, gap_sizes)
    _judge_effects(result, state, gap_sizes)
    unsure = unsure_names(result, view_set, state, gap_sizes)
    if result.misleading_faults:
        unsure = {one.name: FAULTY for one in result.findings} | unsure
    result.findings = [
        replace(one, confidence=min(one.confidence, UNSURE_CONFIDENCE), doubts=(*one.doubts, unsure[one.name]))
        if one.name in unsure
        else one
        for one in result.findings
    ]
    _doubt_without_rivals(result)
    _rule_out(result, state, gap_sizes)


def _doubt_without_rivals(result: Diagnosis) -> None:
    """Lower the confidence of names that are not sure and have no rival, unless faults of the data are why."""
    if not result.misleading_faults:
        groups = {name for group in result.ambiguous for name in group}
        doubted = {one.name for one in result.findings if one.confidence <= UNSURE_CONFIDENCE} - groups
        result.findings = [
            replace(one, confidence=min(one.confidence, UNLIKELY_CONFIDENCE)) if one.name in doubted else one
            for one in result.findings
        ]


def _closed_shares(result: Diagnosis, state: SelectionState, gap_sizes: GapSizes) -> ClosedShares:
    """How much of the gaps the amended model closes."""
    if not result.best.model.fitted_effects:
        return ClosedShares()
    before, after = (means_of(one.sse, one) for one in (result.base, result.best))
    fitted: list[float | None] = [None, None]
    left_out: list[float | None] = [None, None]
    for quantity in (READINGS, FORCES):
        if gap_sizes.has_gap(quantity):
            gap = max(float(before[quantity] - gap_sizes.noise[quantity]), 1e-12)
            fitted[quantity] = float(np.clip((before[quantity] - after[quantity]) / gap, 0.0, 1.0))
            left_out[quantity] = gap_sizes.closed_share(state.means, quantity)
    return ClosedShares((fitted[0], fitted[1]), (left_out[0], left_out[1]), result.check.closed)


def _judge_effects(result: Diagnosis, state: SelectionState, gap_sizes: GapSizes) -> None:
    """Write the verdict and, for each effect of the model, a finding with its confidence and rivals."""
    effects = result.best.model.effects
    fitted = result.best.model.fitted_effects
    left_out = [gap_sizes.closed_share(state.means, quantity) for quantity in (READINGS, FORCES)]
    closed = [_least_share_closed(result, left_out, quantity) for quantity in (READINGS, FORCES)]
    is_open = [
        gap_sizes.has_gap(quantity) and left_out[quantity] < EXPLAINED and not _is_out_of_reach(result, gap_sizes, quantity)
        for quantity in (READINGS, FORCES)
    ]
    result.verdict = _verdict(result, gap_sizes, any(is_open) or (bool(fitted) and result.check.is_refuted))
    for index, effect in enumerate(effects):
        times_worse, leaves = _alternatives(effect, state, {e.name for e in effects})
        rivals = _rivals(effect, state, result, times_worse, gap_sizes)
        weight = 1.0 / (1.0 + sum(ratio**RIVAL_EXPONENT for ratio in times_worse.values()))
        quantity = gap_sizes.quantity_for(effect.name)
        share = closed[quantity] if fitted else 1.0
        lead = min(leaves.values(), default=np.inf)
        unsettled = unsettled_parameters(effect, index, result, lead)
        support = weight * (0.5 + 0.5 * share if share >= least_share(effect.name) else 0.5 * share)
        doubts = _doubts(effect, result, state, gap_sizes)
        doubts += (REFUTED,) if fitted and any(map(result.check.refutes, quantities_changed_by(effect))) else ()
        lowered = rivals or doubts or (unsettled and lead < CLEAR_LEAD)
        confidence = min(support, UNSURE_CONFIDENCE) if lowered else probability(support)
        if confidence < SURE and not lowered:
            doubts = (_low_support(share, least_share(effect.name)),)
        if rivals:
            result.ambiguous.append((effect.name, *rivals))
        nearest = min(times_worse, key=lambda name: times_worse[name], default="")
        closes = state.improvements[effect.name].of_gap if effect.name in state.improvements else 0.0
        near = nearest, leaves.get(nearest, np.inf)
        result.findings.append(
            Finding(index, effect.name, effect.form, round(confidence, 3), rivals, *near, round(closes, 4), unsettled, doubts)
        )


def _doubts(effect: Effect, result: Diagnosis, state: SelectionState, gap_sizes: GapSizes) -> tuple[str, ...]:
    """Why an effect may only compensate for the formula of another one; empty if there is no reason."""
    fitted = result.best.model.fitted_effects
    if len(fitted) < 2:
        return ()
    why = misfit_of_another(effect, state, fitted, gap_sizes)
    return (why,) if why else ()


def _low_support(share: float, least: float) -> str:
    """Why the support of an effect is low, in words."""
    if share < least:
        return f"the amended model closes {max(share, 0.0):.0%} of the squared gap, and a confident name needs {least:.0%}"
    return "other effects together fit nearly as well"


def _least_share_closed(result: Diagnosis, left_out: list[float], quantity: int) -> float:
    """Smallest share of a gap that is closed: in left-out parts, in the fitted recordings, and in the check recordings."""
    least = result.closed.least(quantity)
    return left_out[quantity] if least is None else float(np.clip(least, 0.0, 1.0))


def _is_out_of_reach(result: Diagnosis, gap_sizes: GapSizes, quantity: int) -> bool:
    """True if effects on friction are all there is, and what readings leave would be no gap by itself.

    Friction cannot change readings, so the share of their gap that it closes does not count.
    """
    fitted = result.best.model.fitted_effects
    only_friction = bool(fitted) and all(effect.name in friction_kinds() for effect in fitted)
    return only_friction and quantity == READINGS and gap_sizes.both and _is_quiet(result, result.structure, gap_sizes)


def _is_quiet(result: Diagnosis, structure: ResidualStructure, gap_sizes: GapSizes) -> bool:
    """True if the base model's residual is small, or little more than noise, and has no structure."""
    mean, gap = float(gap_sizes.base[gap_sizes.main_quantity]), gap_sizes.gap(gap_sizes.main_quantity)
    small = (mean < MOST_MEAN_SQUARE or gap < LEAST_IMPROVEMENT) and not result.unlike_fitted
    return structure.total < LEAST_STRUCTURE and small and result.line is None


def _verdict(result: Diagnosis, gap_sizes: GapSizes, is_open: bool) -> str:
    """Verdict on the whole rig; `is_open` if the amended model leaves much of the gap."""
    effects = result.best.model.effects
    if effects and not result.best.model.fitted_effects:
        return "explained"
    if effects:
        return "unexplained" if is_open else "explained"
    if is_scatter_of_repeats(result.noise, result.base.sse, result.base.count) and not result.unlike_fitted:
        return "no gap"
    quiet = _is_quiet(result, result.base_structure, gap_sizes)
    return "no gap" if quiet and not (gap_sizes.both and gap_sizes.has_gap(FORCES)) else "unexplained"


def _unlike_fitted(result: Diagnosis, gap_sizes: GapSizes) -> list[CheckedRecording]:
    """Check recordings that the base model fits far worse than the fitted ones; repeats of these differ by their scatter."""
    quantity = gap_sizes.main_quantity
    most = MOST_MEAN_SQUARE * max(1.0, float(gap_sizes.base[quantity]))
    trials = [predictor.trial for predictor in result.predictors]
    groups = {trial.repeats for trial in trials if trial.use == "fit" and result.noise[quantity].source == MEASURED_REPEATS}
    repeats = {trial.name for trial in trials if trial.repeats and trial.repeats in groups}
    judged = [one for one in result.check.recordings if one.count[quantity] > 0 and one.name not in repeats]
    return [one for one in judged if one.before[quantity] > most]


def _alternatives(effect: Effect, state: SelectionState, taken: set[str]) -> tuple[dict[str, float], dict[str, float]]:
    """How many times as bad each other kind is in the place of an effect, and how many times as much it leaves, by name."""
    step = state.steps.get(effect.name, SelectionStep([], []))
    own = step.of(effect.name)
    times_worse: dict[str, float] = {}
    leaves: dict[str, float] = {}
    for one, left in zip(step.ranked, step.remaining, strict=True):
        name = one.candidate.name
        if name not in taken and not (kind_of(effect.name).found_by == SILENT_TEXELS and one.candidate.has_texel_parameters):
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


def _rule_out(result: Diagnosis, state: SelectionState, gap_sizes: GapSizes) -> None:
    """Write for each kind that was not found why."""
    tried: dict[str, float] = {}
    for one in state.first.ranked:  # those that were fitted on top of the base model
        name = one.candidate.name
        closed = gap_sizes.closed_share(means_of(one.held_out, one.fit), gap_sizes.quantity_for(name))
        tried[name] = max(tried.get(name, 0.0), closed)
    named = {name for group in result.ambiguous for name in group} | {one.name for one in result.findings}
    possible = {c.name for c in candidates(result.of("fit"), result.base.model)}
    for kind in library().values():
        if kind.name in named:
            continue
        if kind.name in NOT_FITTED:
            why = "the residual noise does not grow with the reading"
        elif kind.name not in possible:
            why = unidentifiable(result.coverage).get(kind.name, "these recordings cannot show it")
        elif kind.name in tried and result.verdict != "no gap":
            why = f"alone it closes {tried[kind.name]:.0%} of the squared gap on unseen trials"
        elif result.verdict == "no gap":
            why = "no gap remains for it to explain"
        else:
            why = state.first.passed_over.get(kind.name, "the model has it already, as a parameter of the base model")
        result.ruled_out.append((kind.name, why))
