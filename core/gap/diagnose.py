# SPDX-License-Identifier: GPL-3.0-or-later
"""What is missing: one effect after the other joins the model as long as it earns its place, and those that could as well be it
are said.

All judgements are made on stretches of the recordings that a fit has not seen, in units of the noise's variance. With M₀ the
mean square of the base model and F that of the noise, ``M₀ - F`` is the gap; an effect closes a share of it. How large a share
is large enough, and how near a rival must come to be one, are the constants below; they were set on simulated sensors whose
hidden effects follow other formulas than the library's.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..effects.library import kind_of
from .admissible import admissible
from .candidates import NEVER, Candidate, Scales, candidates, scales_of
from .fit import FRICTION, Fit, Free, base_numbers, fit, held_out
from .model import Model, Predictor
from .noise import Coverage, Noise, coverage, force_noise, reading_noise
from .rig import Rig
from .search import Found, Views, search, views_of
from .structure import Structure, structure_of
from .telling import confounded, untold
from .tremble import trembling

FIRST, NEXT, NEXT_OF_ALL = 0.25, 0.45, 0.03
"""Least share of the gap that the first effect closes; of what is left that a further one closes; and of the whole gap."""
LEAST = 0.02
"""Least decrease of the mean square on unseen trials, in units of the noise's variance."""
EXPLAINED = 0.6
"""Share of the gap that must be closed for the verdict "explained"."""
STRUCTURE = 0.03
"""Share of a residual that can be predicted, below which it is noise."""
RIVAL = 1.35
"""A rival is one that leaves at most so many times as much of the gap as the best does."""
SMALL = 0.1
"""One of several that closes a smaller share of the whole gap may be what the others' formulas lack: it is no sure name."""
MOST = 3
"""Most effects that are looked for."""


@dataclass(frozen=True)
class Named:
    """An effect that was found.

    Attributes
    ----------
    effect : int
        Index in the model's stack.
    name, form : str
    confidence : float
    rivals : tuple of str
        Kinds that explain as much.
    next_best : str
        The kind that came nearest to it, "" where none did, and
    leaves : float
        how many times as much of the gap that one leaves.
    """

    effect: int
    name: str
    form: str
    confidence: float
    rivals: tuple[str, ...]
    next_best: str = ""
    leaves: float = np.inf


@dataclass
class Diagnosis:
    """All that was found out about a rig."""

    rig: Rig
    predictors: list[Predictor]
    noise: tuple[Noise, Noise]
    full: tuple[float, float]
    coverage: Coverage
    scales: Scales
    base: Fit
    best: Fit
    base_structure: Structure
    structure: Structure
    verdict: str = "no gap"
    named: list[Named] = field(default_factory=list)
    ambiguous: list[tuple[str, ...]] = field(default_factory=list)
    ruled_out: list[tuple[str, str]] = field(default_factory=list)
    step: float = 0.0

    def of(self, use: str) -> list[Predictor]:
        """Return the predictors of the trials of one use."""
        return [p for p in self.predictors if p.trial.use == use]


@dataclass(frozen=True)
class Progress:
    """How far a diagnosis has come: `done` of `total`, and what it does."""

    stage: str
    done: int
    total: int


def free_base(rig: Rig, predictors: Sequence[Predictor]) -> list[str]:
    """Return which of the base model's own numbers these recordings tell.

    Of depth and pose the readings tell only gain times stiffness: in newtons, or where the rig gives the gain, that is `k`.
    """
    read = any(p.trial.reading is not None for p in predictors)
    pressed = any(p.trial.stimulus != "force" for p in predictors)
    loaded = any(p.trial.stimulus == "force" for p in predictors)
    dragged = any(p.trial.force is not None and p.stimulus.slide.any() for p in predictors)
    felt = any(p.trial.force is not None for p in predictors)
    own_unit = rig.parameters.unit != "N"
    names: list[str] = []
    if pressed:
        names += ["k", "cn"] if rig.parameters.normal_law == "linear" else ["k"]
        if own_unit and read and "gain" not in rig.given and not felt:
            names.remove("k")
            names.append("gain")
        elif own_unit and read and (felt or loaded):
            names.append("gain")
    if loaded and read and "gain" not in names:
        names.append("gain")
    if own_unit and read:
        names.append("zero")
    if dragged:
        names += FRICTION
    return names


