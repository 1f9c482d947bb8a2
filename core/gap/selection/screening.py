# SPDX-License-Identifier: GPL-3.0-or-later
"""Screening: which effects are worth a fit on top of a model, and these fits.

Every form of every kind gets the promise of a score test at the model's residual. The forms that promise most are fitted to a
part of the data (see :mod:`.view_set`), and the best of these to all of it: linearised promises alone mislead for large
effects.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

from ...effects.engine.specification import SILENT_TEXELS, STEPS, scalar
from ...jobs import Job, Progress
from ...model.sensor import Effect
from ...model.sensor_parameters import FITTED_FRICTION_PARAMETERS
from ..candidates.candidates import (
    START_COUNT,
    Candidate,
    Scales,
    candidates,
    is_free_already,
)
from ..candidates.direct_estimates import of_silent_texels
from ..candidates.plausibility import is_plausible
from ..candidates.rao_score import ScoreTest
from ..candidates.starting_points import is_large_shift, starting_points
from ..candidates.view_set import ViewSet
from ..fitting.force_scale import at_measured_forces
from ..fitting.least_squares import Fit, FreeParameter, TrialView, fit
from ..forward.predictor import Model
from .blocks import Blocks, Views
from .rule_numbers import FIT_TOLERANCE
from .score import OWN_NUMBERS, Hypothesis

LATER_STARTS = 1
"""Points of the search ranges that are tried on top of an effect, in pairs, or in addition to the form's values alone: for
speed. With three of them the hidden pairs rank no better."""
FIRST_STEPS, FIRST_TOLERANCE = 10, 1e-3
"""Of the fits to a part of the data. With 6 steps and 3e-3 they take a quarter less processor time, and rivals are left out
before they are fitted to everything: in three of 74 rigs crosstalk was sure where load spreading explains as much."""
FINAL_STEPS, FINAL_TOLERANCE = 10, 3e-4
"""Of the fits to everything."""
REFINED_STEPS = 40
"""Of the fits of the best models: those on top of which a further effect is looked for, and rivals."""
TRIED_KINDS = 5
"""Kinds that are fitted to a part of the data on top of an effect, and to everything at most: for speed. In 28 development
rigs 89 of 92 effects that were missing from a model belonged to the five kinds that promise most."""
TRIED_FORMS = 2
"""Forms of a kind that are fitted alone to a part of the data: for speed. On 82 development rigs one of the two forms that
promise most left least for 350 of 371 kinds; for hidden kinds among the others it left at most 0.02 of the gap more."""


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
    is_seen : bool
        True if the readings show it, whatever it leaves in a part of them: it is fitted to everything, before all others.
    """

    share: float
    candidate: Candidate
    starts: list[Effect]
    is_seen: bool


@dataclass(frozen=True)
class FirstFit:
    """A candidate fitted to a part of the recordings.

    Attributes
    ----------
    left : float
        Share that it leaves of the parent's gap there.
    rank : float
        The same share of the squares there after one linear step of the initial parameters. The candidate that leaves least
        comes first: parts differ between kinds, and on the pressed texels alone the base model may fit better.
    promise : Promise
    fit : Fit
    """

    left: float
    rank: float
    promise: Promise
    fit: Fit

    @property
    def candidate(self) -> Candidate:
        """The candidate that was fitted."""
        return self.promise.candidate

    def may_leave(self, most_left: float) -> bool:
        """Return whether a fit to everything is worth while: it leaves little enough, or the readings show it."""
        return self.promise.is_seen or self.left <= most_left


