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
from ..fitting.least_squares import Fit, FreeParameter, fit, held_out_squares
from ..fitting.noise_floor import Coverage
from ..fitting.residual_tests import ResidualStructure
from ..forward.predictor import Model
from .candidates import DIRECTLY_ESTIMATED, Candidate, FittedCandidate, Scales, candidates
from .identifiability import confounded
from .plausibility import is_plausible
from .screening import screen
from .view_set import ViewSet

FIRST_LEAST_SHARE, NEXT_LEAST_SHARE, NEXT_LEAST_SHARE_OF_GAP = 0.25, 0.2, 0.01
"""Least share of the gap that the first effect closes; of what is left that a further one closes; and of the whole gap."""
LEAST_IMPROVEMENT = 0.02
"""Least decrease of the mean square on unseen trials, in units of the noise's variance."""
LEAST_FORCE_IMPROVEMENT = 0.25
"""The same for friction, in units of what forces tremble at rest, which coloured noise does by more than it changes from sample
to sample. Sliding between two samples is integrated, and not quite as the world does it."""
LEAST_CONSISTENCY = 0.8
"""Least share that what is better in some trials has in all that changes: one trial may alone have what tells."""
LEAST_STRUCTURE = 0.03
"""Share of a residual that can be predicted, below which it is noise."""
MOST_EFFECTS = 3
"""Most effects that are looked for beside friction."""
BEAM_RATIO, BEAM_WIDTH = 3.0, 2
"""The first effect may be a compromise of two: others that leave at most so many times as much are tried as the first as well,
up to so many kinds in all."""
PAIR_ADVANTAGE = 0.8
"""Least by which a pair that does not begin with the best first effect must leave less, as a share."""

READINGS, FORCES = 0, 1
StepSearch = Generator[tuple[str, float], None, "SelectionStep"]
StructureOfFit = Callable[[Fit], ResidualStructure]
"""Says what structure is in the residual of a fit."""


@dataclass
class NoiseFloor:
    """What effects are judged against.

    Attributes
    ----------
    base, noise : (2,) float
        Mean square of the base model, and that of noise, for readings and forces.
    count : (2,) float
        How many values were measured.
    """

    base: np.ndarray
    noise: np.ndarray
    count: np.ndarray

    @property
    def both(self) -> bool:
        """Whether readings and forces were measured."""
        return bool((self.count > 0).all())

    @property
    def main_quantity(self) -> int:
        """What effects other than friction are judged by."""
        return READINGS if self.count[READINGS] > 0 else FORCES

    def quantity_for(self, name: str) -> int:
        """What an effect is judged by."""
        return FORCES if self.both and name in friction_kinds() else self.main_quantity

    def gap(self, quantity: int) -> float:
        """Whole gap of one side."""
        return float(max(self.base[quantity] - self.noise[quantity], 1e-12))

    def closed_share(self, means: np.ndarray, quantity: int) -> float:
        """Share of a side's gap that is closed at these mean squares."""
        return float(np.clip((self.base[quantity] - means[quantity]) / self.gap(quantity), 0.0, 1.0))

    def improvement(self, before: np.ndarray, after: np.ndarray, quantity: int) -> Improvement:
        """What is closed on the way from some mean squares to others."""
        closed = float(before[quantity] - after[quantity])
        return Improvement(closed / self.gap(quantity), closed / float(max(before[quantity] - self.noise[quantity], 1e-12)))

    def unresolved(self, quantity: int) -> float:
        """What no fit can tell of what is left of a side's gap."""
        return 0.004 * self.gap(quantity) + 0.01

    def has_gap(self, quantity: int) -> bool:
        """Whether a side has a gap that is worth speaking of."""
        return bool(self.count[quantity] > 0) and self.gap(quantity) > (
            LEAST_IMPROVEMENT if quantity == self.main_quantity else float(self.noise[quantity])
        )


def friction_kinds() -> list[str]:
    """Names of the effects that act on friction alone."""
    return [kind.name for kind in library().values() if all(form.friction_law is not None for form in kind.forms)]