def begin(rig: Rig) -> tuple[list[Predictor], tuple[Noise, Noise], tuple[float, float]]:
    """Compute what the texels meet in each trial, and measure noise and range."""
    predictors = [Predictor(trial, rig) for trial in rig.trials]
    readings = [p.trial.reading for p in predictors if p.trial.reading is not None]
    forces = [p.trial.force for p in predictors if p.trial.force is not None]
    full = _range(readings), _range(forces)
    noise = reading_noise(predictors, full[0]), force_noise(predictors, full[1])
    return predictors, noise, full


def _range(arrays: Sequence[np.ndarray]) -> float:
    """Range of what was measured, all trials and channels together; 1 where nothing was."""
    if not arrays:
        return 1.0
    high, low = max(float(np.nanmax(a)) for a in arrays), min(float(np.nanmin(a)) for a in arrays)
    return max(high - low, 1e-12)


def start_model(rig: Rig, predictors: Sequence[Predictor]) -> Model:
    """Return the rig's own parameters; gain and zero that it leaves open are guessed from the readings."""
    p = rig.parameters
    if p.unit == "N" or "gain" in rig.given:
        return Model(p)
    base = Model(replace(p, gain=1.0, zero=0.0))
    x, y = [], []
    for predictor in predictors:
        if predictor.trial.reading is not None:
            good = np.isfinite(predictor.trial.reading)
            x.append(predictor.predict(base).reading[good])
            y.append(predictor.trial.reading[good])
    if not x:
        return Model(p)
    gain, zero = np.polyfit(np.concatenate(x), np.concatenate(y), 1)
    if not np.isfinite(gain) or gain == 0:
        gain = 1.0
    return Model(replace(p, gain=float(gain), zero=p.zero if "zero" in rig.given else float(zero)))


def diagnose(rig: Rig) -> Iterator[Progress | Diagnosis]:
    """Find out what the base model misses in a rig.

    Yields
    ------
    Progress
        While it works; closing the generator stops it.
    Diagnosis
        At last.
    """
    total = 1000
    yield Progress("contacts of every trial", 0, total)
    predictors, noise, full = begin(rig)
    fitted = [p for p in predictors if p.trial.use == "fit"]
    views = views_of(fitted, (noise[0].deviation, noise[1].deviation))
    yield Progress("base model", 40, total)
    start = start_model(rig, fitted)
    base = fit(views.whole, start, base_numbers(start.parameters, free_base(rig, fitted), full[0]), turns=40, tolerance=1e-7)
    before = _structure(views, base)
    scales = scales_of(fitted, base.model)
    result = Diagnosis(rig, predictors, noise, full, coverage(fitted), scales, base, base, before, before)
    for progress in _explain(result, views):
        yield Progress(progress[0], 60 + int(940 * progress[1]), total)
    yield result


def _structure(views: Views, found: Fit) -> Structure:
    width = len(views.whole[0].predictor.rig.texels)
    residuals = [share.residual(found.model) for share in views.whole]
    if not any(share.predictor.trial.reading is not None for share in views.whole):  # forces alone: three channels for texels
        return _force_structure(views, residuals)
    return structure_of([share.predictor for share in views.whole], [r[:, :width] for r in residuals])


def _force_structure(views: Views, residuals: list[np.ndarray]) -> Structure:
    """The same where only the net force was measured: its largest component stands for all texels."""
    width = len(views.whole[0].predictor.rig.texels)
    total = np.sum([(r[:, width:] ** 2).sum(axis=0) for r in residuals], axis=0)
    axis = width + int(np.argmax(total))
    return structure_of([s.predictor for s in views.whole], [np.tile(r[:, axis : axis + 1], (1, width)) for r in residuals])


