# SPDX-License-Identifier: GPL-3.0-or-later
"""Find out what the base model of a sensor misses in the recordings of a rig.

The base model is refitted, effects are added to it by forward selection, and the result is put into a :class:`.Diagnosis`.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from ...jobs import Job, Progress
from ..data_faults.data_fault import DataFault
from ..data_faults.search import find_faults, put_right
from ..dataset.rig import Rig
from ..fitting.intervals import parameter_intervals
from ..fitting.least_squares import BASE, Fit, fit, free_base_parameters, held_out_squares
from ..fitting.noise_floor import SHORTEST_STRETCH, ChannelNoise, coverage, is_scatter_of_repeats
from ..fitting.residual_tests import LEAST_STRUCTURE, ResidualStructure, proportional_noise, residual_structure, strongest_line
from ..forward.predictor import Model, Predictor, predictors_of
from .base_model import base_fit, identified_base_parameters, prepared
from .between_recordings import (
    DRIFT,
    LEAST_CLOSED,
    LEAST_LOWERED,
    LOAD_HISTORY,
    MOST_LEFT,
    WEAR,
    as_one_session,
    differences,
    may_differ,
    texels_can_tell,
    with_common_zero,
    with_own_numbers,
)
from .candidates import FittedCandidate, candidates, scales_of
from .check_recordings import check_views, checked
from .confidence import EXPLAINED, UNSURE_CONFIDENCE
from .contact_heights import with_starting_heights
from .findings import Diagnosis, Finding
from .forward_selection import ForwardSelection, SelectionState
from .gap_sizes import FORCES, READINGS, UNRESOLVED_SQUARE, GapSizes, friction_kinds
from .outlying_channels import outlying_channels, without_channels
from .screening import screen
from .verdict import conclude
from .view_set import ViewSet, view_set_of

TOTAL_WORK = 1000
BASE_MODEL_BEGINS, SELECTION_BEGINS = 40, 60
"""Share of the whole work, in thousandths, at which the fit of the base model and the selection of effects begin."""
OTHER_SEARCHES_BEGIN = 500
"""Share at which the searches begin that ask how recordings differ."""
SETTLED_SHARE = 0.05
"""Share of the base model's gap. If a search explains more than the rest of it, no search asks how recordings differ."""
LEAST_NOISE = 0.8
"""Least mean square of the noise in units of its estimate: the estimate is not trusted to be too large by more than this."""

Outcome = TypeVar("Outcome")


def diagnose(rig: Rig) -> Job[Diagnosis]:
    """Find out what the base model misses in a rig.

    Yields
    ------
    Progress
        During the work. Closing the generator stops it.

    Returns
    -------
    Diagnosis
    """
    yield Progress("contacts of every trial", 0, TOTAL_WORK)
    rig, predictors, faults = _with_checked_data(with_starting_heights(rig))
    noise, full = prepared(rig, predictors)
    yield Progress("base model", BASE_MODEL_BEGINS, TOTAL_WORK)
    plain = _search_of(rig, predictors, noise, full, faults)
    yield from _progress_of(_find_effects(plain), SELECTION_BEGINS, OTHER_SEARCHES_BEGIN if may_differ(rig) else TOTAL_WORK)
    best = plain
    if may_differ(rig) and not _is_settled(plain):
        best = yield from _best_of_other_searches(plain)
    best.result.stages = _stages(best.result, best.views)
    return best.result


def _find_effects(search: _Search) -> Generator[tuple[str, float], None, None]:
    """Find the effects that a base model lacks: select, compare with the check recordings, judge. Completes the diagnosis."""
    result, views = search.result, search.views
    base, gap_sizes = _measured_gap(result, views)
    selection = ForwardSelection(views, result.scales, result.coverage, gap_sizes)
    state = base
    if not is_scatter_of_repeats(result.noise, result.base.sse, result.base.count):
        state = yield from selection.run(base, partial(_structure, views))
    check = check_views(result.predictors, (result.noise[READINGS].deviation, result.noise[FORCES].deviation))
    result.outlying = outlying_channels(views.whole, check, result.base.model, state.fit.model)
    state = replace(state, fit=_with_base_refitted(result, views, state.fit))
    result.best, result.structure = state.fit, _structure(views, state.fit)
    result.line = strongest_line(views.whole, state.fit.model)
    _separate_noise(result, views, state, gap_sizes)
    result.intervals = parameter_intervals(result.best)
    memory = result.noise[READINGS].correlation_time, result.noise[FORCES].correlation_time
    check = without_channels(check, result.outlying)
    result.check = checked(check, result.base.model, result.best.model, gap_sizes, memory)
    conclude(result, views, state, gap_sizes)


