# SPDX-License-Identifier: GPL-3.0-or-later
"""Screening: which effects improve a fit most?

Each candidate goes through three sieves. A score test says how much it could explain beside the free parameters. Those that
promise most are fitted to a part of the data (see :mod:`.view_set`). The best of these are fitted to everything and judged on
stretches of the recordings that the fit has not seen.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.engine.specification import SILENT_TEXELS, STEPS
from ...model.sensor import Effect
from ...model.sensor_parameters import FITTED_FRICTION_PARAMETERS
from ..fitting.least_squares import Fit, FreeParameter, TrialView, fit, held_out_squares
from ..forward.predictor import Model
from .candidates import DIRECTLY_ESTIMATED, Candidate, FittedCandidate, Scales
from .direct_estimates import few_levels, quantization_starts, unresponsive_texels
from .rao_score import ScoreTest
from .view_set import ViewSet

SMALL_RECORDING = 20_000
"""Number of measured values up to which a fit is so quick that the search is thorough (see :data:`THOROUGH`)."""
MOST_TIMES_THE_BEST, FLOOR_SHARE = 3.0, 0.04
"""After the first fits, a candidate is dropped if what it leaves of the gap is more than this many times what the best one
leaves plus a small share of the gap."""
BEST_KINDS = 3
LEAST_PROMISE = {"best kinds": 0.02, "best form": 0.05, "others": 0.4}
"""Least promise for a first fit, as a share of the largest: of the forms of the three most promising kinds, of the best form of
another kind, and of its further forms."""
VISIBLE_STEPS_PROMISE = 0.5
"""Promise of quantization whose steps are seen in the readings, as a share of the squares: it is always fitted."""
LONGEST_STEP = 20.0
"""A starting point is moved along a candidate's strength by at most this factor."""
SHORTEST_STEP = 0.01
SMALL_SHIFT, SMALL_TURN = 0.02, 2e-3
"""Test steps of displaced texels: a share of the pitch, and an angle in rad."""
LARGEST_SHIFT, LARGEST_TURN = 0.5, 0.1
"""Bounds of their starting points, in the same units."""
LARGE_SHIFTS = (0.3, 0.7)
"""Shifts, as shares of the pitch, that are tried as they are under a flat indenter."""
DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1))
TEXEL_STEP = 0.01
"""Test step of parameters of single texels, as a share of their scale."""


@dataclass(frozen=True)
class Effort:
    """How thorough a search is.

    Attributes
    ----------
    most_first_fits : int or None
        Candidates that are fitted to a part of the data; None: all that promise anything.
    starts : int
        Starting points of each first fit.
    trial_steps : int or None
        Steps of a fit from each of them, before the best goes on alone; None: all go on to the end.
    max_steps, tolerance : int, float
        Of the fits (see :func:`.least_squares.fit`).
    kinds, forms : int
        Kinds that are fitted to everything, and forms of the best kind among them.
    """

    most_first_fits: int | None
    starts: int
    trial_steps: int | None
    max_steps: int
    tolerance: float
    kinds: int
    forms: int


QUICK = Effort(most_first_fits=14, starts=3, trial_steps=3, max_steps=14, tolerance=1e-4, kinds=4, forms=2)
THOROUGH = Effort(most_first_fits=None, starts=4, trial_steps=None, max_steps=40, tolerance=1e-6, kinds=8, forms=4)
"""For small recordings. A single starting point would lose candidates that depend strongly on their parameters."""
FIRST_FIT_TOLERANCE = 1e-3


@dataclass(frozen=True)
class Promise:
    """A candidate after its score test.

    Attributes
    ----------
    share : float
        By how much it could lower the squares, as a share of them.
    candidate : Candidate
    starts : list of Effect
        Starting points of a fit, best first.
    """

    share: float
    candidate: Candidate
    starts: list[Effect]