@dataclass
class Screening:
    """Fits of one more effect on top of models.

    Attributes
    ----------
    view_set : ViewSet
        Of the fitted recordings, for tests and first fits.
    blocks : Blocks
    views : Views
        Recordings as they are assumed to differ.
    scales : Scales
    assumed : str
        What is assumed of that (see :attr:`.score.Hypothesis.assumed`).
    alone : dict of str to Effect
        What each form was fitted to alone, by its label, in recordings that do not differ.
    """

    view_set: ViewSet
    blocks: Blocks
    views: Views
    scales: Scales
    assumed: str
    alone: dict[str, Effect]

    def weighted(self, weight: float) -> Screening:
        """Return the same screening with another weight of forces in its fits to everything."""
        if weight == self.views.fitted[0].force_weight:
            return self
        return replace(self, views=self.views.weighted(weight))

    def hypothesis(self, found: Fit) -> Hypothesis:
        """Return a fitted model with what it leaves."""
        return Hypothesis(found, self.blocks.sums(found, self.views, self.assumed == OWN_NUMBERS), self.assumed)

    def candidates(self, model: Model) -> list[Candidate]:
        """Return the candidates that could show in the fitted recordings."""
        return candidates([view.predictor for view in self.view_set.whole], model)

    def with_one_more(self, parent: Hypothesis, kinds: set[str] | None = None, most_left: float = 1.0) -> Job[list[Hypothesis]]:
        """Return the parent with one effect more, for the kinds that promise most, in one form of each.

        It is a form that is free to follow any law, or that those do not follow, if the kind has one that promises anything, so
        that kinds compete at equal freedom. Alone, the two forms that promise most are compared, of these or of all if there is
        none.

        Parameters
        ----------
        parent : Hypothesis
        kinds : set of str, optional
            Only these.
        most_left : float
            Share of the parent's gap that a fit to a part of the data may leave at most, for one to everything to follow.
        """
        is_first = not (parent.names or self.assumed)  # an assumption about recordings is like an effect
        tests = _Tests(self.view_set, parent.fit)
        by_kind: dict[str, list[Candidate]] = {}
        for candidate in self._candidates_beside(parent):
            by_kind.setdefault(candidate.name, []).append(candidate)
        screened = []
        for name, forms in by_kind.items():
            if kinds is None or name in kinds:
                yield Progress("screening every effect", 0, 1)
                wide = [one for one in forms if one.form.is_wide]
                screened.append(self._promises(parent, tests, wide) or self._promises(parent, tests, forms))
        screened = sorted((own for own in screened if own), key=lambda own: (not own[0].is_seen, -own[0].share))
        first_fits = []
        for own in screened[: None if is_first else TRIED_KINDS]:
            for one in own[: TRIED_FORMS if is_first else 1]:
                yield Progress(f"fitting {one.candidate.name}", 0, 1)
                first_fits.append(self._first_fit(one, tests))
        best_fits: dict[str, FirstFit] = {}
        kept = [one for one in first_fits if one.may_leave(most_left)]
        for fitted in sorted(kept, key=lambda one: (not one.promise.is_seen, one.rank)):
            best_fits.setdefault(fitted.candidate.name, fitted)
            if is_first:
                self.alone.setdefault(fitted.candidate.label, fitted.fit.model.effects[-1])
        return (yield from self._final_fits(list(best_fits.values())[:TRIED_KINDS], parent))

    def other_forms(
        self, parent: Hypothesis, name: str, done: Collection[str], most_left: float = 1.0
    ) -> Job[list[Hypothesis]]:
        """Return the parent with the forms of a kind that were not fitted yet, so that it is judged by its whole library.

        Forms that leave more than `most_left` of the gap in a part of the data are left out, as in :meth:`with_one_more`.
        """
        tests = _Tests(self.view_set, parent.fit)
        own = [one for one in self._candidates_beside(parent) if one.name == name and one.label not in done]
        fitted = [self._first_fit(one, tests) for one in self._promises(parent, tests, own)]
        return (yield from self._final_fits([one for one in fitted if one.may_leave(most_left)], parent))

    def without(self, one: Hypothesis, index: int) -> Hypothesis:
        """Return a model without one of its effects, fitted again."""
        free = [item for item in one.fit.free if item.effect != index]
        free = [replace(item, effect=item.effect - 1) if item.effect > index else item for item in free]
        return self.hypothesis(fit(self.views.fitted, one.fit.model.without(index), free, max_steps=8, tolerance=1e-4))

    def refined(self, one: Hypothesis) -> Hypothesis:
        """Return a model at the end of its fit: final fits are cut short, as most models are far behind the best."""
        before = sum(float(view.squares(view.residual(one.fit.model)).sum()) for view in self.views.fitted)
        found = fit(self.views.fitted, one.fit.model, one.fit.free, max_steps=REFINED_STEPS, tolerance=FIT_TOLERANCE)
        return one if found.sse.sum() >= before else self.hypothesis(found)

    def final_fit(self, found: Model, free: Sequence[FreeParameter], frozen: int) -> Fit:
        """Fit a model to everything; the first `frozen` derivatives are kept (see :func:`.least_squares.fit`)."""
        found = at_measured_forces(found, free, self.views.fitted)
        frozen = next((i for i, item in enumerate(free) if item.name in FITTED_FRICTION_PARAMETERS), frozen)
        return fit(
            self.views.fitted, found, free, max_steps=FINAL_STEPS, tolerance=FINAL_TOLERANCE, frozen=min(frozen, len(free))
        )

    def shows_signature(self, candidate: Candidate, found: Fit) -> bool:
        """Return whether the recordings hold what the library asks of an effect, the last one of a fit."""
        return is_plausible(candidate, found, self.views.fitted)

    def _candidates_beside(self, parent: Hypothesis) -> list[Candidate]:
        """Candidates of the kinds that a model does not have."""
        every = self.candidates(parent.fit.model)
        return [one for one in every if one.name not in parent.names and not is_free_already(one, parent.fit.free)]

    def _promises(self, parent: Hypothesis, tests: _Tests, own: Iterable[Candidate]) -> list[Promise]:
        """What forms could explain on top of a model, with starting points; by promise, those with numbers of texels last."""
        promises = []
        for one in own:
            test = tests.of(one)
            known = self._known(one, abs(parent.fit.model.parameters.gain))
            count = LATER_STARTS if parent.names or known else START_COUNT
            starts = starting_points(one, test, self.view_set, self.scales, count)
            starts += [(test.score(effect)[0], effect) for effect in known]
            starts.sort(key=lambda entry: -entry[0])
            is_seen = one.kind.found_by == STEPS and self.view_set.repeats_few_values(parent.fit.model)
            if starts and (is_seen or starts[0][0] > 0):
                share = starts[0][0] / max(test.total, 1e-300)
                promises.append(Promise(share, one, [effect for _, effect in starts], is_seen))
        return sorted(promises, key=lambda one: (one.candidate.has_texel_parameters, -one.share))

    def _known(self, one: Candidate, gain: float) -> list[Effect]:
        """The effect that a form was fitted to alone; for a displacement with fewer parameters, from one with more."""
        if one.label in self.alone:
            return [self.alone[one.label]]
        if one.form.placement is None:
            return []
        names = [parameter.name for parameter in one.form.parameters]
        fuller = [e.values for e in self.alone.values() if e.name == one.name and set(names) <= set(e.values)]
        return [one.effect({name: scalar(values, name) for name in names}, self.scales.texels, gain) for values in fuller]

    def _first_fit(self, one: Promise, tests: _Tests) -> FirstFit:
        """A candidate fitted to a part of the data, from the starting point that lowers the squares most as it is."""
        test = tests.of(one.candidate)
        effect = max(one.starts, key=test.decrease)
        is_far = is_large_shift(effect, self.scales)  # texels meet another part of the indenter then
        found = fit(
            test.views,
            test.model.with_effect(effect),
            free_with(test.free, test.model, one.candidate, effect, self.scales),
            max_steps=FIRST_STEPS,
            tolerance=FIRST_TOLERANCE,
            frozen=0 if is_far else len(test.free),
            with_equations=False,
            initial_derivatives=None if is_far else test.initial_derivatives,
        )
        left, rank = (share_left(found, before) for before in (test.total, test.least))
        return FirstFit(left, rank, one, found)

    def _final_fits(self, first_fits: Iterable[FirstFit], parent: Hypothesis) -> Job[list[Hypothesis]]:
        """Candidates fitted to all fitted recordings, and read on unseen blocks, but for those without their signature."""
        made = []
        for one in first_fits:
            yield Progress(f"fitting {one.candidate.name} to everything", 0, 1)
            free = free_with(parent.fit.free, parent.fit.model, one.candidate, one.fit.model.effects[-1], self.scales)
            found = self.final_fit(one.fit.model, free, len(parent.fit.free))
            if self.shows_signature(one.candidate, found):
                made.append(self.hypothesis(found))
        return made