@dataclass
class SelectionStep:
    """What came of looking for one effect more.

    Attributes
    ----------
    ranked : list of FittedCandidate
        Those that were judged and that the recordings do not refute, best first.
    remaining : list of float
        What each leaves of the gap, with a little for what no fit can tell.
    remaining_before : float
        What was left without any of them.
    remaining_repeated : float
        What the best second effect of a kind that is in the model already leaves: more freedom for its formula.
    """

    ranked: list[FittedCandidate]
    remaining: list[float]
    remaining_before: float = np.inf
    remaining_repeated: float = np.inf

    def of(self, name: str) -> float:
        """What the best form of a kind leaves; infinite if it was not judged."""
        own = [left for one, left in zip(self.ranked, self.remaining, strict=True) if one.candidate.name == name]
        return min(own, default=np.inf)

    def times_worse(self, left: float, name: str) -> float:
        """How many times as bad one is that leaves so much as the kind of this name: by what it leaves or by what it closes.

        The two are one where hardly anything is left. Where much is left whatever is taken, what they close tells more.
        """
        own = self.of(name)
        return (
            max(left / own, (self.remaining_before - own) / max(self.remaining_before - left, 1e-12))
            if self.remaining_before < np.inf
            else left / own
        )


@dataclass(frozen=True)
class Improvement:
    """What an effect closed: as a share of the whole gap, and of what the others had left."""

    of_gap: float
    of_remaining: float


@dataclass
class SelectionState:
    """How a model was found: the effects in its order.

    Attributes
    ----------
    fit : Fit
    means : (2,) float
        Mean squares on unseen trials.
    held_out : (trials, 2) float
    steps : dict of str to Step
        In which each effect was chosen.
    improvements : dict of str to Improvement
        What each closed when it joined.
    first : SelectionStep
        What was judged on top of the base model.
    """

    fit: Fit
    held_out: np.ndarray
    steps: dict[str, SelectionStep] = field(default_factory=dict)
    improvements: dict[str, Improvement] = field(default_factory=dict)
    first: SelectionStep = field(default_factory=lambda: SelectionStep([], []))

    @property
    def means(self) -> np.ndarray:
        """Mean squares on unseen trials."""
        return means_of(self.held_out, self.fit)


def means_of(unseen: np.ndarray, found: Fit) -> np.ndarray:
    """Mean squares of readings and of forces, (2,) float; zero where there are none."""
    means: np.ndarray = unseen.sum(axis=0) / np.maximum(found.count.sum(axis=0), 1)
    return means


