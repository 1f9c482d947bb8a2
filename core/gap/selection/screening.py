# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking for one effect more: a quick look at every form, a fit of those that promise something, a judgement on unseen trials.

The quick look asks how much of the residual lies along what the effect would change, beside what the numbers that are free
already can change (a score test). It and the first fits see a part of the texels, or of the samples where texels feel their
neighbours; the last ones see everything.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...effects.engine.registry import form_of
from ...model.effect import Effect
from ..fitting.least_squares import FRICTION, Fit, Free, Share, derivatives, fit, held_out, value_of
from ..forward.predictor import Model, Predictor
from .candidates import READ_OFF, Candidate, Scales, is_spatial
from .direct_estimates import dead, few_levels, moving_readings, stepped

FEW_TEXELS = 16
"""Per trial, in the quick look."""
BEHIND = 3.0
"""A candidate that leaves so many times as much of the gap as the best, after a first fit, is not fitted to everything."""
LITTLE = 20_000
"""Measured values up to which a recording is so quick to fit that candidates are begun from several places and more of them are
judged, in more of their forms: a quick look from one place loses those whose numbers bend most."""
THIN = 4
"""Of so many samples one is looked at where texels feel their neighbours."""


@dataclass
class Views:
    """The trials as the stages of the search look at them.

    Attributes
    ----------
    whole : list of Share
    narrow : list of Share
        Few texels, all samples, without net forces where there are readings: for what a texel feels by itself.
    rubbed : list of Share
        The same with net forces: for friction.
    thin : list of Share
        All texels, few samples: for what texels feel of each other, and for where they are.
    """

    whole: list[Share]
    narrow: list[Share]
    rubbed: list[Share]
    thin: list[Share]

    def quick(self, candidate: Candidate, model: Model) -> list[Share]:
        """Return the view for a quick look at a candidate on top of a model."""
        if candidate.name in READ_OFF:
            return self.whole
        forms = [candidate.form, *(form_of(e.name, e.form) for e in model.effects)]
        rubs = candidate.form.friction_law is not None
        if any(is_spatial(form) or form.placement is not None for form in forms):
            return self.whole if rubs else self.thin  # bristles need every sample, and friction shows in net forces alone
        return self.rubbed if rubs else self.narrow


def views_of(predictors: Sequence[Predictor], noise: tuple[float, float]) -> Views:
    """Prepare the views of some trials."""
    whole = [Share(p, noise=noise, parts=2) for p in predictors]
    rubbed = [Share(p, _few(p), noise=noise) for p in predictors]
    read = all(p.trial.reading is not None for p in predictors)
    narrow = [replace(share, forces=not read) for share in rubbed]
    thin = []
    for p in predictors:
        every = slice(None, None, THIN if len(p.trial.time) >= 60 * THIN else 1)
        t = p.trial
        parts: dict[str, Any] = {
            name: None if getattr(t, name) is None else getattr(t, name)[every]
            for name in ("time", "position", "quaternion", "level", "slide", "reading", "force")
        }
        thin.append(Share(Predictor(replace(t, **parts), p.rig), noise=noise, forces=not read))
    return Views(whole, narrow, rubbed, thin)


def _few(predictor: Predictor) -> np.ndarray | None:
    """Texels for the quick look: some of each degree of load, and two that carry nothing."""
    n = len(predictor.rig.texels)
    if n <= FEW_TEXELS:
        return None
    s = predictor.stimulus
    load = s.pressed_by.sum(axis=0)
    order = np.argsort(load)[::-1]
    loaded = order[load[order] > 0]
    idle = order[load[order] <= 0]
    picked = loaded[np.unique(np.linspace(0, len(loaded) - 1, min(len(loaded), FEW_TEXELS - 2)).astype(int))]
    rest = idle[np.linspace(0, len(idle) - 1, min(len(idle), FEW_TEXELS - len(picked))).astype(int)]
    return np.sort(np.concatenate([picked, rest]))


@dataclass
class Found:
    """A candidate fitted on top of a model.

    Attributes
    ----------
    candidate : Candidate
    fit : Fit
    unseen : (trials, 2) float
        Squares of each trial, of readings and of forces, as predicted by a fit that has not seen it, in units of the noise.
    """

    candidate: Candidate
    fit: Fit
    unseen: np.ndarray

    @property
    def mean(self) -> float:
        """Mean square on unseen trials."""
        return float(self.unseen.sum() / self.fit.count.sum())

    @property
    def numbers(self) -> int:
        """How many numbers it takes."""
        n = len(self.fit.model.effects)
        values = self.fit.model.effects[n - 1].values
        return sum(len(v) if isinstance(v, tuple) else 1 for v in values.values())