@dataclass(frozen=True)
class ScreenedCandidate:
    """A candidate fitted to a part of the recordings; `left` is the share of the gap there that it leaves."""

    left: float
    candidate: Candidate
    fit: Fit


def screen(
    view_set: ViewSet, found: Fit, forms: Sequence[Candidate], scales: Scales, reasons: dict[str, str] | None = None
) -> Iterator[tuple[str, float, list[FittedCandidate]]]:
    """Look for one more effect on top of a fit.

    Parameters
    ----------
    view_set : ViewSet
    found : Fit
    forms : sequence of Candidate
    scales : Scales
    reasons : dict of str to str, optional
        Gets the reason for each kind of which no form is fitted to everything.

    Yields
    ------
    what : str
        What is being done.
    share : float
        How much of it is done.
    found : list of FittedCandidate
        Best first; complete at the last step.
    """
    score_tests: dict[int, ScoreTest] = {}
    promises: list[Promise] = []
    for number, candidate in enumerate(forms):
        views = view_set.quick(candidate, found.model)
        if id(views) not in score_tests:
            score_tests[id(views)] = ScoreTest(views, found)
        score_test = score_tests[id(views)]
        starts = starting_points(candidate, score_test, view_set, scales)
        if starts and starts[0][0] > 0:
            share = starts[0][0] / max(score_test.total, 1e-300)
            promises.append(Promise(share, candidate, [effect for _, effect in starts]))
        yield "screening every effect", 0.35 * (number + 1) / len(forms), []
    small = sum(int(view.counts.sum()) for view in view_set.whole) < SMALL_RECORDING
    effort = THOROUGH if small else QUICK
    kept = _worth_a_fit(promises, effort)
    if reasons is not None:
        reasons |= _reasons_without_fit(forms, promises, kept)
    if not kept:
        yield "no effect passes the screening", 1.0, []
        return
    screened: list[ScreenedCandidate] = []
    for number, one in enumerate(kept):
        score_test = score_tests[id(view_set.quick(one.candidate, found.model))]
        screened.append(_best_first_fit(one, score_test, scales, effort))
        yield "fitting the best candidates", 0.35 + 0.35 * (number + 1) / len(kept), []
    last = _finalists(screened, effort)
    whole = score_tests.get(id(view_set.whole)) or ScoreTest(view_set.whole, found)
    if reasons is not None:
        reasons |= _reasons_after_first_fits(screened, last)
    results: list[FittedCandidate] = []
    for number, finalist in enumerate(last):
        results.append(_final_fit(finalist, view_set.whole, found, whole, scales, effort))
        results.sort(key=lambda result: result.mean)
        yield "testing the best on unseen trials", 0.7 + 0.3 * (number + 1) / len(last), results


def _worth_a_fit(promises: list[Promise], effort: Effort) -> list[Promise]:
    """Candidates worth a first fit: forms of the best kinds, the best form of others, and all that promise about as much."""
    promises = sorted(promises, key=lambda one: -one.share)
    most = len(promises) if effort.most_first_fits is None else effort.most_first_fits
    best_kinds = list(dict.fromkeys(one.candidate.name for one in promises))[:BEST_KINDS]
    kept: list[Promise] = []
    for i, one in enumerate(promises):
        is_best_form = all(other.candidate.name != one.candidate.name for other in promises[:i])
        group = "best kinds" if one.candidate.name in best_kinds else "best form" if is_best_form else "others"
        if one.share > LEAST_PROMISE[group] * promises[0].share and len(kept) < most:
            kept.append(one)
    return kept


def _reasons_without_fit(forms: Sequence[Candidate], promises: list[Promise], kept: list[Promise]) -> dict[str, str]:
    """For each kind of which no form is fitted, what it promised and what the most promising kind did."""
    best: dict[str, float] = {}
    for one in promises:
        best[one.candidate.name] = max(best.get(one.candidate.name, 0.0), one.share)
    first = max(best, key=lambda name: best[name], default="")
    fitted = {one.candidate.name for one in kept}
    return {
        name: f"screening estimate: removes {best[name]:.1%} of the squared error, {first} {best[first]:.1%}"
        if name in best
        else "screening estimate: removes nothing of the squared error"
        for name in dict.fromkeys(form.name for form in forms)
        if name not in fitted
    }