def _explain(result: Diagnosis, views: Views) -> Iterator[tuple[str, float]]:
    """Add effects to the base model while they earn their place; write everything into `result`."""
    current, structure = result.base, result.base_structure
    unseen = held_out(views.whole, current)
    mean0 = float(unseen.sum() / current.count.sum())
    floor = min(1.0, mean0)
    steps: list[list[Found]] = []
    mixed = confounded(result.coverage)
    floors, gains = [mean0 * (1.0 - structure.total)], {}
    for turn in range(MOST):
        mean = float(unseen.sum() / current.count.sum())
        enough = max(LEAST, NEXT_OF_ALL * (mean0 - floor))  # of less, no effect could close as much as it has to
        if turn > 0 and (mean - floor < enough or (structure.total < STRUCTURE and mean < 1.5)):
            break
        taken = {effect.name for effect in current.model.effects}
        forms = [c for c in candidates([s.predictor for s in views.whole], current.model) if c.name not in taken]
        forms = [c for c in forms if not _is_free_already(c, current.free) and (turn == 0 or c.name not in mixed)]
        ranked: list[Found] = []
        for what, share, found in search(views, current, forms, result.scales):
            yield what, (turn + share) / MOST
            ranked = found or ranked
        ranked = [one for one in ranked if admissible(one, views)]
        steps.append(ranked)
        if not ranked:
            break
        best = _simplest([one for one in ranked if one.candidate.name not in mixed] or ranked, floor)
        if not _earns(best, unseen, mean, mean0, floor, first=turn == 0):
            break
        gains[best.candidate.name] = mean - best.mean
        current, unseen = best.fit, best.unseen
        structure = _structure(views, current)
        floors.append(best.mean * (1.0 - structure.total))
    alone = steps[0] if steps else []
    if len(current.model.effects) >= 2:
        current, unseen, steps = yield from _reconsider(result, views, current, unseen, steps, floor, gains)
    result.best, result.structure = current, _structure(views, current)
    floor = float(np.clip(min(floors), 0.8, 1.0))
    if result.structure.total < STRUCTURE:
        noise = trembling(views.whole, current.model)
        if noise is not None:  # then all that is left is noise
            result.best = replace(current, model=current.model.with_effect(noise))
            floor = max(floor, float(unseen.sum() / current.count.sum()))
    small = {name for name, gain in gains.items() if gain < SMALL * (mean0 - floor)}
    _conclude(result, steps, small, mean0, float(unseen.sum() / current.count.sum()), floor)
    _rule_out(result, alone, mean0, floor)


def _is_free_already(candidate: Candidate, free: Sequence[Free]) -> bool:
    """A common offset is the sensor's `zero` where that is fitted."""
    return candidate.label == "offset/common" and any(item.effect < 0 and item.name == "zero" for item in free)


def _left(one: Found, floor: float, gap: float) -> float:
    """What a candidate leaves of the gap, with a little for what no fit can tell."""
    return max(one.mean - floor, 0.0) + 0.004 * gap + 0.01


def _simplest(ranked: Sequence[Found], floor: float) -> Found:
    """The best, or one with far fewer numbers that leaves hardly more."""
    gap = max(one.mean for one in ranked) - floor
    least = _left(ranked[0], floor, gap)
    near = [one for one in ranked if _left(one, floor, gap) < 1.15 * least and one.numbers < 0.5 * ranked[0].numbers]
    listed = [one for one in ranked if one.candidate.name == "dead-texels" and _left(one, floor, gap) < 1.5 * least]
    if ranked[0].candidate.local and listed:
        return listed[0]
    return near[0] if near else ranked[0]


def _earns(one: Found, unseen: np.ndarray, mean: float, mean0: float, floor: float, first: bool) -> bool:
    """Whether a candidate closes enough of the gap, in most stretches of the recordings."""
    gained = mean - one.mean
    gap, left = max(mean0 - floor, 1e-12), max(mean - floor, 1e-12)
    better = float(np.mean(one.unseen < unseen))
    if gained < LEAST or better < 0.6:
        return False
    if first:
        return gained >= FIRST * gap
    return gained >= NEXT * left and gained >= NEXT_OF_ALL * gap


def _reconsider(
    result: Diagnosis,
    views: Views,
    current: Fit,
    unseen: np.ndarray,
    steps: list[list[Found]],
    floor: float,
    gains: dict[str, float],
) -> Generator[tuple[str, float], None, tuple[Fit, np.ndarray, list[list[Found]]]]:
    """The first effect was chosen without the others: look whether another does better beside them."""
    mean = float(unseen.sum() / current.count.sum())
    first = current.model.effects[0]
    rest = tuple(
        replace(item, effect=item.effect - 1) if item.effect > 0 else item for item in current.free if item.effect != 0
    )
    other = fit(views.whole, current.model.without(0), rest, turns=6, tolerance=1e-4)
    taken = {effect.name for effect in other.model.effects}
    forms = [c for c in candidates([s.predictor for s in views.whole], other.model) if c.name not in taken]
    forms = [c for c in forms if not _is_free_already(c, other.free)]
    ranked: list[Found] = []
    for what, share, found in search(views, other, forms, result.scales):
        yield what, 0.9 + 0.1 * share
        ranked = found or ranked
    ranked = [one for one in ranked if admissible(one, views)]
    steps = [*steps]
    if ranked:
        best = _simplest(ranked, floor)
        alone = float(held_out(views.whole, other).sum() / other.count.sum())
        gains[best.candidate.name] = alone - best.mean
        if alone - best.mean < max(LEAST, 0.3 * max(alone - floor, 0.0)):  # what came later does it all
            return other, held_out(views.whole, other), steps[1:]
        if best.mean < mean - 0.02 * max(mean - floor, 0.0) - 1e-6 or best.candidate.name == first.name:
            order = [ranked, *steps[1 : len(other.model.effects) + 1]]
            return _last_first(best.fit), best.unseen, order
    return current, unseen, steps


