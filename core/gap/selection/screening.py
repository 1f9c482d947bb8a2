# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking for one effect more: a quick look at every form, a fit of those that promise something, a judgement on unseen trials.

The quick look asks how much of the residual lies along what the effect would change, beside what the numbers that are free
already can change (a score test). It and the first fits see a part of the texels, or of the samples where texels feel their
neighbours; the last ones see everything.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.engine.registry import form_of
from ...model.effect import Effect
from ..fitting.least_squares import (
    FRICTION_PARAMETERS,
    Fit,
    FreeParameter,
    TrialView,
    derivatives,
    fit,
    held_out_squares,
    value_of,
)
from ..forward.predictor import Model
from .candidates import DIRECTLY_ESTIMATED, Candidate, FittedCandidate, Scales
from .direct_estimates import few_levels, moving_readings, quantization_starts, unresponsive_texels
from .view_set import ViewSet

MOST_TIMES_THE_BEST = 3.0
"""A candidate that leaves so many times as much of the gap as the best, after a first fit, is not fitted to everything."""
SMALL_RECORDING = 20_000
"""Measured values up to which a recording is so quick to fit that candidates are begun from several places and more of them are
judged, in more of their forms: a quick look from one place loses those whose numbers bend most."""


def visible_parameters(views: Sequence[TrialView], found: Fit) -> tuple[FreeParameter, ...]:
    """Return the free numbers of a fit that act on what shares look at: without net forces, friction does not show."""
    if any(view.with_forces for view in views):
        return found.free

    def rubs(item: FreeParameter) -> bool:
        if item.effect < 0:
            return item.name in FRICTION_PARAMETERS
        effect = found.model.effects[item.effect]
        return form_of(effect.name, effect.form).friction_law is not None

    return tuple(item for item in found.free if not rubs(item))


class ScoreTest:
    """What the free numbers of a fit can already change about its residual, on one view."""

    def __init__(self, views: Sequence[TrialView], found: Fit):
        self.views, self.model, self.free = views, found.model, visible_parameters(views, found)
        common = tuple(item for item in self.free if not item.per_texel)
        at = [item.to_coordinate(value_of(found.model, item)) for item in common]
        self.residual = [view.residual(found.model) for view in views]
        self.tables = [np.empty((len(common), *r.shape)) for r in self.residual]
        for view, r, table in zip(views, self.residual, self.tables, strict=True):
            derivatives(view, found.model, common, at, r, table, 0)
        self.derivatives = [table.reshape(len(common), -1) for table in self.tables]
        gram = np.sum([c @ c.T for c in self.derivatives], axis=0)
        self.gram = gram + 1e-10 * (1.0 + np.trace(gram)) * np.eye(len(gram))
        self.along = sum(c @ r.ravel() for c, r in zip(self.derivatives, self.residual, strict=True))

    @property
    def initial_derivatives(self) -> list[np.ndarray] | None:
        """Derivatives with which a fit of these numbers and more may begin."""
        return None if any(item.per_texel for item in self.free) else self.tables

    @property
    def total(self) -> float:
        """Sum of squares of the residual."""
        return sum(float(np.vdot(r, r)) for r in self.residual)

    def score(self, model: Model) -> tuple[float, float]:
        """Return by how much the squares could fall along the change to another model, and the best length along it."""
        cross, square, dot = np.zeros(len(self.gram)), 0.0, 0.0
        for view, r, c in zip(self.views, self.residual, self.derivatives, strict=True):
            change = (r - view.residual(model)).ravel()
            cross += c @ change
            square += float(np.vdot(change, change))
            dot += float(np.vdot(change, r.ravel()))
        if not np.isfinite(square):
            return 0.0, 0.0
        weights = np.linalg.solve(self.gram, cross)
        free_square, free_dot = square - float(weights @ cross), dot - float(weights @ self.along)
        if free_square <= 1e-9 * square or free_square <= 0:
            return 0.0, 0.0
        return free_dot**2 / free_square, free_dot / free_square