def _progress_of(
    work: Generator[tuple[str, float], None, Outcome], begins: int, ends: int
) -> Generator[Progress, None, Outcome]:
    """Progress of a work that says which share of it is done, between two shares of the whole work."""
    while True:
        try:
            what, share = next(work)
        except StopIteration as stop:
            outcome: Outcome = stop.value
            return outcome
        yield Progress(what, begins + int((ends - begins) * share), TOTAL_WORK)


def _is_settled(plain: _Search) -> bool:
    """True if recordings that each begin with an untouched sensor leave nothing to say about differences between them."""
    return plain.result.verdict == "no gap" or (
        plain.result.verdict == "explained" and plain.left < SETTLED_SHARE * plain.left_of_base
    )


def _best_of_other_searches(plain: _Search) -> Generator[Progress, None, _Search]:
    """Search with the recordings as one session, and with numbers of their own.

    Returns
    -------
    _Search
        The best of them, or the plain one.
    """
    own, session, best = _search_with_own_numbers(plain), _search_of_one_session(plain), plain
    middle = (OTHER_SEARCHES_BEGIN + TOTAL_WORK) // 2
    if session is not None and session.is_wanted:
        yield from _progress_of(_find_effects(session), OTHER_SEARCHES_BEGIN, middle)
        if _is_one_session(session, plain):
            session.result.assumed_session, best = True, session
            _doubt_wear(session, own)
            if session.left <= own.left_of_base:
                return session
    if own.is_wanted:
        yield from _progress_of(_find_effects(own), middle, TOTAL_WORK)
        if own.left < MOST_LEFT * plain.left and (best is plain or own.left < best.left):
            _name_differences(own, plain, session)
            best = own
    return best


@dataclass
class _Search:
    """A diagnosis that is being made.

    Attributes
    ----------
    result : Diagnosis
    views : ViewSet
        Of the fitted trials.
    closes : float
        Share of the gap that is closed before the search for effects, by what recordings do not share.
    is_wanted : bool
        True if this is enough for a search for effects.
    left_by_load : float
        Excess error with wear or softening alone, in a search of one session.
    """

    result: Diagnosis
    views: ViewSet
    closes: float = 0.0
    is_wanted: bool = True
    left_by_load: float = np.inf

    @property
    def left(self) -> float:
        """Excess error of the amended model (see :func:`_excess_error`)."""
        return _excess_error(self.views, self.result.best)

    @cached_property
    def left_of_base(self) -> float:
        """Excess error of the base model."""
        return _excess_error(self.views, self.result.base)


def _search_of(
    rig: Rig,
    predictors: list[Predictor],
    noise: tuple[ChannelNoise, ChannelNoise],
    full: tuple[float, float],
    faults: list[DataFault],
) -> _Search:
    """A search that has the fitted base model alone."""
    result, views = _with_base_model(rig, predictors, noise, full)
    result.faults = faults
    return _Search(result, views)


def _search_with_own_numbers(plain: _Search) -> _Search:
    """The search with a factor and a zero of each recording. What a zero of all recordings closes does not count."""
    result = plain.result

    def predictors_for(rig: Rig) -> list[Predictor]:
        return [one.with_numbers_of(trial) for one, trial in zip(result.predictors, rig.trials, strict=True)]

    common, rig = with_common_zero(result.rig), with_own_numbers(result.rig)
    with_zero = _fitted_base(common, predictors_for(common), result.noise, result.full)
    own = _search_of(rig, predictors_for(rig), result.noise, result.full, result.faults)
    before, after = min(plain.left_of_base, _excess_error(*with_zero)), own.left_of_base
    own.closes = 1.0 - after / before
    own.is_wanted = own.closes >= LEAST_CLOSED and before - after > LEAST_LOWERED
    return own


def _search_of_one_session(plain: _Search) -> _Search | None:
    """The search with the recordings as one session in their order; None if they cannot be one, or leave no gap."""
    result = plain.result
    rig = as_one_session(result.rig)
    if rig is None or plain.left_of_base <= LEAST_LOWERED:
        return None
    session = _search_of(rig, predictors_of(rig.trials, rig), result.noise, result.full, result.faults)
    fitted = [view.predictor for view in session.views.whole]
    forms = [one for one in candidates(fitted, session.result.base.model) if one.name in LOAD_HISTORY]
    ranked: list[FittedCandidate] = []
    for _, _, found in screen(session.views, session.result.base, forms, session.result.scales):
        ranked = found or ranked
    session.left_by_load = min(
        (_excess_error(session.views, one.fit) for one in ranked if one.candidate.name in LOAD_HISTORY), default=np.inf
    )
    session.closes = 1.0 - session.left_by_load / plain.left_of_base
    session.is_wanted = session.closes > 1.0 - MOST_LEFT
    return session