def _last_first(found: Fit) -> Fit:
    """The same fit with the effect that joined last at the head of the stack, where it was in the order of finding."""
    last = len(found.model.effects) - 1
    effects = (found.model.effects[last], *found.model.effects[:last])
    free = tuple(
        item if item.effect < 0 else replace(item, effect=0 if item.effect == last else item.effect + 1) for item in found.free
    )
    return replace(found, model=Model(found.model.parameters, effects), free=free)


def _conclude(result: Diagnosis, steps: list[list[Found]], small: set[str], mean0: float, mean: float, floor: float) -> None:
    """Write verdict, names and rivals; those that close little beside others are `small`."""
    gap = mean0 - floor
    effects = result.best.model.effects
    structured = result.base_structure.total
    fitted = [effect for effect in effects if effect.name != "noise"]
    if effects and not fitted:
        result.verdict = "explained"
    elif not effects:
        noise_only = structured < STRUCTURE and (mean0 < 2.0 or gap < LEAST)
        result.verdict = "no gap" if noise_only else "unexplained"
    else:
        closed = (mean0 - mean) / max(gap, 1e-12)
        result.verdict = "explained" if closed >= EXPLAINED else "unexplained"
    for index, effect in enumerate(effects):
        ranked = next((s for s in steps if any(one.candidate.name == effect.name for one in s)), [])
        own = [one for one in ranked if one.candidate.name == effect.name]
        rivals: tuple[str, ...] = ()
        others: dict[str, float] = {}
        weight = 1.0
        if own:
            least = _left(own[0], floor, gap)
            for one in ranked:
                if one.candidate.name != effect.name and one.candidate.name not in {e.name for e in effects}:
                    ratio = _left(one, floor, gap) / least
                    if not (own[0].candidate.name == "dead-texels" and one.candidate.local):
                        others[one.candidate.name] = min(ratio, others.get(one.candidate.name, np.inf))
            rivals = tuple(name for name, ratio in others.items() if ratio < RIVAL)
            weight = 1.0 / (1.0 + sum(ratio**-3.0 for ratio in others.values()))
        share = float(np.clip((mean0 - mean) / max(gap, 1e-12), 0.0, 1.0)) if fitted else 1.0
        confidence = weight * (0.5 + 0.5 * share) if result.verdict == "explained" else 0.5 * weight * share
        if rivals or (effect.name in small and len(fitted) > 1):
            confidence = min(confidence, 0.45)
        if rivals:
            result.ambiguous.append((effect.name, *rivals))
        nearest = min(others, key=lambda name: others[name], default="")
        result.named.append(
            Named(index, effect.name, effect.form, round(confidence, 3), rivals, nearest, others.get(nearest, np.inf))
        )


def _rule_out(result: Diagnosis, alone: list[Found], mean0: float, floor: float) -> None:
    """Say of each kind why it was not named; `alone` are those that were fitted on top of the base model."""
    gap = max(mean0 - floor, 1e-12)
    tried: dict[str, float] = {}
    for one in alone:
        tried[one.candidate.name] = max(tried.get(one.candidate.name, -1.0), (mean0 - one.mean) / gap)
    named = {name for pair in result.ambiguous for name in pair} | {n.name for n in result.named}
    looked = {c.name for c in candidates(result.of("fit"), result.base.model)}
    from ..effects.library import library

    for kind in library().values():
        if kind.name in named:
            continue
        if kind.name in NEVER:
            why = "what is left does not tremble the more, the larger the reading"
        elif kind.name not in looked:
            why = untold(result.coverage).get(kind.name, "these recordings cannot show it")
        elif kind.name in tried and result.verdict != "no gap":
            why = f"alone it closes {max(tried[kind.name], 0.0):.0%} of the squared gap on unseen trials"
        elif result.verdict == "no gap":
            why = "nothing is left for it to explain"
        else:
            why = "a first look promised far less than what was fitted"
        result.ruled_out.append((kind_of(kind.name).name, why))