def _reasons_after_first_fits(screened: list[ScreenedCandidate], last: list[ScreenedCandidate]) -> dict[str, str]:
    """For each kind that was fitted to a part of the recordings only, what it left there and what the best kind did."""
    best: dict[str, float] = {}
    for one in screened:
        best[one.candidate.name] = min(best.get(one.candidate.name, np.inf), one.left)
    first = min(best, key=lambda name: best[name])
    finalists = {one.candidate.name for one in last}
    return {
        name: f"fitted to a part of the recordings it leaves {left:.0%} of the gap there, and {first} {best[first]:.0%}"
        for name, left in best.items()
        if name not in finalists
    }


def _best_first_fit(one: Promise, score_test: ScoreTest, scales: Scales, effort: Effort) -> ScreenedCandidate:
    """Fit a candidate from its best starting points."""
    starts = [score_test.model.with_effect(start) for start in one.starts[: effort.starts]]
    steps = effort.max_steps if effort.trial_steps is None or len(starts) == 1 else effort.trial_steps
    tries = [_first_fit(one.candidate, model, score_test, scales, steps) for model in starts]
    best = min(tries, key=lambda tried: tried.left)
    if steps == effort.max_steps:
        return best
    return _first_fit(one.candidate, best.fit.model, score_test, scales, effort.max_steps)


def _first_fit(candidate: Candidate, start: Model, score_test: ScoreTest, scales: Scales, max_steps: int) -> ScreenedCandidate:
    """Fit a candidate, the last effect of `start`, and the free parameters to the views of a score test."""
    best = fit(
        score_test.views,
        start,
        free_with(score_test.free, score_test.model, candidate, scales),
        max_steps=max_steps,
        tolerance=FIRST_FIT_TOLERANCE,
        frozen=len(score_test.free),
        with_equations=False,
        initial_derivatives=score_test.initial_derivatives,
    )
    count, square = float(best.count.sum()), float(best.sse.sum())
    return ScreenedCandidate(max(square - count, 0.0) / max(score_test.total - count, 0.01 * count), candidate, best)


def _finalists(screened: list[ScreenedCandidate], effort: Effort) -> list[ScreenedCandidate]:
    """The best form of each of the best kinds, and more forms of the best kind; none that leaves far more than the best."""
    screened = sorted(screened, key=lambda one: one.left)
    chosen: list[ScreenedCandidate] = []
    for one in screened:
        own = sum(1 for other in chosen if other.candidate.name == one.candidate.name)
        near = one.left < MOST_TIMES_THE_BEST * (screened[0].left + FLOOR_SHARE) or len(chosen) < 2
        if near and (own == 0 or (own < effort.forms and one.candidate.name == chosen[0].candidate.name)):
            chosen.append(one)
        if len({other.candidate.name for other in chosen}) >= effort.kinds and len(chosen) > effort.kinds:
            break
    return chosen[: effort.kinds + effort.forms - 1]


def _final_fit(
    one: ScreenedCandidate, whole: Sequence[TrialView], found: Fit, score_test: ScoreTest, scales: Scales, effort: Effort
) -> FittedCandidate:
    """Fit a candidate and the free parameters to everything, and judge it on stretches that the fit has not seen."""
    # Friction is far from linear, and its derivatives are cheap, so they are not frozen.
    frozen = next((i for i, item in enumerate(found.free) if item.name in FITTED_FRICTION_PARAMETERS), len(found.free))
    best = fit(
        whole,
        one.fit.model,
        free_with(found.free, found.model, one.candidate, scales),
        max_steps=effort.max_steps,
        tolerance=effort.tolerance,
        frozen=frozen,
        initial_derivatives=score_test.initial_derivatives,
    )
    return FittedCandidate(one.candidate, best, held_out_squares(whole, best))


