# SPDX-License-Identifier: GPL-3.0-or-later
"""One effect after the other joins the model as long as it earns its place.

All judgements are made on stretches of the recordings that a fit has not seen, in units of the noise's variance. With M₀ the
mean square of the base model and F that of the noise, ``M₀ - F`` is the gap; an effect closes a share of it. Readings and net
forces have a gap each: friction shows in forces alone and is judged by them, all else by the readings where there are any. How
large a share is large enough is told by the constants below; they were set on simulated sensors whose hidden effects follow
other formulas than the library's.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...effects.engine.registry import library
from ..fitting.least_squares import Fit, Free, fit, held_out
from ..fitting.noise_floor import Coverage
from ..fitting.residual_tests import Structure
from ..forward.predictor import Model
from .candidates import READ_OFF, Candidate, Scales, candidates
from .identifiability import confounded
from .plausibility import admissible
from .screening import Found, Views, search

FIRST, NEXT, NEXT_OF_ALL = 0.25, 0.2, 0.01
"""Least share of the gap that the first effect closes; of what is left that a further one closes; and of the whole gap."""
LEAST = 0.02
"""Least decrease of the mean square on unseen trials, in units of the noise's variance."""
LEAST_OF_FORCES = 0.25
"""The same for friction, in units of what forces tremble at rest, which coloured noise does by more than it changes from sample
to sample. Sliding between two samples is integrated, and not quite as the world does it."""
BY_FAR = 0.8
"""Least share that what is better in some trials has in all that changes: one trial may alone have what tells."""
STRUCTURE = 0.03
"""Share of a residual that can be predicted, below which it is noise."""
MOST = 3
"""Most effects that are looked for beside friction."""
BEAM, WIDE = 3.0, 2
"""The first effect may be a compromise of two: others that leave at most so many times as much are tried as the first as well,
up to so many kinds in all."""
BETTER = 0.8
"""Least by which a pair that does not begin with the best first effect must leave less, as a share."""

READINGS, FORCES = 0, 1
Work = Generator[tuple[str, float], None, "Step"]
Left = Callable[[Fit], Structure]
"""Says what structure is in the residual of a fit."""


@dataclass
class Ground:
    """What effects are judged against.

    Attributes
    ----------
    start, floor : (2,) float
        Mean square of the base model, and that of noise, for readings and forces.
    count : (2,) float
        How many values were measured.
    """

    start: np.ndarray
    floor: np.ndarray
    count: np.ndarray

    @property
    def both(self) -> bool:
        """Whether readings and forces were measured."""
        return bool((self.count > 0).all())

    @property
    def main(self) -> int:
        """What effects other than friction are judged by."""
        return READINGS if self.count[READINGS] > 0 else FORCES

    def side(self, name: str) -> int:
        """What an effect is judged by."""
        return FORCES if self.both and name in friction_kinds() else self.main

    def gap(self, side: int) -> float:
        """Whole gap of one side."""
        return float(max(self.start[side] - self.floor[side], 1e-12))

    def closed(self, means: np.ndarray, side: int) -> float:
        """Share of a side's gap that is closed at these mean squares."""
        return float(np.clip((self.start[side] - means[side]) / self.gap(side), 0.0, 1.0))

    def gain(self, before: np.ndarray, after: np.ndarray, side: int) -> Gain:
        """What is closed on the way from some mean squares to others."""
        closed = float(before[side] - after[side])
        return Gain(closed / self.gap(side), closed / float(max(before[side] - self.floor[side], 1e-12)))

    def untold(self, side: int) -> float:
        """What no fit can tell of what is left of a side's gap."""
        return 0.004 * self.gap(side) + 0.01

    def matters(self, side: int) -> bool:
        """Whether a side has a gap that is worth speaking of."""
        return bool(self.count[side] > 0) and self.gap(side) > (LEAST if side == self.main else float(self.floor[side]))


def friction_kinds() -> list[str]:
    """Names of the effects that act on friction alone."""
    return [kind.name for kind in library().values() if all(form.friction_law is not None for form in kind.forms)]