def _is_one_session(session: _Search, plain: _Search) -> bool:
    """True if what recordings remember of each other explains them far better than if each begins untouched."""
    result = session.result
    remembers = any(one.name in LOAD_HISTORY and one.confidence > UNSURE_CONFIDENCE for one in result.findings)
    return remembers and result.verdict == "explained" and session.left < MOST_LEFT * plain.left


def _doubt_wear(session: _Search, own: _Search) -> None:
    """Put the wear of an assumed session in doubt where nothing tells it from a drift from recording to recording.

    The pauses are not known, so a gain that falls with the time was not looked for along the session.
    """
    result = session.result
    by_texels = texels_can_tell([one.stimulus for one in own.result.predictors]) and session.left < MOST_LEFT * own.left_of_base
    if not by_texels and any(one.name == WEAR and one.confidence > UNSURE_CONFIDENCE for one in result.findings):
        result.findings = [_in_doubt(one) if one.name == WEAR else one for one in result.findings]
        result.ambiguous.append((WEAR, DRIFT))


def _name_differences(own: _Search, plain: _Search, session: _Search | None) -> None:
    """Say in a result by which levels and gains its recordings differ."""
    result, before = own.result, plain.result
    error = _relative_error(before.base, before.noise, before.full)
    texels_alike = session is not None and own.left_of_base < MOST_LEFT * session.left_by_load
    result.between = differences(result.best.model, result.predictors, own.closes, error, result.full[READINGS], texels_alike)
    result.alike = before
    named = [result.between.name]
    if result.between.rival:
        named.append(result.between.rival)
        result.ambiguous.append(tuple(named))
        result.findings = [_in_doubt(one) if one.name in (*LOAD_HISTORY, DRIFT) else one for one in result.findings]
    result.ruled_out = [(name, why) for name, why in result.ruled_out if name not in named]
    in_doubt = result.misleading_faults or result.between.rival or result.between.changed_from
    if in_doubt or result.check.is_refuted:
        result.between = replace(result.between, confidence=min(result.between.confidence, UNSURE_CONFIDENCE))
    most = 1.0 - own.left / plain.left_of_base
    if result.verdict == "no gap" or (most >= EXPLAINED and not result.check.is_refuted):
        result.verdict = "explained"


def _in_doubt(one: Finding) -> Finding:
    """A finding that is not sure: what falls within recordings as from one to the next is wear or drift as that is."""
    why = "gains fall from recording to recording, and the recordings do not show whether with use or time"
    return replace(one, confidence=min(one.confidence, UNSURE_CONFIDENCE), doubts=(*one.doubts, why))


def _with_base_model(
    rig: Rig, predictors: list[Predictor], noise: tuple[ChannelNoise, ChannelNoise], full: tuple[float, float]
) -> tuple[Diagnosis, ViewSet]:
    """A diagnosis that has the fitted base model alone, and the views of the fitted trials."""
    fitted = [p for p in predictors if p.trial.use == "fit"]
    view_set, base = _fitted_base(rig, predictors, noise, full)
    structure = _structure(view_set, base)
    scales = scales_of(fitted, base.model)
    return Diagnosis(rig, predictors, noise, full, coverage(fitted), scales, base, base, structure, structure), view_set


def _fitted_base(
    rig: Rig, predictors: list[Predictor], noise: tuple[ChannelNoise, ChannelNoise], full: tuple[float, float]
) -> tuple[ViewSet, Fit]:
    """The views of the fitted trials, and the fit of the base model to them."""
    fitted = [p for p in predictors if p.trial.use == "fit"]
    view_set = view_set_of(fitted, (noise[0].deviation, noise[1].deviation))
    return view_set, base_fit(rig, view_set.whole, full[0])


def _relative_error(found: Fit, noise: tuple[ChannelNoise, ChannelNoise], full: tuple[float, float]) -> float:
    """NRMSE of a fit on the fitted trials."""
    scale = np.array([one.deviation / size for one, size in zip(noise, full, strict=True)])
    return float(np.sqrt((found.sse.sum(axis=0) * scale**2).sum() / max(float(found.count.sum()), 1.0)))


def _excess_error(view_set: ViewSet, found: Fit) -> float:
    """Mean square of a fit on unseen stretches, less that of noise, plus what no fit can resolve."""
    mean = float(held_out_squares(view_set.whole, found).sum()) / max(float(found.count.sum()), 1.0)
    return max(mean - 1.0, 0.0) + UNRESOLVED_SQUARE