def starting_points(
    candidate: Candidate, score_test: ScoreTest, whole: Sequence[TrialView], model: Model, scales: Scales, gain: float
) -> list[tuple[float, Effect]]:
    """Return places to begin the fit of a candidate, best first, each with what it promises."""
    n, form = scales.texels, candidate.form
    if candidate.name == "dead-texels":
        effect = unresponsive_texels(whole, model, candidate, n)
        return [] if effect is None else [(score_test.score(model.with_effect(effect))[0], effect)]
    if candidate.name == "quantization":
        least = (
            0.5 * score_test.total if few_levels(moving_readings(whole, model)) is not None else 0.0
        )  # they are seen to be there
        steps = [
            (_decrease(score_test, model.with_effect(effect)), effect)
            for effect in quantization_starts(whole, model, candidate)
        ]
        return [(max(fall, least), effect) for fall, effect in sorted(steps, key=lambda entry: -entry[0])]
    if candidate.has_texel_parameters:
        parameter = next(q.scaled(gain) for q in form.parameters if q.per_texel)
        moved = candidate.effect(
            {parameter.name: float(parameter.default) + 0.01 * _texel_parameter_scale(parameter, scales)}, n, gain
        )
        return [(_texel_parameter_score(score_test, model.with_effect(moved)), candidate.effect({}, n, gain))]
    if form.placement is not None:
        return sorted(
            [
                _displacement_score(candidate, score_test, model, scales, gain),
                *_large_displacements(candidate, score_test, model, scales, gain),
            ],
            key=lambda entry: -entry[0],
        )
    strength, reach, tried = candidate.strength_parameter(), candidate.inverse_strength_parameter(), []
    for values in candidate.starting_values(scales, gain):
        effect = candidate.effect(values, n, gain)
        promise, length = score_test.score(model.with_effect(effect))
        if strength is not None:
            parameter = next(q.scaled(gain) for q in form.parameters if q.name == strength)
            if parameter.low >= 0.0 and length <= 0.0:
                continue
            scaled = float(np.clip(values[strength] * np.clip(length, -20.0, 20.0), parameter.low, parameter.high))
            effect = candidate.effect({**values, strength: scaled}, n, gain)
        elif length <= 0.0:
            continue
        elif reach is not None:
            parameter = next(q.scaled(gain) for q in form.parameters if q.name == reach)
            far = float(np.clip(values[reach] / np.clip(length, 0.01, 20.0), parameter.low, parameter.high))
            effect = _better_start(score_test, effect, candidate.effect({**values, reach: far}, n, gain))
        tried.append((promise, effect))
    return sorted(tried, key=lambda entry: -entry[0])


def _better_start(score_test: ScoreTest, one: Effect, other: Effect) -> Effect:
    """The one of two that fits better as it is: far from the best length along it, an effect is a bad place to begin."""
    return max((one, other), key=lambda effect: _decrease(score_test, score_test.model.with_effect(effect)))


def _texel_parameter_scale(parameter, scales: Scales) -> float:  # type: ignore[no-untyped-def]
    return scales.reading if parameter.unit == "unit" else 1.0


def _texel_parameter_score(score_test: ScoreTest, model: Model) -> float:
    """What a number per texel promises, less what it would take from noise alone."""
    n = len(score_test.views[0].predictor.rig.texels)
    dot, square = np.zeros(n), np.zeros(n)
    for view, r in zip(score_test.views, score_test.residual, strict=True):
        change = (r - view.residual(model))[:, : len(view.texels)]
        dot[view.texels] += (change * r[:, : len(view.texels)]).sum(axis=0)
        square[view.texels] += (change * change).sum(axis=0)
    seen = square > 1e-12 * max(square.max(initial=0.0), 1e-300)
    return max(float((dot[seen] ** 2 / square[seen]).sum()) - seen.sum(), 0.0)