def free_with(free: Sequence[FreeParameter], model: Model, candidate: Candidate, scales: Scales) -> tuple[FreeParameter, ...]:
    """Return free parameters of a model and those of a candidate on top of it."""
    if candidate.name in DIRECTLY_ESTIMATED:
        return tuple(free)
    return (*free, *candidate.free_parameters(len(model.effects), scales, abs(model.parameters.gain)))


# --- where a fit starts


def starting_points(
    candidate: Candidate, score_test: ScoreTest, view_set: ViewSet, scales: Scales
) -> list[tuple[float, Effect]]:
    """Return starting points of a candidate's fit, best first, each with the decrease of the squares that it promises.

    Parameters
    ----------
    candidate : Candidate
    score_test : ScoreTest
        Of the fit to which the candidate is added.
    view_set : ViewSet
        For direct estimates.
    scales : Scales
    """
    if candidate.kind.found_by == SILENT_TEXELS:
        effect = unresponsive_texels(view_set.whole, score_test.model, candidate, scales.texels)
        return [] if effect is None else [(score_test.score(score_test.model.with_effect(effect))[0], effect)]
    if candidate.kind.found_by == STEPS:
        return _quantization_starts(candidate, score_test, view_set)
    if candidate.has_texel_parameters:
        return _texel_parameter_starts(candidate, score_test, scales)
    if candidate.form.placement is not None:
        starts = [_displacement_start(candidate, score_test, scales), *_large_displacements(candidate, score_test, scales)]
        return sorted(starts, key=lambda entry: -entry[0])
    starts = _scaled_starts(candidate, score_test, scales)
    return _by_decrease(starts, score_test) if candidate.form.coupling is not None else starts


def _by_decrease(starts: list[tuple[float, Effect]], score_test: ScoreTest) -> list[tuple[float, Effect]]:
    """Starting points in the order of what they decrease as they are; promises stay in their own order."""
    effects = sorted((effect for _, effect in starts), key=lambda one: -score_test.decrease(score_test.model.with_effect(one)))
    return [(promise, effect) for (promise, _), effect in zip(starts, effects, strict=True)]


def _scaled_starts(candidate: Candidate, score_test: ScoreTest, scales: Scales) -> list[tuple[float, Effect]]:
    """Points of the search ranges, each scaled along the candidate's strength to the best length of its score test."""
    model, gain = score_test.model, abs(score_test.model.parameters.gain)
    strength, inverse, tried = candidate.strength_parameter(), candidate.inverse_strength_parameter(), []
    for values in candidate.starting_values(scales, gain):
        effect = candidate.effect(values, scales.texels, gain)
        promise, length = score_test.score(model.with_effect(effect))
        if strength is not None:
            parameter = next(q.scaled(gain) for q in candidate.form.parameters if q.name == strength)
            if parameter.low >= 0.0 and length <= 0.0:
                continue
            longer = values[strength] * np.clip(length, -LONGEST_STEP, LONGEST_STEP)
            scaled = float(np.clip(longer, parameter.low, parameter.high))
            other = candidate.effect({**values, strength: scaled}, scales.texels, gain)
            # How far loads spread is not linear in a width: near zero it does nothing. Take the one that fits better as it is.
            is_width = candidate.form.coupling is not None and parameter.unit == "m"
            near = (effect, other) if is_width else (other,)
            effect = near[0] if len(near) == 1 else max(near, key=lambda one: score_test.decrease(model.with_effect(one)))
        elif length <= 0.0:
            continue
        elif inverse is not None:
            parameter = next(q.scaled(gain) for q in candidate.form.parameters if q.name == inverse)
            nearer = values[inverse] / np.clip(length, SHORTEST_STEP, LONGEST_STEP)
            scaled = float(np.clip(nearer, parameter.low, parameter.high))
            other = candidate.effect({**values, inverse: scaled}, scales.texels, gain)
            # The score test is linear and the inverse strength is not: take the one that fits better as it is.
            effect = max((effect, other), key=lambda one: score_test.decrease(model.with_effect(one)))
        tried.append((promise, effect))
    return sorted(tried, key=lambda entry: -entry[0])