def _with_checked_data(rig: Rig) -> tuple[Rig, list[Predictor], list[DataFault]]:
    """The rig with those faults of its data put right for which it asks, predictors of its trials, and all faults."""
    predictors = predictors_of(rig.trials, rig)
    faults = find_faults(rig, [predictor.stimulus for predictor in predictors])
    if not any(fault.kind in rig.correct for fault in faults):
        return rig, predictors, faults
    rig, faults = put_right(rig, [predictor.stimulus for predictor in predictors])
    return rig, predictors_of(rig.trials, rig), faults


def _measured_gap(result: Diagnosis, view_set: ViewSet) -> tuple[SelectionState, GapSizes]:
    """The base model as the state in which a selection begins, and the gaps of readings and forces that it leaves."""
    base = SelectionState(result.base, held_out_squares(view_set.whole, result.base))
    start = base.means
    noise = np.array([min(1.0, start[READINGS]), min(_unloaded_force_noise(view_set, result.base), start[FORCES])])
    return base, GapSizes(start, noise, result.base.count.sum(axis=0).astype(float))


def _separate_noise(result: Diagnosis, view_set: ViewSet, state: SelectionState, gap_sizes: GapSizes) -> None:
    """Correct the noise of the main quantity by the part of the residual that depends on nothing."""
    main, mean = gap_sizes.main_quantity, float(state.means[gap_sizes.main_quantity])
    before = gap_sizes.base[main] * (1.0 - result.base_structure.total)
    gap_sizes.noise[main] = float(np.clip(min(before, mean * (1.0 - result.structure.total)), LEAST_NOISE, 1.0))
    if result.structure.total < LEAST_STRUCTURE and result.line is None:
        noise_effect = proportional_noise(view_set.whole, state.fit.model)
        if noise_effect is not None:  # then the whole residual is noise
            result.best = replace(state.fit, model=state.fit.model.with_effect(noise_effect))
            gap_sizes.noise[main] = max(gap_sizes.noise[main], mean)


def _stages(result: Diagnosis, view_set: ViewSet) -> list[Model]:
    """The base model, the models with one effect more each, and the amended model, which is not fitted again."""
    stages = [result.base.model]
    effects = result.best.model.effects
    for count in range(1, len(effects)):
        free = [item for item in result.best.free if item.effect < count]
        start = replace(result.best.model, effects=effects[:count])
        stages.append(fit(view_set.whole, start, free, max_steps=6, tolerance=1e-4, with_equations=False).model)
    return [*stages, result.best.model] if effects else stages


def _structure(view_set: ViewSet, found: Fit) -> ResidualStructure:
    """Dependence of a fit's residual on what is known of each sample.

    Without readings the largest component of the net force stands for all texels.
    """
    width = len(view_set.whole[0].predictor.rig.texels)
    predictors = [view.predictor for view in view_set.whole]
    residuals = [view.residual(found.model) for view in view_set.whole]
    if any(predictor.trial.reading is not None for predictor in predictors):
        return residual_structure(predictors, [r[:, :width] for r in residuals])
    total = np.sum([(r[:, width:] ** 2).sum(axis=0) for r in residuals], axis=0)
    axis = width + int(np.argmax(total))
    return residual_structure(predictors, [np.tile(r[:, axis : axis + 1], (1, width)) for r in residuals])


def _with_base_refitted(result: Diagnosis, view_set: ViewSet, found: Fit) -> Fit:
    """The fit with all identified parameters of the base model free, because values that a rig states are rounded.

    Beside an effect on friction they would take over its part. There they keep their values, and are free only so that the
    intervals are as wide as the recordings say.
    """
    names = identified_base_parameters(result.rig, [view.predictor for view in view_set.whole])
    if set(names) == {item.name for item in found.free if item.effect == BASE}:
        return found
    has_friction_effect = any(effect.name in friction_kinds() for effect in found.model.effects)
    free = free_base_parameters(found.model.parameters, names, result.full[READINGS])
    free += [item for item in found.free if item.effect != BASE]
    return fit(view_set.whole, found.model, free, max_steps=0 if has_friction_effect else 10, tolerance=1e-5)


def _unloaded_force_noise(view_set: ViewSet, found: Fit) -> float:
    """Mean square of the forces' residual while nothing touches; at least 1, the value of white noise."""
    squares = []
    for view in view_set.whole:
        unloaded = ~(view.predictor.stimulus.load > 0).any(axis=1)
        if view.with_forces and view.predictor.trial.force is not None and unloaded.sum() >= SHORTEST_STRETCH:
            squares.append(view.residual(found.model)[unloaded, -3:] ** 2)
    return max(float(np.concatenate(squares).mean()), 1.0) if squares else 1.0
