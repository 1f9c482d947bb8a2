# SPDX-License-Identifier: GPL-3.0-or-later
"""Find out what the base model of a sensor misses in the recordings of a rig.

The whole road: data faults are put right, noise and range are measured, the base model is refitted, the search looks for the
set of effects with the best score, and the verdict names them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...jobs import Job, Progress
from ...model.sensor import Effect
from ..base.base_model import base_fit, identified_base_parameters, prepared
from ..base.contact_heights import with_starting_heights
from ..base.quantities import FORCES, READINGS, friction_kinds
from ..base.recording_differences import RecordingDifferences, as_one_session, may_differ, own_numbers, with_own_numbers
from ..candidates.candidates import scales_of
from ..candidates.view_set import ViewSet, view_set_of
from ..data_faults.data_fault import DataFault
from ..data_faults.search import find_faults, put_right
from ..dataset.rig import Rig
from ..fitting.intervals import parameter_intervals
from ..fitting.least_squares import BASE, Fit, fit, free_base_parameters
from ..fitting.noise_floor import MEASURED_REPEATS, MOST_SQUARE, ChannelNoise, coverage
from ..fitting.residual_tests import LEAST_STRUCTURE, ResidualStructure, proportional_noise, residual_structure, strongest_line
from ..forward.predictor import Model, Predictor, placed_stimulus, predictors_of
from .blocks import Blocks, views_of
from .check_recordings import checked
from .findings import Diagnosis, Finding
from .score import ONE_SESSION, OWN_NUMBERS, Hypothesis
from .screening import Screening
from .search import TOTAL_WORK, Search, Start
from .verdict import closed_shares, judge, with_best_forms

BASE_MODEL, VERDICT = 40, 950
"""Work that is done when the fit of the base model and the verdict begin, of :data:`.search.TOTAL_WORK`."""
LAST_STEPS, LAST_TOLERANCE = 40, 1e-6
"""Of the last fit, of the model that was chosen."""


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
    begun = yield from _begin(rig)
    is_repeated = begun.result.noise[begun.main_quantity].source == MEASURED_REPEATS
    has_few_values = begun.view_set.repeats_few_values(begun.result.base.model)
    search = Search(_starts(begun), MOST_SQUARE - 1.0 if is_repeated else None, has_few_values)
    named = yield from search.run()
    best = yield from search.predicting(named)
    yield Progress("verdict", VERDICT, TOTAL_WORK)
    if best is named:
        best = with_best_forms(search, named)
    elif search.best() is best:
        named = best  # what joined to predict has earned its name
    return _concluded(begun, search, named, best)


@dataclass
class _Begun:
    """A diagnosis that has the fitted base model alone, and the views of its fitted recordings."""

    result: Diagnosis
    view_set: ViewSet

    @property
    def main_quantity(self) -> int:
        """READINGS if there are any, else FORCES."""
        return READINGS if self.result.base.count[:, READINGS].any() else FORCES


def _begin(rig: Rig) -> Job[_Begun]:
    """Prepare recordings and fit the base model."""
    yield Progress("contacts of every trial", 0, TOTAL_WORK)
    rig, predictors, faults = _with_checked_data(with_starting_heights(rig))
    noise, full = prepared(rig, predictors)
    yield Progress("base model", BASE_MODEL, TOTAL_WORK)
    begun = _begun_with(rig, predictors, noise, full)
    begun.result.faults = faults
    return begun


def _begun_with(
    rig: Rig, predictors: list[Predictor], noise: tuple[ChannelNoise, ChannelNoise], full: tuple[float, float]
) -> _Begun:
    """The base model, fitted to recordings."""
    fitted = [p for p in predictors if p.trial.use == "fit"]
    view_set = view_set_of(fitted, (noise[0].deviation, noise[1].deviation))
    base = base_fit(rig, view_set.whole, full[0])
    scales = scales_of(fitted, base.model)
    return _Begun(Diagnosis(rig, predictors, noise, full, coverage(fitted), scales, base, base), view_set)


def _starts(begun: _Begun) -> dict[str, Start]:
    """The base model under each assumption about how recordings differ, made when the search asks for it."""
    result = begun.result
    deviations = result.noise[READINGS].deviation, result.noise[FORCES].deviation
    memory = result.noise[READINGS].correlation_time, result.noise[FORCES].correlation_time
    views = views_of(result.predictors, deviations, memory)
    blocks = Blocks(views)
    alone: dict[str, Effect] = {}

    def start(own: _Begun, assumed: str) -> tuple[Screening, Hypothesis]:
        used = views if own is begun else views.with_predictors(own.result.predictors)
        screening = Screening(own.view_set, blocks, used, own.result.scales, assumed, alone)
        base = fit(used.fitted, own.result.base.model, own.result.base.free, max_steps=3)
        return screening, screening.hypothesis(base)

    starts: dict[str, Start] = {"": lambda: start(begun, "")}
    if may_differ(result.rig):
        starts[OWN_NUMBERS] = lambda: start(_with_own_numbers(result), OWN_NUMBERS)
        session = as_one_session(result.rig)
        if session is not None:
            starts[ONE_SESSION] = lambda: start(
                _begun_with(session, predictors_of(session.trials, session), result.noise, result.full), ONE_SESSION
            )
    return starts


def _with_own_numbers(result: Diagnosis) -> _Begun:
    """The base model with a factor and a zero of each recording."""
    rig = with_own_numbers(result.rig)
    predictors = [one.with_numbers_of(trial) for one, trial in zip(result.predictors, rig.trials, strict=True)]
    return _begun_with(rig, predictors, result.noise, result.full)


def _concluded(begun: _Begun, search: Search, named: Hypothesis, best: Hypothesis) -> Diagnosis:
    """The diagnosis of the model that the rule chose, `named`, and of the one that predicts best with its effects."""
    result, view_set = _under_assumption(begun, search, best)
    result.best = _with_base_refitted(result, view_set, best.fit)
    result.base_structure, result.structure = (_structure(view_set, found) for found in (result.base, result.best))
    result.noise_level = search.score.noise.under(search.score.weights[0])
    result.line = strongest_line(view_set.whole, result.best.model)
    result.check = checked(search.under("")[0].blocks, search.score, search.base, best)
    result.faults = faults_of(result, named.fit.model)
    judge(search, named, best, result)
    _find_noise(result, view_set, search, best)
    result.intervals = parameter_intervals(result.best)
    result.stages = _stages(result, view_set)
    return result


def _under_assumption(begun: _Begun, search: Search, best: Hypothesis) -> tuple[Diagnosis, ViewSet]:
    """The result that belongs to a model: with recordings as they are assumed to differ."""
    plain = begun.result
    if not best.assumed:
        return plain, begun.view_set
    screening, base = search.under(best.assumed)
    predictors = [view.predictor for view in screening.views.all]
    by_name = {one.trial.name: one for one in predictors}
    order = [by_name[one.trial.name] for one in plain.predictors]
    rig = replace(plain.rig, trials=tuple(one.trial for one in order))
    view_set = screening.view_set
    found = fit(view_set.whole, base.fit.model, base.fit.free)
    result = Diagnosis(rig, order, plain.noise, plain.full, plain.coverage, screening.scales, found, found, faults=plain.faults)
    result.assumed_session = best.assumed == ONE_SESSION
    if best.assumed == OWN_NUMBERS:
        result.alike = plain
        result.between = _differences(result, search, best, _relative_error(plain))
    return result, view_set


def _differences(result: Diagnosis, search: Search, best: Hypothesis, before: float) -> RecordingDifferences:
    """Levels and gains by which recordings differ, with the weight of models that have them."""
    score = search.score
    others = [one for one in search.tried if one.assumed != OWN_NUMBERS]
    confidence = score.weight(best, max(others, key=score.value))
    closed = closed_shares(search, search.under(OWN_NUMBERS)[1]).left_out
    factors, zeros = own_numbers(best.fit.model, result.predictors)
    closes = max((share for share in closed if share is not None), default=0.0)
    return RecordingDifferences(closes, round(confidence, 3), before, factors, zeros)


def _find_noise(result: Diagnosis, view_set: ViewSet, search: Search, best: Hypothesis) -> None:
    """Add noise that grows with the reading, where the rest has no structure and is larger than the noise without load."""
    if result.structure.total >= LEAST_STRUCTURE or result.line is not None or search.has_few_values:
        return  # of noise before a converter only what moves a reading over an edge is seen
    found = proportional_noise(view_set.whole, result.best.model)
    if found is None:
        return
    result.best = replace(result.best, model=result.best.model.with_effect(found))
    weight = 1.0 / (1.0 + float(np.exp(-np.clip(search.score.most_to_gain(best), -50.0, 50.0))))
    result.findings.append(Finding(len(best.names), found.name, found.form, round(weight, 3), ()))
    result.ruled_out = [(name, why) for name, why in result.ruled_out if name != found.name]
    is_sure = all(one.name not in {name for group in result.ambiguous for name in group} for one in result.findings)
    if search.score.leaves_gap(best) and is_sure and not result.check.is_refuted:
        result.verdict = "explained"


def _relative_error(result: Diagnosis) -> float:
    """NRMSE of the base model on the fitted recordings."""
    scale = np.array([one.deviation / size for one, size in zip(result.noise, result.full, strict=True)])
    return float(np.sqrt((result.base.sse.sum(axis=0) * scale**2).sum() / max(float(result.base.count.sum()), 1.0)))


def _with_checked_data(rig: Rig) -> tuple[Rig, list[Predictor], list[DataFault]]:
    """The rig with those faults of its data put right for which it asks, predictors of its trials, and all faults."""
    predictors = predictors_of(rig.trials, rig)
    faults = find_faults(rig, [predictor.stimulus for predictor in predictors])
    if not any(fault.kind in rig.correct for fault in faults):
        return rig, predictors, faults
    rig, faults = put_right(rig, [predictor.stimulus for predictor in predictors])
    return rig, predictors_of(rig.trials, rig), faults


def faults_of(result: Diagnosis, named: Model) -> list[DataFault]:
    """Return the faults of the data: those that were put right, and others if texels where a model puts them show them, too."""
    if not named.placing_effects:
        return result.faults
    stimuli = [placed_stimulus(one, result.rig, named) for one in result.rig.trials]
    kinds = {fault.kind for fault in result.faults}
    found = [fault for fault in find_faults(result.rig, stimuli) if fault.kind in kinds]
    return [*(fault for fault in result.faults if fault.put_right), *found]


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
    """The fit at its end, with all identified parameters of the base model free, because values that a rig states are rounded.

    Beside an effect on friction they would take over its part. There they keep their values, and are free only so that the
    intervals are as wide as the recordings say.
    """
    names = identified_base_parameters(result.rig, [view.predictor for view in view_set.whole])
    if set(names) == {item.name for item in found.free if item.effect == BASE}:
        return fit(view_set.whole, found.model, found.free, max_steps=LAST_STEPS, tolerance=LAST_TOLERANCE)
    has_friction_effect = any(effect.name in friction_kinds() for effect in found.model.effects)
    free = free_base_parameters(found.model.parameters, names, result.full[READINGS])
    free += [item for item in found.free if item.effect != BASE]
    steps = 0 if has_friction_effect else LAST_STEPS
    return fit(view_set.whole, found.model, free, max_steps=steps, tolerance=LAST_TOLERANCE)
