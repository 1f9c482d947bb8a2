# SPDX-License-Identifier: GPL-3.0-or-later
"""Search for sets of effects: all alone, pairs on top of the best kinds, triples on top of the best pairs, then exchanges.

An exchange replaces one effect by every kind, on top of the model that was fitted again without it.

Two assumptions about how recordings differ are candidates like any effect: a factor and a zero of each (which costs a name),
and one session in their order (what the sensor remembers goes on, which costs none).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...jobs import Job, Progress, Result, part_of_job
from .noise_level import measured_noise, noise_level
from .pairs import best_pairs
from .rule_numbers import DRAWS, LEAST_WEIGHT
from .score import ONE_SESSION, Hypothesis, Score, drawn_weights
from .screening import Screening

BEAMS = {1: 3, 2: 2}
"""Models on top of which a further effect is looked for, by their number of names: for speed."""
MOST_EFFECTS = 3
ALL_FORMS = 2
"""Kinds of which all forms are fitted to everything: the best and its nearest rival, each judged by its whole library."""
LEAST_REMEMBERED = 1e-6
"""Change of a prediction, in deviations of the noise, that is more than rounding."""
TOTAL_WORK = 1000
ALONE, DIFFERENCES, FURTHER_EFFECTS, EXCHANGES, PREDICTION = 60, 330, 500, 770, 860
"""Work that is done when each stage of the search begins, and all work of a diagnosis."""

Start = Callable[[], tuple[Screening, Hypothesis]]
"""Prepares recordings under an assumption and fits the base model to them."""


@dataclass
class Search:
    """The search for missing effects in one rig, with all models fitted so far.

    Attributes
    ----------
    starts : dict of str to callable
        By what is assumed of how recordings differ, "" first.
    repeat_error : float or None
        Standard error of noise that repeats measured, so that no model says more of it; None without repeats.
    has_few_values : bool
        True if readings repeat a few values.
    tried : list of Hypothesis
    score : Score
    """

    starts: dict[str, Start]
    repeat_error: float | None = None
    has_few_values: bool = False
    tried: list[Hypothesis] = field(default_factory=list)
    _done: dict[tuple[str, ...], set[str]] = field(default_factory=dict)
    _at_end: set[Hypothesis] = field(default_factory=set)
    _made: dict[str, tuple[Screening, Hypothesis]] = field(default_factory=dict)

    def run(self) -> Job[Hypothesis]:
        """Return the model that the rule chooses."""
        plain, self.base = self.under("")
        self.library = Counter(one.name for one in plain.candidates(self.base.fit.model))
        self._weigh(is_noise_measured=True)
        self.base = self._reweighted(plain, self.base)
        self._made[""] = plain, self.base
        self.tried.append(self.base)
        self._weigh(is_noise_measured=True)
        if not self.is_open(self.base):
            return self.base
        yield from _in_stage(ALONE, self._grow(self.base))
        yield from _in_stage(ALONE, self._all_forms(self.base, _by_kind({one.forms[-1]: one for one in self.tried[1:]})))
        self._weigh(is_noise_measured=True)
        self.refined(self.best())
        self._weigh(is_noise_measured=True)
        if self.is_open(self.best()):
            yield from _in_stage(DIFFERENCES, self._assume_differences())
            self.tried += yield from _in_stage(DIFFERENCES, best_pairs(self._screening(self.base), self.base))
        for size in range(1, MOST_EFFECTS):
            self._weigh()
            if not self.is_open(self.best()):
                break
            yield from _in_stage(FURTHER_EFFECTS, self._extend(size))
        self._weigh()
        yield from _in_stage(EXCHANGES, self._reconsider())
        return self.best()

    def is_open(self, one: Hypothesis) -> bool:
        """Return whether a model leaves a gap, and one effect more could raise its score."""
        return self.score.leaves_gap(one) and self.score.most_to_gain(one) > 0.0

    def best(self) -> Hypothesis:
        """Return the smallest model within one standard error of the best.

        Of those with as many names, one with far fewer numbers, or with none at a bound, is taken if it does as well. If it
        leaves a gap, it gives way to one that leaves nothing beyond the noise, whatever its formulas might leave elsewhere.
        """
        top = max(self.tried, key=self.score.value)
        near = [one for one in self.tried if one is top or self.score.is_near(top, one)]
        near = [one for one in near if one.price_count == min(one.price_count for one in near)]
        best = max(near, key=self.score.value)
        simpler = [one for one in near if self.score.is_near(best, one) and self.score.is_simpler(one, best)]
        best = max(simpler, key=self.score.value) if simpler else best
        exact = [one for one in self.tried if one.price_count == best.price_count and self.score.reaches_noise(one)]
        return max(exact, key=self.score.value) if exact and self.score.leaves_gap(best) else best

    def predicting(self, named: Hypothesis) -> Job[Hypothesis]:
        """Return the model that predicts best of all that hold the effects of the chosen one, while it leaves a gap.

        An added effect need not pay for a name, only have the least weight. The amended model predicts better, and the report
        calls the name a guess.
        """
        best, least_lead = named, float(np.log(LEAST_WEIGHT / (1.0 - LEAST_WEIGHT)))
        while self.score.leaves_gap(best) and best.components and len(best.names) < MOST_EFFECTS:
            most_left = self.score.most_left(best, self.score.value(best) + least_lead)
            self.tried += yield from _in_stage(PREDICTION, self._screening(best).with_one_more(best, most_left=most_left))
            longer = [one for one in self.tried if _holds(one, best) and self.score.weight(one, best) > LEAST_WEIGHT]
            top = max(longer, key=self.score.prediction, default=best)
            if not self.score.predicts_better(top, best):
                break
            best = top
        return best

    def under(self, assumed: str) -> tuple[Screening, Hypothesis]:
        """Return the screening under an assumption, and the base model with it."""
        if assumed not in self._made:
            screening, base = self.starts[assumed]()
            self._made[assumed] = screening, self._reweighted(screening, base) if assumed else base
        return self._made[assumed]

    def _screening(self, one: Hypothesis) -> Screening:
        """Screening whose fits have the weight of forces with which a model's score rises most."""
        return self.under(one.assumed)[0].weighted(self.score.force_weight(one))

    def _reweighted(self, screening: Screening, base: Hypothesis) -> Hypothesis:
        """The base model at the weight of forces that its own score gives; each fit raises the score, to its resolution."""
        while (weight := self.score.force_weight(base)) != 1.0:
            better = screening.weighted(weight).refined(base)
            if self.score.value(better) <= self.score.value(base) + self.score.resolution:
                break
            base = better
        return base

    def in_place_of(self, one: Hypothesis, index: int) -> Job[tuple[Hypothesis, dict[str, list[Hypothesis]]]]:
        """Replace an effect by every kind; return the refitted model without it, and the best fit of each form in its place.

        Fits are by kind, the model's own included.
        """
        key = (*sorted(form for i, form in enumerate(one.forms) if i != index), one.assumed)
        known = [other for other in [*self.tried, self.under(one.assumed)[1]] if other.key == key]
        parent = max(known, key=self.score.value) if known else self._screening(one).without(one, index)
        if not known:
            self.tried.append(parent)
        yield from self._grow(parent)
        yield from self._all_forms(parent, self._in_place(one, index, parent))
        return parent, self._in_place(one, index, parent)

    def _in_place(self, one: Hypothesis, index: int, parent: Hypothesis) -> dict[str, list[Hypothesis]]:
        """The best fit of each form that replaces an effect, by kind."""
        best = {one.forms[index]: one}
        for other in [other for other in self.tried if other.names and other.key != one.key]:
            if (*sorted(other.forms[:-1]), other.assumed) == parent.key:
                is_near = self.score.weight(other, one) * max(self.library[one.names[index]], 1) > LEAST_WEIGHT
                other = self.refined(other) if is_near else other  # a kind counts by the mean over its library
                best[other.forms[-1]] = max(best.get(other.forms[-1], other), other, key=self.score.value)
        return _by_kind(best)

    def _all_forms(self, parent: Hypothesis, found: dict[str, list[Hypothesis]]) -> Job[None]:
        """Fit all forms of the best kinds on top of a model, so that a kind is judged by its whole library."""
        best, done = {name: max(map(self.score.value, forms)) for name, forms in found.items()}, self._done[parent.key]
        for name in sorted(best, key=lambda name: -best[name])[:ALL_FORMS]:
            if name not in done:
                made = yield from self._screening(parent).other_forms(parent, name, done, self._most_left(parent))
                self._note(parent, made, name)

    # --- stages

    def _assume_differences(self) -> Job[None]:
        """Try recordings that remember each other, and numbers of their own."""
        for assumed in self.starts:
            if not assumed:
                continue
            yield Progress("how recordings differ", 0, 1)
            screening, base = self.under(assumed)
            if assumed == ONE_SESSION:
                yield from self._try_session(screening, base)
            else:
                self.tried.append(base)

    def _try_session(self, screening: Screening, base: Hypothesis) -> Job[None]:
        """Kinds that explain no more in a session than in recordings that begin untouched are left out of it."""
        kinds, screening = self._remembering(screening), self._screening(base)
        made = yield from screening.with_one_more(base, kinds)
        for one in [*map(screening.refined, made[:1]), *made[1:]]:
            alone = [other for other in self.tried if other.names == one.names and not other.assumed]
            leads = [self.score.lead(one, other) for other in alone]
            if all(apart > error for apart, error in leads):
                self._note(base, [one])

    def _remembering(self, screening: Screening) -> set[str]:
        """Kinds whose effects go on from recording to recording: they predict something else in a session."""
        base, plain = self.base.fit.model, self.under("")[0]
        kinds = {one.name for one in screening.candidates(base)} - set(self.library)
        for effect in screening.alone.values():
            alone, joined = (
                [view.residual(base.with_effect(effect)) for view in one.views.fitted] for one in (plain, screening)
            )
            if any(np.abs(a - b).max() > LEAST_REMEMBERED for a, b in zip(alone, joined, strict=True)):
                kinds.add(effect.name)
        return kinds

    def _extend(self, size: int) -> Job[None]:
        """Try one effect more on top of the best models of a size that could still become the best."""
        for parent in self._beam(size):
            if self._could_lead(parent):
                parent = self.refined(parent)
                self._weigh()
                if self._could_lead(parent):
                    yield from self._grow(parent)

    def _could_lead(self, parent: Hypothesis) -> bool:
        """Return whether one effect more could make a model the best."""
        lacks = self.score.value(self.best()) - self.score.value(parent)
        return self.score.most_to_gain(parent) > max(0.0, lacks)

    def refined(self, one: Hypothesis) -> Hypothesis:
        """Return a model with effects at the end of its fit, and put it in its place."""
        if not one.names or one in self._at_end:
            return one
        better = self._screening(one).refined(one)
        self.tried[:] = [better if other is one else other for other in self.tried]
        self._at_end.add(better)
        return better

    def _beam(self, size: int) -> list[Hypothesis]:
        """The best models of a number of names, of different kinds."""
        chosen: dict[object, Hypothesis] = {}
        for one in sorted(self.tried, key=self.score.value, reverse=True):
            if one.price_count == size:
                chosen.setdefault((frozenset(one.names), one.assumed), one)
        return list(chosen.values())[: BEAMS[size]]

    def _reconsider(self) -> Job[None]:
        """Replace each effect of the best model by every kind, until no replacement improves the model."""
        best = None
        while best is not self.best():
            best = self.refined(self.best())
            for index in range(len(best.names)):
                yield from self.in_place_of(best, index)
            self._weigh()

    def _grow(self, parent: Hypothesis) -> Job[None]:
        """Add one effect to a model."""
        if parent.key not in self._done:
            made = yield from self._screening(parent).with_one_more(parent, most_left=self._most_left(parent))
            self._note(parent, made)

    def _note(self, parent: Hypothesis, made: list[Hypothesis], *names: str) -> None:
        """Record models with one effect more than another, and the kinds whose forms have all been tried on top of it."""
        self.tried += made
        self._done.setdefault(parent.key, set()).update(names, (one.forms[-1] for one in made))

    def _most_left(self, parent: Hypothesis) -> float:
        """Share of the parent's gap that one effect more may leave if it is to matter.

        It must pay for its name, and come as near to the best model as a name costs. Alone each may leave everything: forms
        show the error of formulas.
        """
        if not parent.names:
            return 1.0
        least = max(self.score.value(parent), self.score.value(self.best()) - self.score.price)
        return self.score.most_left(parent, least)

    def _weights(self) -> np.ndarray:
        """Weights of the blocks of fitted recordings under each draw; check recordings have none, so they choose no effect."""
        blocks = self.under("")[0].blocks
        is_fitted = blocks.recording < len(blocks.views.fitted)
        weights = np.zeros((DRAWS + 1, len(is_fitted)))
        weights[:, is_fitted] = drawn_weights(int(is_fitted.sum()))
        return weights

    def _weigh(self, is_noise_measured: bool = False) -> None:
        """Set the score, with the noise estimated from all models so far, or with the noise measured before any fit."""
        count = self.base.sums.count
        if self.repeat_error is not None:
            noise = measured_noise(count, self.repeat_error)
        else:
            noise = measured_noise(count) if is_noise_measured else noise_level([one.sums for one in self.tried])
        price = float(np.log(max(len(self.library) + len(self.starts) - 1, 1)))
        self.score = Score(noise, count.sum(axis=0) > 0, price, self._weights(), has_few_values=self.has_few_values)
        self.score.measure_formula_errors(self.base, [one for one in self.tried if len(one.names) == one.price_count == 1])


def _by_kind(best: dict[str, Hypothesis]) -> dict[str, list[Hypothesis]]:
    """Models by the kind of the form that they are for."""
    found: dict[str, list[Hypothesis]] = {}
    for label, one in best.items():
        found.setdefault(label.split("/")[0], []).append(one)
    return found


def _holds(one: Hypothesis, best: Hypothesis) -> bool:
    """True if a model has the kinds of another, and at most one more."""
    return one.assumed == best.assumed and set(one.names) >= set(best.names) and len(one.names) <= len(best.names) + 1


def _in_stage(done: int, work: Job[Result]) -> Job[Result]:
    """A stage of the search, with the progress of the whole diagnosis."""
    return part_of_job(work, lambda one: Progress(one.stage, done, TOTAL_WORK))