@dataclass
class Step:
    """What came of looking for one effect more.

    Attributes
    ----------
    ranked : list of Found
        Those that were judged and that the recordings do not refute, best first.
    left : list of float
        What each leaves of the gap, with a little for what no fit can tell.
    before : float
        What was left without any of them.
    again : float
        What the best second effect of a kind that is in the model already leaves: more freedom for its formula.
    """

    ranked: list[Found]
    left: list[float]
    before: float = np.inf
    again: float = np.inf

    def of(self, name: str) -> float:
        """What the best form of a kind leaves; infinite if it was not judged."""
        own = [left for one, left in zip(self.ranked, self.left, strict=True) if one.candidate.name == name]
        return min(own, default=np.inf)

    def worse(self, left: float, name: str) -> float:
        """How many times as bad one is that leaves so much as the kind of this name: by what it leaves or by what it closes.

        The two are one where hardly anything is left. Where much is left whatever is taken, what they close tells more.
        """
        own = self.of(name)
        return max(left / own, (self.before - own) / max(self.before - left, 1e-12)) if self.before < np.inf else left / own


@dataclass(frozen=True)
class Gain:
    """What an effect closed: as a share of the whole gap, and of what the others had left."""

    of_all: float
    of_left: float


@dataclass
class Account:
    """How a model was found: the effects in its order.

    Attributes
    ----------
    fit : Fit
    means : (2,) float
        Mean squares on unseen trials.
    unseen : (trials, 2) float
    steps : dict of str to Step
        In which each effect was chosen.
    gains : dict of str to Gain
        What each closed when it joined.
    first : Step
        What was judged on top of the base model.
    """

    fit: Fit
    unseen: np.ndarray
    steps: dict[str, Step] = field(default_factory=dict)
    gains: dict[str, Gain] = field(default_factory=dict)
    first: Step = field(default_factory=lambda: Step([], []))

    @property
    def means(self) -> np.ndarray:
        """Mean squares on unseen trials."""
        return means_of(self.unseen, self.fit)


def means_of(unseen: np.ndarray, found: Fit) -> np.ndarray:
    """Mean squares of readings and of forces, (2,) float; zero where there are none."""
    means: np.ndarray = unseen.sum(axis=0) / np.maximum(found.count.sum(axis=0), 1)
    return means