def visible(shares: Sequence[Share], found: Fit) -> tuple[Free, ...]:
    """Return the free numbers of a fit that act on what shares look at: without net forces, friction does not show."""
    if any(share.forces for share in shares):
        return found.free

    def rubs(item: Free) -> bool:
        if item.effect < 0:
            return item.name in FRICTION
        effect = found.model.effects[item.effect]
        return form_of(effect.name, effect.form).friction_law is not None

    return tuple(item for item in found.free if not rubs(item))


class Direction:
    """What the free numbers of a fit can already change about its residual, on one view."""

    def __init__(self, shares: Sequence[Share], found: Fit):
        self.shares, self.model, self.free = shares, found.model, visible(shares, found)
        common = tuple(item for item in self.free if not item.per_texel)
        at = [item.to(value_of(found.model, item)) for item in common]
        self.residual = [share.residual(found.model) for share in shares]
        self.tables = [np.empty((len(common), *r.shape)) for r in self.residual]
        for share, r, table in zip(shares, self.residual, self.tables, strict=True):
            derivatives(share, found.model, common, at, r, table, 0)
        self.columns = [table.reshape(len(common), -1) for table in self.tables]
        gram = np.sum([c @ c.T for c in self.columns], axis=0)
        self.gram = gram + 1e-10 * (1.0 + np.trace(gram)) * np.eye(len(gram))
        self.along = sum(c @ r.ravel() for c, r in zip(self.columns, self.residual, strict=True))

    @property
    def begun(self) -> list[np.ndarray] | None:
        """Derivatives with which a fit of these numbers and more may begin."""
        return None if any(item.per_texel for item in self.free) else self.tables

    @property
    def total(self) -> float:
        """Sum of squares of the residual."""
        return sum(float(np.vdot(r, r)) for r in self.residual)

    def score(self, model: Model) -> tuple[float, float]:
        """Return by how much the squares could fall along the change to another model, and the best length along it."""
        cross, square, dot = np.zeros(len(self.gram)), 0.0, 0.0
        for share, r, c in zip(self.shares, self.residual, self.columns, strict=True):
            change = (r - share.residual(model)).ravel()
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


def promising(
    candidate: Candidate, direction: Direction, whole: Sequence[Share], model: Model, scales: Scales, gain: float
) -> list[tuple[float, Effect]]:
    """Return places to begin the fit of a candidate, best first, each with what it promises."""
    n, form = scales.texels, candidate.form
    if candidate.name == "dead-texels":
        effect = dead(whole, model, candidate, n)
        return [] if effect is None else [(direction.score(model.with_effect(effect))[0], effect)]
    if candidate.name == "quantization":
        least = (
            0.5 * direction.total if few_levels(moving_readings(whole, model)) is not None else 0.0
        )  # they are seen to be there
        steps = [(_fall(direction, model.with_effect(effect)), effect) for effect in stepped(whole, model, candidate)]
        return [(max(fall, least), effect) for fall, effect in sorted(steps, key=lambda entry: -entry[0])]
    if candidate.local:
        parameter = next(q.scaled(gain) for q in form.parameters if q.per_texel)
        moved = candidate.effect({parameter.name: float(parameter.default) + 0.01 * _local_size(parameter, scales)}, n, gain)
        return [(_texel_score(direction, model.with_effect(moved)), candidate.effect({}, n, gain))]
    if form.placement is not None:
        return sorted(
            [_placed_score(candidate, direction, model, scales, gain), *_placed_far(candidate, direction, model, scales, gain)],
            key=lambda entry: -entry[0],
        )
    strength, reach, tried = candidate.strength(), candidate.reach(), []
    for values in candidate.starts(scales, gain):
        effect = candidate.effect(values, n, gain)
        promise, length = direction.score(model.with_effect(effect))
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
            effect = _better(direction, effect, candidate.effect({**values, reach: far}, n, gain))
        tried.append((promise, effect))
    return sorted(tried, key=lambda entry: -entry[0])


def _better(direction: Direction, one: Effect, other: Effect) -> Effect:
    """The one of two that fits better as it is: far from the best length along it, an effect is a bad place to begin."""
    return max((one, other), key=lambda effect: _fall(direction, direction.model.with_effect(effect)))