@dataclass
class ForwardSelection:
    """Looks for effects on one set of recordings."""

    view_set: ViewSet
    scales: Scales
    coverage: Coverage
    floor: NoiseFloor

    def __post_init__(self) -> None:
        self.confounded_kinds = confounded(self.coverage)

    def run(self, base: SelectionState, structure: StructureOfFit) -> Generator[tuple[str, float], None, SelectionState]:
        """Explain what a base model lacks.

        Parameters
        ----------
        base : SelectionState
        structure : callable
            Of a fit's residual.
        """
        state = base
        lone = yield from self._best_next(base, 0.0, 0.25, first=True)
        base.first = lone
        state = self._extended(base, lone, first=True)
        if state is not base:
            state = yield from self._best_pair(base, lone, state, structure)
            while (
                self._effect_count(state) >= 2
                and self._effect_count(state) < MOST_EFFECTS
                and self._is_gap_open(state, structure)
            ):
                step = yield from self._best_next(state, 0.6, 0.2)
                longer = self._extended(state, step)
                if longer is state:
                    break
                state = longer
            if self._effect_count(state) >= 2:
                state = yield from self._first_reconsidered(state)
        state.first = lone
        if self.floor.both:
            state = yield from self._friction(state)
        return state

    # --- one effect more

    def _best_next(
        self, state: SelectionState, start: float, share: float, first: bool = False, friction: bool = False
    ) -> StepSearch:
        """Judge every effect that the model has not yet on top of it."""
        taken = {effect.name for effect in state.fit.model.effects}
        forms = candidates([s.predictor for s in self.view_set.whole], state.fit.model)
        forms = [c for c in forms if c.name not in taken or may_repeat(c)]
        forms = [c for c in forms if not is_free_already(c, state.fit.free) and (first or c.name not in self.confounded_kinds)]
        if self.floor.both:
            forms = [c for c in forms if (c.form.friction_law is not None) == friction]
        ranked: list[FittedCandidate] = []
        for what, done, found in screen(self.view_set, state.fit, forms, self.scales):
            yield what, start + share * done
            ranked = found or ranked
        return self._ranked([one for one in ranked if is_plausible(one, self.view_set)], state)

    def _ranked(self, judged: list[FittedCandidate], state: SelectionState) -> SelectionStep:
        """Put what was judged in order of what it leaves."""
        if not judged:
            return SelectionStep([], [])
        means = [*(means_of(one.held_out, one.fit) for one in judged), state.means]
        quantity = self.floor.quantity_for(judged[0].candidate.name)
        *left, before = (x + self.floor.unresolved(quantity) for x in self._remaining(means, quantity))
        taken = {effect.name for effect in state.fit.model.effects}
        again = [i for i, one in enumerate(judged) if one.candidate.name in taken]
        order = [int(i) for i in np.argsort(left, kind="stable") if i not in again]
        repeated = min((left[i] for i in again), default=np.inf)
        return SelectionStep([judged[i] for i in order], [left[i] for i in order], before, repeated)

    def _remaining(self, means: Sequence[np.ndarray], quantity: int) -> list[float]:
        """What each of some models leaves of the gap.

        Forces count beside readings, as far as others of these models do better there: friction has a share in them.
        """
        g = self.floor
        left = [max(float(m[quantity] - g.noise[quantity]), 0.0) for m in means]
        if g.both and quantity == READINGS:
            least = min(float(m[FORCES]) for m in means)
            weight = g.count[FORCES] / g.count[READINGS]
            left = [a + weight * (float(m[FORCES]) - least) for a, m in zip(left, means, strict=True)]
        return left

    def simplest(self, step: SelectionStep) -> FittedCandidate:
        """The best, or one with far fewer numbers that leaves hardly more."""
        pairs = [
            (one, left)
            for one, left in zip(step.ranked, step.remaining, strict=True)
            if one.candidate.name not in self.confounded_kinds
        ]
        pairs = pairs or list(zip(step.ranked, step.remaining, strict=True))
        best, least = pairs[0]
        listed = [one for one, left in pairs if one.candidate.name == "dead-texels" and left < 1.5 * least]
        if best.candidate.has_texel_parameters and listed:
            return listed[0]
        near = [one for one, left in pairs if left < 1.15 * least and one.parameter_count < 0.5 * best.parameter_count]
        return near[0] if near else best

    def _extended(
        self, state: SelectionState, step: SelectionStep, first: bool = False, choice: FittedCandidate | None = None
    ) -> SelectionState:
        """The account with the best of a step, or the same one if it does not earn its place."""
        if not step.ranked:
            return state
        best = choice or self.simplest(step)
        if not self._earns_its_place(best, state, first):
            return state
        name = best.candidate.name
        improvement = self.floor.improvement(state.means, means_of(best.held_out, best.fit), self.floor.quantity_for(name))
        return SelectionState(best.fit, best.held_out, {**state.steps, name: step}, {**state.improvements, name: improvement})

    def _earns_its_place(self, one: FittedCandidate, state: SelectionState, first: bool) -> bool:
        """Whether a candidate closes enough of the gap, and hardly anywhere does worse."""
        g, quantity = self.floor, self.floor.quantity_for(one.candidate.name)
        before, after = state.means[quantity], means_of(one.held_out, one.fit)[quantity]
        gained, left = float(before - after), max(float(before - g.noise[quantity]), 1e-12)
        change = state.held_out[:, quantity] - one.held_out[:, quantity]
        if float(change[change > 0].sum()) < LEAST_CONSISTENCY * float(np.abs(change).sum()):
            return False
        if g.both and quantity == FORCES:
            return gained >= max(LEAST_FORCE_IMPROVEMENT * float(g.noise[quantity]), FIRST_LEAST_SHARE * left)
        if gained < LEAST_IMPROVEMENT:
            return False
        if one.candidate.name == "quantization":
            return True  # no more than the steps that are seen in the readings: it need not be what errs most
        return gained >= (
            FIRST_LEAST_SHARE if first else NEXT_LEAST_SHARE
        ) * left and gained >= NEXT_LEAST_SHARE_OF_GAP * g.gap(quantity)

    # --- several

    def _effect_count(self, state: SelectionState) -> int:
        return len(state.fit.model.effects)

    def _is_gap_open(self, state: SelectionState, structure: StructureOfFit) -> bool:
        """Whether enough is left that a further effect could earn its place."""
        g, mean = self.floor, float(state.means[self.floor.main_quantity])
        if any(effect.name == "quantization" for effect in state.fit.model.effects):
            return False  # what is left lies within a step
        if mean - g.noise[g.main_quantity] < max(LEAST_IMPROVEMENT, NEXT_LEAST_SHARE_OF_GAP * g.gap(g.main_quantity)):
            return False
        return structure(state.fit).total >= LEAST_STRUCTURE or mean >= 1.5

    def _best_pair(
        self, base: SelectionState, lone: SelectionStep, single: SelectionState, structure: StructureOfFit
    ) -> Generator[tuple[str, float], None, SelectionState]:
        """The best of those pairs of effects that begin with one of the best first ones; or the first alone."""
        if not self._is_gap_open(single, structure):
            return single
        chosen = next(iter(single.improvements))
        firsts, least = [single], lone.of(chosen)
        for one, left in zip(lone.ranked, lone.remaining, strict=True):
            name = one.candidate.name
            fresh = name not in self.confounded_kinds and all(name not in state.improvements for state in firsts)
            if len(firsts) < BEAM_WIDTH and left < BEAM_RATIO * least and fresh:
                other = self._extended(base, lone, first=True, choice=one)
                firsts += [other] if other is not base else []
        ends = []
        for number, state in enumerate(firsts):
            step = yield from self._best_next(state, 0.25 + 0.35 * number / len(firsts), 0.35 / len(firsts))
            longer = self._extended(state, step)
            ends += [longer] if longer is not state or state is single else []  # alone, the first one was the better choice
        remaining = self._remaining([end.means for end in ends], self.floor.main_quantity)
        best = int(np.argmin(remaining))
        return ends[best] if best == 0 or remaining[best] < PAIR_ADVANTAGE * remaining[0] else ends[0]

    def _first_reconsidered(self, state: SelectionState) -> Generator[tuple[str, float], None, SelectionState]:
        """The first effect was chosen without the others: look whether another does better beside them, or none is needed."""
        model = state.fit.model
        first, quantity = model.effects[0].name, self.floor.main_quantity
        rest = tuple(
            replace(item, effect=item.effect - 1) if item.effect > 0 else item for item in state.fit.free if item.effect != 0
        )
        other = fit(self.view_set.whole, model.without(0), rest, max_steps=6, tolerance=1e-4)
        steps = {name: step for name, step in state.steps.items() if name != first}
        improvements = {name: improvement for name, improvement in state.improvements.items() if name != first}
        without = SelectionState(other, held_out_squares(self.view_set.whole, other), steps, improvements)
        step = yield from self._best_next(without, 0.8, 0.1)
        lost = float(without.means[quantity] - state.means[quantity])
        if lost < max(LEAST_IMPROVEMENT, 0.02 * self.floor.gap(quantity)):  # what came later does it all
            return without
        if not step.ranked:
            return state
        best = self.simplest(step)
        before, after = self._remaining([state.means, means_of(best.held_out, best.fit)], quantity)
        if after < (1.0 if best.candidate.name == first else 0.98) * before - 1e-6:
            name, improvement = (
                best.candidate.name,
                self.floor.improvement(without.means, means_of(best.held_out, best.fit), quantity),
            )
            return SelectionState(
                last_effect_first(best.fit), best.held_out, {name: step, **steps}, {name: improvement, **improvements}
            )
        told = step if np.isfinite(step.of(first)) else state.steps[first]  # its rivals are those beside the others
        improvements = {**state.improvements, first: self.floor.improvement(without.means, state.means, quantity)}
        return replace(state, steps={**state.steps, first: told}, improvements=improvements)

    def _friction(self, state: SelectionState) -> Generator[tuple[str, float], None, SelectionState]:
        """Effects on friction, judged by forces alone, on top of all else."""
        for _ in friction_kinds():
            if state.means[FORCES] < (1.0 + LEAST_FORCE_IMPROVEMENT) * self.floor.noise[FORCES]:
                break
            step = yield from self._best_next(state, 0.9, 0.05, first=True, friction=True)
            longer = self._extended(state, step)
            if longer is state:
                break
            state = replace(longer, first=state.first)
        return state


def may_repeat(candidate: Candidate) -> bool:
    """Whether a second effect of the kind would be more than the first with other numbers."""
    return not candidate.has_texel_parameters and candidate.name not in DIRECTLY_ESTIMATED and candidate.form.placement is None


def is_free_already(candidate: Candidate, free: Sequence[FreeParameter]) -> bool:
    """A common offset is the sensor's `zero` where that is fitted."""
    return candidate.label == "offset/common" and any(item.effect < 0 and item.name == "zero" for item in free)


def last_effect_first(found: Fit) -> Fit:
    """The same fit with the effect that joined last at the head of the stack, where it was in the order of finding."""
    last = len(found.model.effects) - 1
    effects = (found.model.effects[last], *found.model.effects[:last])
    free = tuple(
        item if item.effect < 0 else replace(item, effect=0 if item.effect == last else item.effect + 1) for item in found.free
    )
    return replace(found, model=Model(found.model.parameters, effects), free=free)