def _displacement_score(
    candidate: Candidate, score_test: ScoreTest, model: Model, scales: Scales, gain: float
) -> tuple[float, Effect]:
    """The same for a form that moves the texels: all its numbers at once, each by a small step from where texels should be."""
    off = {name: 0.0 for name in candidate.form.neutral}
    steps = [0.02 * scales.pitch if q.unit == "m" else 2e-3 for q in candidate.form.parameters]
    changes = []
    for q, step in zip(candidate.form.parameters, steps, strict=True):
        other = model.with_effect(candidate.effect({**off, q.name: step}, scales.texels, gain))
        changes.append([(r - s.residual(other)).ravel() for s, r in zip(score_test.views, score_test.residual, strict=True)])
    size = len(score_test.gram)
    gram, along = np.zeros((size + len(changes),) * 2), np.zeros(size + len(changes))
    for i, r in enumerate(score_test.residual):
        x = np.vstack([score_test.derivatives[i], *(c[i] for c in changes)])
        gram += x @ x.T
        along += x @ r.ravel()
    gram += 1e-10 * (1.0 + np.trace(gram)) * np.eye(len(gram))
    best = np.linalg.solve(gram, along)
    promise = float(along @ best) - float(score_test.along @ np.linalg.solve(score_test.gram, score_test.along))
    limits = [0.5 * scales.pitch if q.unit == "m" else 0.1 for q in candidate.form.parameters]
    lengths = [float(np.clip(b * s, -m, m)) for b, s, m in zip(best[size:], steps, limits, strict=True)]
    values = {q.name: length for q, length in zip(candidate.form.parameters, lengths, strict=True)}
    return promise, candidate.effect(values, scales.texels, gain)


def _large_displacements(
    candidate: Candidate, score_test: ScoreTest, model: Model, scales: Scales, gain: float
) -> list[tuple[float, Effect]]:
    """Shifts by a good part of the pitch: under a flat end small ones change nothing, larger ones add and take texels."""
    names = {q.name for q in candidate.form.parameters}
    if not {"x", "y"} <= names or score_test.views[0].predictor.rig.indenter is None:
        return []
    if score_test.views[0].predictor.rig.indenter.radius is not None:  # a ball tells small shifts
        return []
    tried = []
    for step in (0.3, 0.7):
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            values = {**dict.fromkeys(names, 0.0), "x": step * x * scales.pitch, "y": step * y * scales.pitch}
            effect = candidate.effect(values, scales.texels, gain)
            tried.append((_decrease(score_test, model.with_effect(effect)), effect))
    return tried


def _decrease(score_test: ScoreTest, model: Model) -> float:
    """By how much another model lowers the squares as it is."""
    before = sum(float(np.vdot(r, r)) for r in score_test.residual)
    after = sum(float(np.vdot(r, r)) for r in (view.residual(model) for view in score_test.views))
    return before - after


def free_with(free: Sequence[FreeParameter], model: Model, candidate: Candidate, scales: Scales) -> tuple[FreeParameter, ...]:
    """Return some free numbers of a model and those of one effect more on top of it."""
    if candidate.name in DIRECTLY_ESTIMATED:
        return tuple(free)
    return (*free, *candidate.free_parameters(len(model.effects), scales, abs(model.parameters.gain)))