@dataclass
class Explainer:
    """Looks for effects on one set of recordings."""

    views: Views
    scales: Scales
    coverage: Coverage
    ground: Ground

    def __post_init__(self) -> None:
        self.mixed = confounded(self.coverage)

    def run(self, base: Account, structure: Left) -> Generator[tuple[str, float], None, Account]:
        """Explain what a base model lacks.

        Parameters
        ----------
        base : Account
        structure : callable
            Of a fit's residual.
        """
        account = base
        lone = yield from self._look(base, 0.0, 0.25, first=True)
        base.first = lone
        account = self._joined(base, lone, first=True)
        if account is not base:
            account = yield from self._second(base, lone, account, structure)
            while self._main_effects(account) >= 2 and self._main_effects(account) < MOST and self._open(account, structure):
                step = yield from self._look(account, 0.6, 0.2)
                longer = self._joined(account, step)
                if longer is account:
                    break
                account = longer
            if self._main_effects(account) >= 2:
                account = yield from self._reconsidered(account)
        account.first = lone
        if self.ground.both:
            account = yield from self._friction(account)
        return account

    # --- one effect more

    def _look(self, account: Account, start: float, share: float, first: bool = False, friction: bool = False) -> Work:
        """Judge every effect that the model has not yet on top of it."""
        taken = {effect.name for effect in account.fit.model.effects}
        forms = candidates([s.predictor for s in self.views.whole], account.fit.model)
        forms = [c for c in forms if c.name not in taken or may_repeat(c)]
        forms = [c for c in forms if not is_free_already(c, account.fit.free) and (first or c.name not in self.mixed)]
        if self.ground.both:
            forms = [c for c in forms if (c.form.friction_law is not None) == friction]
        ranked: list[Found] = []
        for what, done, found in search(self.views, account.fit, forms, self.scales):
            yield what, start + share * done
            ranked = found or ranked
        return self._ranked([one for one in ranked if admissible(one, self.views)], account)

    def _ranked(self, judged: list[Found], account: Account) -> Step:
        """Put what was judged in order of what it leaves."""
        if not judged:
            return Step([], [])
        means = [*(means_of(one.unseen, one.fit) for one in judged), account.means]
        side = self.ground.side(judged[0].candidate.name)
        *left, before = (x + self.ground.untold(side) for x in self._left(means, side))
        taken = {effect.name for effect in account.fit.model.effects}
        again = [i for i, one in enumerate(judged) if one.candidate.name in taken]
        order = [int(i) for i in np.argsort(left, kind="stable") if i not in again]
        repeated = min((left[i] for i in again), default=np.inf)
        return Step([judged[i] for i in order], [left[i] for i in order], before, repeated)

    def _left(self, means: Sequence[np.ndarray], side: int) -> list[float]:
        """What each of some models leaves of the gap.

        Forces count beside readings, as far as others of these models do better there: friction has a share in them.
        """
        g = self.ground
        left = [max(float(m[side] - g.floor[side]), 0.0) for m in means]
        if g.both and side == READINGS:
            least = min(float(m[FORCES]) for m in means)
            weight = g.count[FORCES] / g.count[READINGS]
            left = [a + weight * (float(m[FORCES]) - least) for a, m in zip(left, means, strict=True)]
        return left

    def simplest(self, step: Step) -> Found:
        """The best, or one with far fewer numbers that leaves hardly more."""
        pairs = [(one, left) for one, left in zip(step.ranked, step.left, strict=True) if one.candidate.name not in self.mixed]
        pairs = pairs or list(zip(step.ranked, step.left, strict=True))
        best, least = pairs[0]
        listed = [one for one, left in pairs if one.candidate.name == "dead-texels" and left < 1.5 * least]
        if best.candidate.local and listed:
            return listed[0]
        near = [one for one, left in pairs if left < 1.15 * least and one.numbers < 0.5 * best.numbers]
        return near[0] if near else best

    def _joined(self, account: Account, step: Step, first: bool = False, choice: Found | None = None) -> Account:
        """The account with the best of a step, or the same one if it does not earn its place."""
        if not step.ranked:
            return account
        best = choice or self.simplest(step)
        if not self._earns(best, account, first):
            return account
        name = best.candidate.name
        gain = self.ground.gain(account.means, means_of(best.unseen, best.fit), self.ground.side(name))
        return Account(best.fit, best.unseen, {**account.steps, name: step}, {**account.gains, name: gain})

    def _earns(self, one: Found, account: Account, first: bool) -> bool:
        """Whether a candidate closes enough of the gap, and hardly anywhere does worse."""
        g, side = self.ground, self.ground.side(one.candidate.name)
        before, after = account.means[side], means_of(one.unseen, one.fit)[side]
        gained, left = float(before - after), max(float(before - g.floor[side]), 1e-12)
        change = account.unseen[:, side] - one.unseen[:, side]
        if float(change[change > 0].sum()) < BY_FAR * float(np.abs(change).sum()):
            return False
        if g.both and side == FORCES:
            return gained >= max(LEAST_OF_FORCES * float(g.floor[side]), FIRST * left)
        if gained < LEAST:
            return False
        if one.candidate.name == "quantization":
            return True  # no more than the steps that are seen in the readings: it need not be what errs most
        return gained >= (FIRST if first else NEXT) * left and gained >= NEXT_OF_ALL * g.gap(side)

    # --- several

    def _main_effects(self, account: Account) -> int:
        return len(account.fit.model.effects)

    def _open(self, account: Account, structure: Left) -> bool:
        """Whether enough is left that a further effect could earn its place."""
        g, mean = self.ground, float(account.means[self.ground.main])
        if any(effect.name == "quantization" for effect in account.fit.model.effects):
            return False  # what is left lies within a step
        if mean - g.floor[g.main] < max(LEAST, NEXT_OF_ALL * g.gap(g.main)):
            return False
        return structure(account.fit).total >= STRUCTURE or mean >= 1.5

    def _second(
        self, base: Account, lone: Step, single: Account, structure: Left
    ) -> Generator[tuple[str, float], None, Account]:
        """The best of those pairs of effects that begin with one of the best first ones; or the first alone."""
        if not self._open(single, structure):
            return single
        chosen = next(iter(single.gains))
        firsts, least = [single], lone.of(chosen)
        for one, left in zip(lone.ranked, lone.left, strict=True):
            name = one.candidate.name
            fresh = name not in self.mixed and all(name not in account.gains for account in firsts)
            if len(firsts) < WIDE and left < BEAM * least and fresh:
                other = self._joined(base, lone, first=True, choice=one)
                firsts += [other] if other is not base else []
        ends = []
        for number, account in enumerate(firsts):
            step = yield from self._look(account, 0.25 + 0.35 * number / len(firsts), 0.35 / len(firsts))
            longer = self._joined(account, step)
            ends += [longer] if longer is not account or account is single else []  # alone, the first one was the better choice
        remaining = self._left([end.means for end in ends], self.ground.main)
        best = int(np.argmin(remaining))
        return ends[best] if best == 0 or remaining[best] < BETTER * remaining[0] else ends[0]

    def _reconsidered(self, account: Account) -> Generator[tuple[str, float], None, Account]:
        """The first effect was chosen without the others: look whether another does better beside them, or none is needed."""
        model = account.fit.model
        first, side = model.effects[0].name, self.ground.main
        rest = tuple(
            replace(item, effect=item.effect - 1) if item.effect > 0 else item for item in account.fit.free if item.effect != 0
        )
        other = fit(self.views.whole, model.without(0), rest, turns=6, tolerance=1e-4)
        steps = {name: step for name, step in account.steps.items() if name != first}
        gains = {name: gain for name, gain in account.gains.items() if name != first}
        without = Account(other, held_out(self.views.whole, other), steps, gains)
        step = yield from self._look(without, 0.8, 0.1)
        lost = float(without.means[side] - account.means[side])
        if lost < max(LEAST, 0.02 * self.ground.gap(side)):  # what came later does it all
            return without
        if not step.ranked:
            return account
        best = self.simplest(step)
        before, after = self._left([account.means, means_of(best.unseen, best.fit)], side)
        if after < (1.0 if best.candidate.name == first else 0.98) * before - 1e-6:
            name, gain = best.candidate.name, self.ground.gain(without.means, means_of(best.unseen, best.fit), side)
            return Account(last_first(best.fit), best.unseen, {name: step, **steps}, {name: gain, **gains})
        told = step if np.isfinite(step.of(first)) else account.steps[first]  # its rivals are those beside the others
        gains = {**account.gains, first: self.ground.gain(without.means, account.means, side)}
        return replace(account, steps={**account.steps, first: told}, gains=gains)

    def _friction(self, account: Account) -> Generator[tuple[str, float], None, Account]:
        """Effects on friction, judged by forces alone, on top of all else."""
        for _ in friction_kinds():
            if account.means[FORCES] < (1.0 + LEAST_OF_FORCES) * self.ground.floor[FORCES]:
                break
            step = yield from self._look(account, 0.9, 0.05, first=True, friction=True)
            longer = self._joined(account, step)
            if longer is account:
                break
            account = replace(longer, first=account.first)
        return account


def may_repeat(candidate: Candidate) -> bool:
    """Whether a second effect of the kind would be more than the first with other numbers."""
    return not candidate.local and candidate.name not in READ_OFF and candidate.form.placement is None


def is_free_already(candidate: Candidate, free: Sequence[Free]) -> bool:
    """A common offset is the sensor's `zero` where that is fitted."""
    return candidate.label == "offset/common" and any(item.effect < 0 and item.name == "zero" for item in free)


def last_first(found: Fit) -> Fit:
    """The same fit with the effect that joined last at the head of the stack, where it was in the order of finding."""
    last = len(found.model.effects) - 1
    effects = (found.model.effects[last], *found.model.effects[:last])
    free = tuple(
        item if item.effect < 0 else replace(item, effect=0 if item.effect == last else item.effect + 1) for item in found.free
    )
    return replace(found, model=Model(found.model.parameters, effects), free=free)
