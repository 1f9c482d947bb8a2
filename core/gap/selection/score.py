# SPDX-License-Identifier: GPL-3.0-or-later
"""The score of a model of effects, and by how much the scores of two models may differ by chance.

``S = - M/2 · Σ_q log(E_q + B_q + e_q) - price · names`` over the measured quantities q, readings and net forces:

- E: mean square that a fit leaves on stretches that it has not seen, less the noise's, never below zero;
- B: what the error of formulas may leave: φ times the mean square of the change that an effect makes to the prediction of q,
  beyond a factor and a zero. A formula of the library is never nature's, so an effect of size A may leave √φ·A and still be
  the right name;
- e: standard error of the noise's level;
- M: number of independent stretches.

The price of a name is the logarithm of the number of kinds tried. Standard errors come from a Bayesian bootstrap of the blocks
(Rubin, Ann. Stat. 9, 1981), confidences are pseudo-BMA+ weights (Yao, Vehtari, Simpson, Gelman, Bayesian Anal. 13, 2018).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.optimize import brentq

from ...effects.engine.registry import form_of, kind_of
from ..candidates.candidates import IN_PLANE, parameters_at_bounds
from ..fitting.least_squares import BASE, Fit
from .noise_level import NoiseLevel, Sums
from .rule_numbers import (
    DRAWS,
    FEWER_NUMBERS,
    FIT_TOLERANCE,
    FORMULA_ERROR,
    FREE_FORM_ERROR,
    LARGEST_FORMULA_ERROR,
    NEAR_ERRORS,
    SIGNIFICANT_ERRORS,
    STRETCHES,
)

OWN_NUMBERS, ONE_SESSION = "own numbers", "one session"
"""How recordings may be assumed to differ: by a factor and a zero each, or as one session in their order."""
IMPOSSIBLE = -STRETCHES * float(np.log(np.finfo(float).tiny))
"""By how much S of a model that cannot have made the readings is lower: as squares of readings and forces fall from one to the
smallest number above zero. Infinity is meant, and differences of two such models remain numbers."""


@dataclass(eq=False)
class Hypothesis:
    """A fitted model of the sensor, and what it leaves.

    Attributes
    ----------
    fit : Fit
    sums : Sums
    assumed : str
        How recordings differ: :data:`OWN_NUMBERS`, :data:`ONE_SESSION` or not at all (empty).
    """

    fit: Fit
    sums: Sums
    assumed: str = ""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Kinds of its effects, in the order of the stack."""
        return tuple(one.name for one in self.fit.model.effects)

    @cached_property
    def forms(self) -> tuple[str, ...]:
        """Labels of their forms."""
        return tuple(f"{one.name}/{one.form}" for one in self.fit.model.effects)

    @cached_property
    def is_bent(self) -> bool:
        """True if a number of an effect is at a bound: its formula is bent as far as it goes, and imitates another."""
        model, free = self.fit.model, self.fit.free
        return any(parameters_at_bounds(model, free, index) for index in range(len(self.names)))

    @property
    def price_count(self) -> int:
        """Number of names to pay for: numbers of recordings are one, the order of a session is none."""
        return len(self.names) + (self.assumed == OWN_NUMBERS)

    @property
    def number_count(self) -> int:
        """Number of fitted values of effects and recordings; one for each texel where each has its own.

        Displacements and thresholds that a scan has found, and what was read off a converter's levels, count, too.
        """
        scanned = set()
        for index, one in enumerate(self.fit.model.effects):
            form = form_of(one.name, one.form)
            names = form.jumps_at or (IN_PLANE if form.placement is not None else ())
            scanned |= {(index, name) for name in names if one.values.get(name, 0.0) != 0.0}
            scanned |= {(index, p.name) for p in form.parameters} if form.level_number is not None else set()
        scanned -= {(item.effect, item.name) for item in self.fit.free}
        texels = max([len(v) for e in self.fit.model.effects for v in e.values.values() if isinstance(v, tuple)] + [1])
        return len(scanned) + sum(item.number_count(texels) for item in self.fit.free if item.effect != BASE)

    @property
    def components(self) -> tuple[str, ...]:
        """What changes the prediction: numbers of recordings, and forms of effects."""
        return (*([OWN_NUMBERS] if self.assumed == OWN_NUMBERS else []), *self.forms)

    @property
    def key(self) -> tuple[str, ...]:
        """What it consists of."""
        return (*sorted(self.forms), self.assumed)

    def has_texel_numbers(self, index: int) -> bool:
        """Return whether an effect has a fitted number for each texel."""
        return any(item.effect == index and item.per_texel and np.all(item.low < item.high) for item in self.fit.free)