def screen(
    view_set: ViewSet, found: Fit, forms: Sequence[Candidate], scales: Scales, finalists: int = 4
) -> Iterator[tuple[str, float, list[FittedCandidate]]]:
    """Look for one effect more on top of a fit.

    Yields
    ------
    what : str
        What is being done.
    share : float
        How much of it is done.
    found : list of FittedCandidate
        Best first; complete at the last step.
    """
    gain = abs(found.model.parameters.gain)
    score_tests: dict[int, ScoreTest] = {}
    promising: list[tuple[float, Candidate, list[tuple[float, Effect]]]] = []
    for number, candidate in enumerate(forms):
        views = view_set.quick(candidate, found.model)
        if id(views) not in score_tests:
            score_tests[id(views)] = ScoreTest(views, found)
        score_test = score_tests[id(views)]
        starts = starting_points(candidate, score_test, view_set.whole, found.model, scales, gain)
        if starts and starts[0][0] > 0:
            promising.append((starts[0][0] / max(score_test.total, 1e-300), candidate, starts))
        yield "looking at every effect", 0.35 * (number + 1) / len(forms), []
    little = sum(int(view.counts.sum()) for view in view_set.whole) < SMALL_RECORDING
    kept = _worth_a_fit(promising, len(promising)) if little else _worth_a_fit(promising)
    turns, tolerance = (40, 1e-6) if little else (14, 1e-4)
    if not kept:
        yield "nothing promises anything", 1.0, []
        return
    quick: list[ScreenedCandidate] = []
    for number, (_, candidate, starts) in enumerate(kept):
        score_test = score_tests[id(view_set.quick(candidate, found.model))]
        tries = [_first_fit(candidate, start, score_test, scales, turns) for _, start in starts[: 4 if little else 1]]
        quick.append(min(tries, key=lambda one: one.left))
        yield "fitting those that promise most", 0.35 + 0.35 * (number + 1) / len(kept), []
    last, whole = _finalists(quick, *(2 * finalists, 4) if little else (finalists, 2)), ScoreTest(view_set.whole, found)
    results: list[FittedCandidate] = []
    for number, one in enumerate(last):
        free = free_with(found.free, found.model, one.candidate, scales)
        # Friction is far from linear, and cheap: its derivatives are not held.
        held = next((i for i, item in enumerate(found.free) if item.name in FRICTION_PARAMETERS), len(found.free))
        best = fit(
            view_set.whole,
            one.fit.model,
            free,
            max_steps=turns,
            tolerance=tolerance,
            frozen=held,
            initial_derivatives=whole.initial_derivatives,
        )
        results.append(FittedCandidate(one.candidate, best, held_out_squares(view_set.whole, best)))
        results.sort(key=lambda one: one.mean)
        yield "judging the best on trials they have not seen", 0.7 + 0.3 * (number + 1) / len(last), results


def _worth_a_fit(
    promising: list[tuple[float, Candidate, list[tuple[float, Effect]]]], most: int = 14
) -> list[tuple[float, Candidate, list[tuple[float, Effect]]]]:
    """Those worth a fit after the quick look: forms of the best kinds, the best form of others, all that are near the best."""
    promising = sorted(promising, key=lambda entry: -entry[0])
    best_kinds = list(dict.fromkeys(candidate.name for _, candidate, _ in promising))[:3]
    kept: list[tuple[float, Candidate, list[tuple[float, Effect]]]] = []
    for i, entry in enumerate(promising):
        leads = all(other[1].name != entry[1].name for other in promising[:i])
        least = 0.02 if entry[1].name in best_kinds else 0.05 if leads else 0.4
        if entry[0] > least * promising[0][0] and len(kept) < most:
            kept.append(entry)
    return kept


@dataclass(frozen=True)
class ScreenedCandidate:
    """A candidate fitted to a part of the recordings; `left` is the share of the gap there that it leaves."""

    left: float
    candidate: Candidate
    fit: Fit


def _first_fit(candidate: Candidate, start: Effect, score_test: ScoreTest, scales: Scales, turns: int) -> ScreenedCandidate:
    model, free = score_test.model, free_with(score_test.free, score_test.model, candidate, scales)
    held = len(score_test.free)
    best = fit(
        score_test.views,
        model.with_effect(start),
        free,
        max_steps=turns,
        tolerance=1e-3,
        frozen=held,
        with_equations=False,
        initial_derivatives=score_test.initial_derivatives,
    )
    count, square = float(best.count.sum()), float(best.sse.sum())
    return ScreenedCandidate(max(square - count, 0.0) / max(score_test.total - count, 0.01 * count), candidate, best)


def _finalists(quick: list[ScreenedCandidate], count: int, forms: int) -> list[ScreenedCandidate]:
    """The best form of each of the best kinds, and some more forms of the best kind; none that is far behind."""
    quick = sorted(quick, key=lambda one: one.left)
    chosen: list[ScreenedCandidate] = []
    for entry in quick:
        own = sum(1 for other in chosen if other.candidate.name == entry.candidate.name)
        near = entry.left < MOST_TIMES_THE_BEST * (quick[0].left + 0.04) or len(chosen) < 2
        if near and (own == 0 or (own < forms and entry.candidate.name == chosen[0].candidate.name)):
            chosen.append(entry)
        if len({other.candidate.name for other in chosen}) >= count and len(chosen) > count:
            break
    return chosen[: count + forms - 1]