def _local_size(parameter, scales: Scales) -> float:  # type: ignore[no-untyped-def]
    return scales.reading if parameter.unit == "unit" else 1.0


def _texel_score(direction: Direction, model: Model) -> float:
    """What a number per texel promises, less what it would take from noise alone."""
    n = len(direction.shares[0].predictor.rig.texels)
    dot, square = np.zeros(n), np.zeros(n)
    for share, r in zip(direction.shares, direction.residual, strict=True):
        change = (r - share.residual(model))[:, : len(share.texels)]
        dot[share.texels] += (change * r[:, : len(share.texels)]).sum(axis=0)
        square[share.texels] += (change * change).sum(axis=0)
    seen = square > 1e-12 * max(square.max(initial=0.0), 1e-300)
    return max(float((dot[seen] ** 2 / square[seen]).sum()) - seen.sum(), 0.0)


def _placed_score(
    candidate: Candidate, direction: Direction, model: Model, scales: Scales, gain: float
) -> tuple[float, Effect]:
    """The same for a form that moves the texels: all its numbers at once, each by a small step from where texels should be."""
    off = {name: 0.0 for name in candidate.form.neutral}
    steps = [0.02 * scales.pitch if q.unit == "m" else 2e-3 for q in candidate.form.parameters]
    changes = []
    for q, step in zip(candidate.form.parameters, steps, strict=True):
        other = model.with_effect(candidate.effect({**off, q.name: step}, scales.texels, gain))
        changes.append([(r - s.residual(other)).ravel() for s, r in zip(direction.shares, direction.residual, strict=True)])
    size = len(direction.gram)
    gram, along = np.zeros((size + len(changes),) * 2), np.zeros(size + len(changes))
    for i, r in enumerate(direction.residual):
        x = np.vstack([direction.columns[i], *(c[i] for c in changes)])
        gram += x @ x.T
        along += x @ r.ravel()
    gram += 1e-10 * (1.0 + np.trace(gram)) * np.eye(len(gram))
    best = np.linalg.solve(gram, along)
    promise = float(along @ best) - float(direction.along @ np.linalg.solve(direction.gram, direction.along))
    limits = [0.5 * scales.pitch if q.unit == "m" else 0.1 for q in candidate.form.parameters]
    lengths = [float(np.clip(b * s, -m, m)) for b, s, m in zip(best[size:], steps, limits, strict=True)]
    values = {q.name: length for q, length in zip(candidate.form.parameters, lengths, strict=True)}
    return promise, candidate.effect(values, scales.texels, gain)


def _placed_far(
    candidate: Candidate, direction: Direction, model: Model, scales: Scales, gain: float
) -> list[tuple[float, Effect]]:
    """Shifts by a good part of the pitch: under a flat end small ones change nothing, larger ones add and take texels."""
    names = {q.name for q in candidate.form.parameters}
    if not {"x", "y"} <= names or direction.shares[0].predictor.rig.indenter is None:
        return []
    if direction.shares[0].predictor.rig.indenter.radius is not None:  # a ball tells small shifts
        return []
    tried = []
    for step in (0.3, 0.7):
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            values = {**dict.fromkeys(names, 0.0), "x": step * x * scales.pitch, "y": step * y * scales.pitch}
            effect = candidate.effect(values, scales.texels, gain)
            tried.append((_fall(direction, model.with_effect(effect)), effect))
    return tried


def _fall(direction: Direction, model: Model) -> float:
    """By how much another model lowers the squares as it is."""
    before = sum(float(np.vdot(r, r)) for r in direction.residual)
    after = sum(float(np.vdot(r, r)) for r in (share.residual(model) for share in direction.shares))
    return before - after


def free_of(free: Sequence[Free], model: Model, candidate: Candidate, scales: Scales) -> tuple[Free, ...]:
    """Return some free numbers of a model and those of one effect more on top of it."""
    if candidate.name in READ_OFF:
        return tuple(free)
    return (*free, *candidate.free(len(model.effects), scales, abs(model.parameters.gain)))