class _Tests:
    """Score tests of one fit, on the views that candidates need."""

    def __init__(self, view_set: ViewSet, found: Fit):
        self.view_set, self.found = view_set, found
        self._made: dict[int, ScoreTest] = {}

    def of(self, candidate: Candidate) -> ScoreTest:
        """Return the test on the smallest view in which a candidate can be tested."""
        views: list[TrialView] = self.view_set.quick(candidate, self.found.model)
        if id(views) not in self._made:
            self._made[id(views)] = ScoreTest(views, self.found)
        return self._made[id(views)]


def free_with(
    free: Sequence[FreeParameter], model: Model, candidate: Candidate, effect: Effect, scales: Scales
) -> tuple[FreeParameter, ...]:
    """Return free parameters of a model and those of a candidate on top of it, with which the fit starts at `effect`."""
    if candidate.kind.found_by == STEPS:
        return tuple(free)
    own = candidate.free_parameters(len(model.effects), scales, abs(model.parameters.gain))
    return (*free, *(of_silent_texels(own, effect) if candidate.kind.found_by == SILENT_TEXELS else own))


def share_left(found: Fit, before: float) -> float:
    """Return which share a fit leaves of a sum of squares, both beyond the noise's."""
    count = float(found.count.sum())
    return 1.0 - (before - float(found.sse.sum())) / max(before - count, 0.01 * count)