def _quantization_starts(candidate: Candidate, score_test: ScoreTest, view_set: ViewSet) -> list[tuple[float, Effect]]:
    """Steps that are estimated from the readings. If they are seen in the readings, they promise enough to be fitted."""
    model = score_test.model
    values = view_set.moving_readings(model)
    visible = few_levels(values) is not None
    least = VISIBLE_STEPS_PROMISE * score_test.total if visible else 0.0
    starts = quantization_starts(values, view_set.whole, candidate)
    decreases = [(score_test.decrease(model.with_effect(effect)), effect) for effect in starts]
    return [(max(decrease, least), effect) for decrease, effect in sorted(decreases, key=lambda entry: -entry[0])]


def _texel_parameter_starts(candidate: Candidate, score_test: ScoreTest, scales: Scales) -> list[tuple[float, Effect]]:
    """The neutral values, with the promise of a small step of each texel by a length of its own."""
    gain = abs(score_test.model.parameters.gain)
    parameter = next(q.scaled(gain) for q in candidate.form.parameters if q.per_texel)
    scale = scales.reading if parameter.unit == "unit" else 1.0
    step = float(parameter.default) + TEXEL_STEP * scale
    moved = candidate.effect({parameter.name: step}, scales.texels, gain)
    promise = score_test.score_of_texels(score_test.model.with_effect(moved))
    return [(promise, candidate.effect({}, scales.texels, gain))]


def _displacement_start(candidate: Candidate, score_test: ScoreTest, scales: Scales) -> tuple[float, Effect]:
    """The best small displacement of the texels: a joint score test of a small step of each parameter."""
    gain = abs(score_test.model.parameters.gain)
    parameters = candidate.form.parameters
    neutral = {name: 0.0 for name in candidate.form.neutral}
    steps = [SMALL_SHIFT * scales.pitch if q.unit == "m" else SMALL_TURN for q in parameters]
    models = [
        score_test.model.with_effect(candidate.effect({**neutral, q.name: step}, scales.texels, gain))
        for q, step in zip(parameters, steps, strict=True)
    ]
    promise, best = score_test.joint_score(models)
    limits = [LARGEST_SHIFT * scales.pitch if q.unit == "m" else LARGEST_TURN for q in parameters]
    lengths = [float(np.clip(b * s, -m, m)) for b, s, m in zip(best, steps, limits, strict=True)]
    values = {q.name: length for q, length in zip(parameters, lengths, strict=True)}
    return promise, candidate.effect(values, scales.texels, gain)


def _large_displacements(candidate: Candidate, score_test: ScoreTest, scales: Scales) -> list[tuple[float, Effect]]:
    """Shifts by a good part of the pitch, for indenters other than spheres.

    Under a flat indenter small shifts change nothing, and large ones add and remove texels.
    """
    gain = abs(score_test.model.parameters.gain)
    names = {q.name for q in candidate.form.parameters}
    first = score_test.views[0].predictor
    indenter = first.rig.indenter_of(first.trial)
    if not {"x", "y"} <= names or indenter is None or indenter.radius is not None:
        return []
    tried = []
    for step in LARGE_SHIFTS:
        for x, y in DIRECTIONS:
            values = {**dict.fromkeys(names, 0.0), "x": step * x * scales.pitch, "y": step * y * scales.pitch}
            effect = candidate.effect(values, scales.texels, gain)
            tried.append((score_test.decrease(score_test.model.with_effect(effect)), effect))
    return tried