@dataclass
class Score:
    """The rule for one rig; it needs the noise, which is known when models have been tried.

    Attributes
    ----------
    noise : NoiseLevel
    measured : (2,) bool
        Of readings and net forces.
    price : float
        Of a name, in units of S.
    weights : (draws, b) float
        Weights of the blocks, of mean one; the first draw has equal ones.
    formula_errors : dict of str to (2,) float
        φ of the forms that were tried, by their labels.
    has_few_values : bool
        True if readings repeat a few values: noise repeats none, so a model without steps cannot have made them.
    """

    noise: NoiseLevel
    measured: np.ndarray
    price: float
    weights: np.ndarray
    formula_errors: dict[str, np.ndarray] = field(default_factory=dict)
    has_few_values: bool = False
    _kept: dict[int, tuple[Hypothesis, np.ndarray]] = field(default_factory=dict)

    def parts(self, one: Hypothesis, weights: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return E and B under each draw, or with other weights of the blocks, (draws, 2) each."""
        s, weights = one.sums, self.weights if weights is None else weights
        count = np.maximum(weights @ s.count, 1e-9)
        excess = np.maximum(weights @ s.left / count - self.noise.under(weights), 0.0)
        allowed = np.zeros(s.count.shape)
        for name, change in zip(one.components, s.changes, strict=True):
            allowed = allowed + self.formula_error(name) * change
        return excess, weights @ allowed / count

    def formula_error(self, label: str) -> np.ndarray:
        """Return φ of a form for readings and forces, (2,)."""
        return self.formula_errors.get(label, np.full(2, _stated_error(label)))

    def measure_formula_errors(self, base: Hypothesis, singles: Sequence[Hypothesis]) -> None:
        """Measure φ on these recordings by leaving one form out, for kinds of which two forms or more explain something alone.

        It is what the second best form leaves beyond the best, or what the best leaves, up to its error, if that is less, as a
        share of the change that the best one makes. Forms of a kind may be alike, so φ is at least that of textbooks; a form
        that states its φ keeps it.
        """
        least, found = self.value(base), dict[str, list[Hypothesis]]()
        for one in sorted(singles, key=self.value, reverse=True):
            own = found.setdefault(one.names[0], [])
            if self.value(one) > least and all(one.forms != other.forms for other in own):
                own.append(one)
        errors: dict[str, np.ndarray] = {}
        for own in found.values():
            if len(own) > 1:
                (first, allowed), (second, _) = self.parts(own[0]), self.parts(own[1])
                error = np.minimum(second[0] - first[0], first[0] + self.noise.error)
                share = error / np.maximum(allowed[0] / self.formula_error(own[0].forms[0]), 1e-12)
                share = np.clip(share, FORMULA_ERROR, LARGEST_FORMULA_ERROR)
                kind = kind_of(own[0].names[0])
                errors |= {f"{kind.name}/{form.name}": share for form in kind.forms if form.error is None}
        self.formula_errors = errors
        self._kept.clear()

    def values(self, one: Hypothesis) -> np.ndarray:
        """Return S under each draw, (draws,)."""
        kept = self._kept.get(id(one))
        if kept is None or kept[0] is not one:
            excess, allowed = self.parts(one)
            total = np.log(excess + allowed + self.noise.error)[:, self.measured].sum(axis=1)
            cost = self.price * one.price_count + IMPOSSIBLE * self.cannot_be(one)
            kept = self._kept[id(one)] = one, -0.5 * STRETCHES * total - cost
        return kept[1]

    def prediction(self, one: Hypothesis) -> float:
        """Return S without prices and allowances: how well a model predicts stretches that it has not seen."""
        excess, _ = self.parts(one)
        return float(-0.5 * STRETCHES * np.log(excess[0] + self.noise.error)[self.measured].sum())

    def leaves_gap(self, one: Hypothesis, weights: np.ndarray | None = None) -> bool:
        """Return whether a model leaves more than noise and the error of its formulas account for, `weights` (1, b)."""
        excess, allowed = self.parts(one, self.weights[:1] if weights is None else weights)
        most = np.maximum(SIGNIFICANT_ERRORS * self.noise.error, allowed[0])
        return self.cannot_be(one) or bool((excess[0] > most)[self.measured].any())

    def reaches_noise(self, one: Hypothesis) -> bool:
        """Return whether a model leaves no more than noise accounts for."""
        excess = self.parts(one, self.weights[:1])[0][0]
        return not self.cannot_be(one) and bool((excess <= SIGNIFICANT_ERRORS * self.noise.error)[self.measured].all())

    def is_refuted(self, forms: Sequence[Hypothesis]) -> bool:
        """Return whether a kind leaves a gap in all its forms that are free to follow any law, or in all if it has none."""
        free = [one for one in forms if form_of(*one.forms[-1].split("/")).error is not None]
        return all(map(self.leaves_gap, free or forms))

    def force_weight(self, one: Hypothesis) -> float:
        """Return the weight of the squares of forces, of those of readings, with which a fit of a model raises S most.

        It is the ratio of the derivatives of S by the squares, 1/(N (E + B + e)) for N values. Where noise accounts for what
        the model leaves, weights are those of the noise.
        """
        count = self.weights[0] @ one.sums.count
        if not (count > 0).all() or not self.leaves_gap(one):
            return 1.0
        excess, allowed = self.parts(one, self.weights[:1])
        squares = count * (excess[0] + allowed[0] + self.noise.error)
        return float(squares[0] / squares[1])

    def cannot_be(self, one: Hypothesis) -> bool:
        """Return whether a model cannot have made the readings: they repeat a few values, and it has no steps."""
        return self.has_few_values and not one.fit.model.is_stepped

    def value(self, one: Hypothesis) -> float:
        """Return S."""
        return float(self.values(one)[0])

    def lead(self, one: Hypothesis, other: Hypothesis) -> tuple[float, float]:
        """Return by how much S of one model is above another's, and the standard error of that."""
        apart = self.values(one) - self.values(other)
        return float(apart[0]), float(apart[1:].std())

    @property
    def resolution(self) -> float:
        """By how much scores of models that leave no more than noise may change if fits go on."""
        return self._resolution(np.zeros(2))

    def predicts_better(self, one: Hypothesis, other: Hypothesis) -> bool:
        """Return whether one model predicts unseen stretches better than another, as far as scores are known."""
        excess, _ = self.parts(other)
        return self.prediction(one) > self.prediction(other) + self._resolution(excess[0])

    def _resolution(self, excess: np.ndarray) -> float:
        """By how much S may change if the squares fall by the fits' tolerance, of models that leave this beyond the noise."""
        squares = FIT_TOLERANCE * (excess + self.noise.under(self.weights[0]))
        return float(0.5 * STRETCHES * (squares / (excess + self.noise.error))[self.measured].sum())

    def is_near(self, best: Hypothesis, one: Hypothesis) -> bool:
        """Return whether a model does as well as a better one, as far as chance goes, or as scores are known."""
        apart, error = self.lead(best, one)
        return apart < max(NEAR_ERRORS * error, self.resolution)

    @staticmethod
    def is_simpler(one: Hypothesis, other: Hypothesis) -> bool:
        """Return whether a model has far fewer numbers than another, or none at a bound where the other has."""
        return FEWER_NUMBERS * one.number_count < other.number_count or (other.is_bent and not one.is_bent)

    def best_form(self, forms: Sequence[Hypothesis]) -> Hypothesis:
        """Return the form of a kind that leaves least on unseen blocks, or one with fewer numbers that does as well.

        It does so within a standard error of the difference, or of the noise, or as far as fits end. Forms share the allowance
        for an imperfect formula, so it does not count here.
        """

        def left(one: Hypothesis) -> np.ndarray:
            s = one.sums
            return np.asarray((self.weights @ s.left / np.maximum(self.weights @ s.count, 1e-9))[:, self.measured].sum(axis=1))

        least = {id(one): left(one) for one in forms}
        top = min(forms, key=lambda one: float(least[id(one)][0]))
        apart = {key: values - least[id(top)] for key, values in least.items()}
        known = max(float(self.noise.error[self.measured].sum()), FIT_TOLERANCE * float(least[id(top)][0]))
        near = [one for one in forms if one is top or apart[id(one)][0] < max(NEAR_ERRORS * apart[id(one)][1:].std(), known)]
        return min(near, key=lambda one: (one.is_bent, one.number_count, float(least[id(one)][0])))

    def values_of_kind(self, forms: Sequence[Hypothesis], library: int) -> np.ndarray:
        """Return S of a kind by all its forms under each draw: the logarithm of the mean of exp(S).

        Parameters
        ----------
        forms : sequence of Hypothesis
            Those that were fitted; forms that promised nothing count as nothing.
        library : int
            Number of forms of the kind.
        """
        table = np.array([self.values(one) for one in forms])
        most = table.max(axis=0)
        return np.asarray(most + np.log(np.exp(table - most).sum(axis=0) / max(library, len(forms))))

    def weights_of(self, values: Sequence[np.ndarray]) -> np.ndarray:
        """Return pseudo-BMA+ weights: the mean over the draws of the softmax of S."""
        table = np.array([one[1:] for one in values])
        table = np.exp(table - table.max(axis=0))
        return np.asarray((table / table.sum(axis=0)).mean(axis=1))

    def weight(self, one: Hypothesis, other: Hypothesis) -> float:
        """Return the pseudo-BMA+ weight of a model against another."""
        return float(self.weights_of([self.values(one), self.values(other)])[0])

    def most_to_gain(self, one: Hypothesis) -> float:
        """Return by how much one more effect could raise S at most: if nothing remained beyond the allowance."""
        excess, allowed = self.parts(one)
        rest = allowed[0] + self.noise.error
        gain = float(0.5 * STRETCHES * np.log1p(excess[0] / rest)[self.measured].sum())
        return gain + IMPOSSIBLE * self.cannot_be(one) - self.price

    def most_left(self, one: Hypothesis, least: float) -> float:
        """Return which share of its excess a model may leave, with one effect more, to reach a score of `least`.

        It is negative where that is out of reach, and 1 where nothing need close.
        """
        excess, allowed = self.parts(one)
        rest, measured = allowed[0] + self.noise.error, self.measured

        def lead(left: float) -> float:
            gain = 0.5 * STRETCHES * np.log((excess[0] + rest) / (left * excess[0] + rest))[measured].sum()
            return float(self.value(one) + gain + IMPOSSIBLE * self.cannot_be(one) - self.price) - least

        if lead(1.0) >= 0.0:
            return 1.0
        return float(brentq(lead, 0.0, 1.0)) if lead(0.0) >= 0.0 else -1.0


def _stated_error(label: str) -> float:
    """φ of a form where these recordings do not measure it."""
    if label == OWN_NUMBERS:
        return FREE_FORM_ERROR
    stated = form_of(*label.split("/")).error
    return FORMULA_ERROR if stated is None else stated


def drawn_weights(blocks: int) -> np.ndarray:
    """Return equal weights, and :data:`.rule_numbers.DRAWS` draws from a Dirichlet distribution, (DRAWS + 1, blocks).

    It is that of a bootstrap of so many stretches as are independent, because the blocks of a programme are not.
    """
    drawn = np.random.default_rng(0).gamma(min(STRETCHES / blocks, 1.0), size=(DRAWS, blocks)) + 1e-12
    return np.vstack([np.ones(blocks), drawn / drawn.mean(axis=1, keepdims=True)])
