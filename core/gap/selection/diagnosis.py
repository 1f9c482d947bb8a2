# SPDX-License-Identifier: GPL-3.0-or-later
"""Find out what the base model of a sensor misses in the recordings of a rig.

The base model is refitted, effects are added to it by forward selection, and the result is put into a :class:`.Diagnosis`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from ...jobs.progress import Job, Progress
from ..data_faults.data_fault import DataFault
from ..data_faults.search import find_faults, put_right
from ..dataset.rig import Rig
from ..fitting.heteroscedastic_noise import proportional_noise
from ..fitting.intervals import parameter_intervals
from ..fitting.least_squares import BASE, Fit, fit, free_base_parameters, held_out_squares
from ..fitting.noise_floor import SHORTEST_STRETCH, ChannelNoise, coverage
from ..fitting.repeat_noise import is_scatter_of_repeats
from ..fitting.residual_tests import LEAST_STRUCTURE, ResidualStructure, residual_structure
from ..fitting.spectral_lines import strongest_line
from ..forward.predictor import Model, Predictor, predictors_of
from .base_model import base_fit, identified_base_parameters, prepared
from .between_recordings import LEAST_CLOSED, LEAST_LOWERED, MOST_LEFT, differences, with_own_numbers
from .candidates import scales_of
from .check_recordings import check_views, checked
from .confidence import UNSURE_CONFIDENCE
from .contact_heights import with_starting_heights
from .findings import Diagnosis
from .forward_selection import ForwardSelection, SelectionState
from .gap_sizes import FORCES, READINGS, UNRESOLVED_SQUARE, GapSizes, friction_kinds
from .harmful_effects import without_harmful_effects
from .verdict import conclude
from .view_set import ViewSet, view_set_of

TOTAL_WORK = 1000
BASE_MODEL_BEGINS, SELECTION_BEGINS = 40, 60
"""Share of the whole work, in thousandths, at which the fit of the base model and the selection of effects begin."""
LEAST_NOISE = 0.8
"""Least mean square of the noise in units of its estimate: the estimate is not trusted to be too large by more than this."""


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
    rig, predictors, faults = _without_faults(with_starting_heights(rig))
    noise, full = prepared(rig, predictors)
    yield Progress("base model", BASE_MODEL_BEGINS, TOTAL_WORK)
    result, view_set = _with_base_model(rig, predictors, noise, full)
    result.faults = faults
    other, second, closes = with_own_numbers(rig), None, 0.0
    if other is not None:
        twins = [one.with_numbers_of(trial) for one, trial in zip(predictors, other.trials, strict=True)]
        own, own_views = _with_base_model(other, twins, noise, full)
        own.faults = faults
        before, after = _left(view_set, result.base), _left(own_views, own.base)
        closes = 1.0 - after / before
        second = own if closes >= LEAST_CLOSED and before - after > LEAST_LOWERED else None
    ends = TOTAL_WORK if second is None else (SELECTION_BEGINS + TOTAL_WORK) // 2
    for what, share in _select_effects(result, view_set):
        yield Progress(what, SELECTION_BEGINS + int((ends - SELECTION_BEGINS) * share), TOTAL_WORK)
    result.stages = _stages(result, view_set)
    if second is not None:
        for what, share in _select_effects(second, own_views):
            yield Progress(what, ends + int((TOTAL_WORK - ends) * share), TOTAL_WORK)
        second.stages = _stages(second, own_views)
        if _left(own_views, second.best) < MOST_LEFT * _left(view_set, result.best):
            error = _relative_error(result.base, noise, full)
            second.between = differences(second.best.model, second.of("fit"), closes, error, full[READINGS])
            if second.misleading_faults:
                second.between = replace(second.between, confidence=min(second.between.confidence, UNSURE_CONFIDENCE))
            second.verdict = "explained" if second.verdict == "no gap" else second.verdict
            result = second
    return result


def _with_base_model(
    rig: Rig, predictors: list[Predictor], noise: tuple[ChannelNoise, ChannelNoise], full: tuple[float, float]
) -> tuple[Diagnosis, ViewSet]:
    """A diagnosis that has the fitted base model alone, and the views of the fitted trials."""
    fitted = [p for p in predictors if p.trial.use == "fit"]
    view_set = view_set_of(fitted, (noise[0].deviation, noise[1].deviation))
    base = base_fit(rig, view_set.whole, full[0])
    structure = _structure(view_set, base)
    scales = scales_of(fitted, base.model)
    return Diagnosis(rig, predictors, noise, full, coverage(fitted), scales, base, base, structure, structure), view_set


def _relative_error(found: Fit, noise: tuple[ChannelNoise, ChannelNoise], full: tuple[float, float]) -> float:
    """NRMSE of a fit on the fitted trials."""
    scale = np.array([one.deviation / size for one, size in zip(noise, full, strict=True)])
    return float(np.sqrt((found.sse.sum(axis=0) * scale**2).sum() / max(float(found.count.sum()), 1.0)))


def _left(view_set: ViewSet, found: Fit) -> float:
    """Mean square of a fit on unseen stretches, less that of noise, plus what no fit can resolve."""
    mean = float(held_out_squares(view_set.whole, found).sum()) / max(float(found.count.sum()), 1.0)
    return max(mean - 1.0, 0.0) + UNRESOLVED_SQUARE


def _without_faults(rig: Rig) -> tuple[Rig, list[Predictor], list[DataFault]]:
    """The rig with those faults of its data put right for which it asks, predictors of its trials, and all faults."""
    predictors = predictors_of(rig.trials, rig)
    faults = find_faults(rig, [predictor.stimulus for predictor in predictors])
    if not any(fault.kind in rig.correct for fault in faults):
        return rig, predictors, faults
    rig, faults = put_right(rig, [predictor.stimulus for predictor in predictors])
    return rig, predictors_of(rig.trials, rig), faults


def _select_effects(result: Diagnosis, view_set: ViewSet) -> Iterator[tuple[str, float]]:
    """Add effects to the base model while each improves it enough; write the outcome into `result`."""
    base = SelectionState(result.base, held_out_squares(view_set.whole, result.base))
    start = base.means
    noise = np.array([min(1.0, start[READINGS]), min(_unloaded_force_noise(view_set, result.base), start[FORCES])])
    gap_sizes = GapSizes(start, noise, result.base.count.sum(axis=0).astype(float))
    selection = ForwardSelection(view_set, result.scales, result.coverage, gap_sizes)
    if is_scatter_of_repeats(result.noise, result.base.sse, result.base.count):
        state = base
    else:
        state = yield from selection.run(base, partial(_structure, view_set))
    deviations = result.noise[READINGS].deviation, result.noise[FORCES].deviation
    check = check_views(result.predictors, deviations)
    state = without_harmful_effects(view_set.whole, check, state, gap_sizes)
    state = replace(state, fit=_with_base_refitted(result, view_set, state.fit))
    result.best, result.structure = state.fit, _structure(view_set, state.fit)
    result.line = strongest_line(view_set.whole, state.fit.model)
    main, mean = gap_sizes.main_quantity, float(state.means[gap_sizes.main_quantity])
    unpredictable = min(start[main] * (1.0 - result.base_structure.total), mean * (1.0 - result.structure.total))
    gap_sizes.noise[main] = float(np.clip(unpredictable, LEAST_NOISE, 1.0))
    if result.structure.total < LEAST_STRUCTURE and result.line is None:
        noise_effect = proportional_noise(view_set.whole, state.fit.model)
        if noise_effect is not None:  # then the whole residual is noise
            result.best = replace(state.fit, model=state.fit.model.with_effect(noise_effect))
            gap_sizes.noise[main] = max(gap_sizes.noise[main], mean)
    result.intervals = parameter_intervals(result.best)
    memory = result.noise[READINGS].correlation_time, result.noise[FORCES].correlation_time
    result.check = checked(check, result.base.model, result.best.model, gap_sizes, memory)
    conclude(result, view_set, state, gap_sizes)


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
    """What the residual of a fit depends on. Without readings the largest component of the net force stands for all texels."""
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