def search(
    views: Views, found: Fit, forms: Sequence[Candidate], scales: Scales, finalists: int = 4
) -> Iterator[tuple[str, float, list[Found]]]:
    """Look for one effect more on top of a fit.

    Yields
    ------
    what : str
        What is being done.
    share : float
        How much of it is done.
    found : list of Found
        Best first; complete at the last step.
    """
    gain = abs(found.model.parameters.gain)
    directions: dict[int, Direction] = {}
    begun: list[tuple[float, Candidate, list[tuple[float, Effect]]]] = []
    for number, candidate in enumerate(forms):
        shares = views.quick(candidate, found.model)
        if id(shares) not in directions:
            directions[id(shares)] = Direction(shares, found)
        direction = directions[id(shares)]
        starts = promising(candidate, direction, views.whole, found.model, scales, gain)
        if starts and starts[0][0] > 0:
            begun.append((starts[0][0] / max(direction.total, 1e-300), candidate, starts))
        yield "looking at every effect", 0.35 * (number + 1) / len(forms), []
    little = sum(int(share.counts.sum()) for share in views.whole) < LITTLE
    kept = _kept(begun, len(begun)) if little else _kept(begun)
    turns, tolerance = (40, 1e-6) if little else (14, 1e-4)
    if not kept:
        yield "nothing promises anything", 1.0, []
        return
    quick: list[Quick] = []
    for number, (_, candidate, starts) in enumerate(kept):
        direction = directions[id(views.quick(candidate, found.model))]
        tries = [_quick(candidate, start, direction, scales, turns) for _, start in starts[: 4 if little else 1]]
        quick.append(min(tries, key=lambda one: one.left))
        yield "fitting those that promise most", 0.35 + 0.35 * (number + 1) / len(kept), []
    last, whole = _finalists(quick, *(2 * finalists, 4) if little else (finalists, 2)), Direction(views.whole, found)
    results: list[Found] = []
    for number, one in enumerate(last):
        free = free_of(found.free, found.model, one.candidate, scales)
        # Friction is far from linear, and cheap: its derivatives are not held.
        held = next((i for i, item in enumerate(found.free) if item.name in FRICTION), len(found.free))
        best = fit(views.whole, one.fit.model, free, turns=turns, tolerance=tolerance, held=held, begun=whole.begun)
        results.append(Found(one.candidate, best, held_out(views.whole, best)))
        results.sort(key=lambda one: one.mean)
        yield "judging the best on trials they have not seen", 0.7 + 0.3 * (number + 1) / len(last), results


def _kept(
    begun: list[tuple[float, Candidate, list[tuple[float, Effect]]]], most: int = 14
) -> list[tuple[float, Candidate, list[tuple[float, Effect]]]]:
    """Those worth a fit after the quick look: forms of the best kinds, the best form of others, all that are near the best."""
    begun = sorted(begun, key=lambda entry: -entry[0])
    best_kinds = list(dict.fromkeys(candidate.name for _, candidate, _ in begun))[:3]
    kept: list[tuple[float, Candidate, list[tuple[float, Effect]]]] = []
    for i, entry in enumerate(begun):
        leads = all(other[1].name != entry[1].name for other in begun[:i])
        least = 0.02 if entry[1].name in best_kinds else 0.05 if leads else 0.4
        if entry[0] > least * begun[0][0] and len(kept) < most:
            kept.append(entry)
    return kept


@dataclass(frozen=True)
class Quick:
    """A candidate fitted to a part of the recordings; `left` is the share of the gap there that it leaves."""

    left: float
    candidate: Candidate
    fit: Fit


def _quick(candidate: Candidate, start: Effect, direction: Direction, scales: Scales, turns: int) -> Quick:
    model, free = direction.model, free_of(direction.free, direction.model, candidate, scales)
    held = len(direction.free)
    best = fit(
        direction.shares,
        model.with_effect(start),
        free,
        turns=turns,
        tolerance=1e-3,
        held=held,
        judged=False,
        begun=direction.begun,
    )
    count, square = float(best.count.sum()), float(best.sse.sum())
    return Quick(max(square - count, 0.0) / max(direction.total - count, 0.01 * count), candidate, best)


def _finalists(quick: list[Quick], count: int, forms: int) -> list[Quick]:
    """The best form of each of the best kinds, and some more forms of the best kind; none that is far behind."""
    quick = sorted(quick, key=lambda one: one.left)
    chosen: list[Quick] = []
    for entry in quick:
        own = sum(1 for other in chosen if other.candidate.name == entry.candidate.name)
        near = entry.left < BEHIND * (quick[0].left + 0.04) or len(chosen) < 2
        if near and (own == 0 or (own < forms and entry.candidate.name == chosen[0].candidate.name)):
            chosen.append(entry)
        if len({other.candidate.name for other in chosen}) >= count and len(chosen) > count:
            break
    return chosen[: count + forms - 1]
