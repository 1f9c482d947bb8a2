# SPDX-License-Identifier: GPL-3.0-or-later
"""Which kinds some recordings can tell apart, computed from their stimulus and noise before any effect is fitted.

A kind's signal is what it would add to the readings and net forces. Another kind imitates a part of it, together with the base
model's own parameters. The share that is left, of the signal's square beside the base model, says whether these recordings tell
the two apart: next to nothing for a height error and a dead zone under a flat indenter, most for creep and hysteresis where
loads were held.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass

import numpy as np

from ..dataset.trial import Trial
from .bounded_least_squares import bounded_minimum
from .columns import BASE, TEXEL
from .decision_numbers import FLOOR, FLOOR_DEVIATIONS, LEAST_EXCESS, LEAST_SHARE_TOLD, PRIORS, TOLD_APART, TYPICAL_SIZE
from .dictionaries import MISALIGNMENT, VARIANTS, Variant
from .normal_equations import NormalEquations, normal_equations
from .recorded import Recorded, planned


@dataclass(frozen=True)
class KindSignal:
    """What a kind adds to the recordings, as products with all columns of some normal equations.

    Attributes
    ----------
    kind, label : str
        Of which kind, and which of its directions.
    right : (p,) float
    square : float
        Sum of squares, in units of the noise.
    texel_right : (q, n) float
        Products with the columns of parameters of single texels.
    """

    kind: str
    label: str
    right: np.ndarray
    square: float
    texel_right: np.ndarray

    def scaled(self, factor: float) -> KindSignal:
        """Return a signal that is so many times as large."""
        return KindSignal(self.kind, self.label, factor * self.right, factor * factor * self.square, factor * self.texel_right)


@dataclass(frozen=True)
class Distinction:
    """Share of a kind's signal that another kind cannot imitate.

    Attributes
    ----------
    signal, other : str
        Direction of the kind that acts, as "hysteresis/leading", and the kind that is taken for it.
    share : float
        Of the square of its signal, that the other kind cannot imitate: 0 to 1.
    smallest : float
        Least effect that is distinguishable from the other kind: root mean square of its change of the
        readings, full load being 1.
    """

    signal: str
    other: str
    share: float
    smallest: float

    @property
    def is_told(self) -> bool:
        """True if an effect of a usual size is distinguishable from the other kind, although its formula may be another one."""
        return self.margin >= 1.0

    @property
    def margin(self) -> float:
        """From 1 on it is told: the smaller one of the share and of the square of an effect's usual size, each by what it has
        to be at least.
        """
        return min(self.share / LEAST_SHARE_TOLD, (TOLD_APART / max(self.smallest, 1e-12)) ** 2)


COMPARED_KINDS = frozenset(variant.kind for variant in (*VARIANTS, MISALIGNMENT))
"""Names of all kinds that can be compared. Friction, noise, steps and dead texels are none of these."""


def possible_variants(recorded: Recorded, possible: Set[str]) -> list[Variant]:
    """Return the variants of the kinds that recordings could show."""
    several = recorded.texel_count > 1
    found = [
        v
        for v in VARIANTS
        if v.kind in possible and (several or not v.needs_neighbours) and (recorded.has_readings or v.in_contact)
    ]
    if recorded.source.can_move and MISALIGNMENT.kind in possible:
        found.append(MISALIGNMENT)
    return found


class Comparison:
    """Kinds that are compared on recordings, and on recordings with one more that was not made yet.

    Parameters
    ----------
    recorded : Recorded
    possible : set of str
        Names of the kinds to compare.
    """

    def __init__(self, recorded: Recorded, possible: Set[str]):
        self.recorded = recorded
        self._variants = possible_variants(recorded, possible)
        self._equations = normal_equations(recorded, self._variants)

    def distinctions(self, further: Trial | None = None, wanted: Set[tuple[str, str]] | None = None) -> list[Distinction]:
        """Return for each kind, in each of its directions, how well it is told from each other kind.

        Parameters
        ----------
        further : Trial, optional
            One recording more, of which only the stimulus counts.
        wanted : set of (str, str), optional
            Directions of kinds and the kinds to distinguish them from; all of them by default.
        """
        equations = self._equations
        if further is not None:
            equations = equations + normal_equations(planned(self.recorded, further), self._variants)
        variants, recorded = self._variants, self.recorded
        kinds = list(dict.fromkeys(variant.kind for variant in variants))
        floor = _floor(equations.count, recorded.correlation)
        found = []
        for signal in [one for variant in variants for one in signals_of(equations, variant)]:
            against = [k for k in kinds if k != signal.kind and (wanted is None or (signal.label, k) in wanted)]
            alone = left_by(equations, signal, ()) if against else 0.0
            for kind in against:
                others = [variant for variant in variants if variant.kind == kind]
                left = min(left_by(equations, one, (other,)) for one in _both_signs(signal, variants) for other in others)
                share = min(left / alone, 1.0) if alone > 0.0 else 0.0
                smallest = _smallest(recorded.noise[0 if recorded.has_readings else 1], floor, share * alone / signal.square)
                found.append(Distinction(signal.label, kind, share, smallest))
        return found


def _floor(count: float, correlation: float) -> float:
    """What no fit resolves of so many measured values, as a share of the noise, and of the scatter of its mean square."""
    return FLOOR + FLOOR_DEVIATIONS * float(np.sqrt(2.0 / max(count / correlation, 1.0)))


def _both_signs(signal: KindSignal, variants: Sequence[Variant]) -> list[KindSignal]:
    """A signal, and its negative if the kind has either sign: one of them may be easier to imitate."""
    is_signed = any(variant.kind == signal.kind and (variant.is_signed or bool(variant.texel_columns)) for variant in variants)
    return [signal, signal.scaled(-1.0)] if is_signed else [signal]


def _smallest(noise: float, floor: float, share: float) -> float:
    """Root mean square, as a share of full load, from which on the excess that is left decides; the rest is imitated."""
    least = floor * LEAST_EXCESS
    return float(noise * np.sqrt(least / share)) if share > 1e-9 else np.inf


def signals_of(equations: NormalEquations, variant: Variant) -> list[KindSignal]:
    """Return what a variant adds: the sum of its columns, each as large as the others beside the base model.

    A displacement of the texels has three signals: sideways, in height, and turned. Parameters of single texels are drawn with
    a fixed seed. All are as large as a usual effect.
    """
    own = equations.at[variant.label]
    parts = {variant.label: list(own)}
    if variant is MISALIGNMENT:
        parts = {f"{variant.label}/{name}": [own[i] for i in picked] for name, picked in _POSE_SIGNALS.items()}
    found = []
    for label, columns in parts.items():
        signal = _signal(equations, variant, label, columns)
        if signal.square > 0.0:
            found.append(signal.scaled(np.sqrt(TYPICAL_SIZE**2 * equations.count / signal.square)))
    return found


_POSE_SIGNALS = {"sideways": (0, 1), "height": (2,), "turned": (3, 4, 5)}


def _signal(equations: NormalEquations, variant: Variant, label: str, columns: list[int]) -> KindSignal:
    gram, coupling, texel_gram = equations.gram, equations.coupling, equations.texel_gram
    weights = np.zeros(len(gram))
    for column in columns:
        unit = KindSignal(variant.kind, label, gram[:, column], float(gram[column, column]), coupling[:, column])
        beside = left_by(equations, unit, ())
        if beside > 1e-12 * max(unit.square, 1e-300):
            weights[column] = beside**-0.5
    pattern = np.zeros(texel_gram.shape[1:])
    for name in variant.texel_columns:
        index = TEXEL.index(name)
        size = np.sqrt(max(len(columns), 1)) / np.sqrt(max(float(texel_gram[index, index].sum()), 1e-300))
        pattern[index] = size * np.random.default_rng(index).normal(size=pattern.shape[1])
    right = gram @ weights + np.einsum("qpn,qn->p", coupling, pattern)
    square = float(weights @ gram @ weights + 2.0 * weights @ np.einsum("qpn,qn->p", coupling, pattern))
    square += float(np.einsum("qn,qrn,rn->", pattern, texel_gram, pattern))
    texel_right = np.einsum("qpn,p->qn", coupling, weights) + np.einsum("qrn,rn->qn", texel_gram, pattern)
    return KindSignal(variant.kind, label, right, square, texel_right)


def left_by(equations: NormalEquations, signal: KindSignal, others: Sequence[Variant]) -> float:
    """Return the sum of squares of a signal that the base model and some variants leave.

    Parameters
    ----------
    equations : NormalEquations
        About the base model alone.
    signal : KindSignal
    others : sequence of Variant
        With coefficients of any size on their own side of zero: how much of a small effect they imitate does not depend on it.
    """
    sides = [(equations.at[name], -np.inf) for name in BASE if name in equations.at]
    base = sum(len(columns) for columns, _ in sides)
    sides += [(equations.at[variant.label], -np.inf if variant.is_signed else 0.0) for variant in others]
    picked = [column for columns, _ in sides for column in columns]
    low = np.array([least for columns, least in sides for _ in columns])
    own = [TEXEL.index(name) for variant in others for name in variant.texel_columns]
    gram, right, square = equations.gram[np.ix_(picked, picked)], signal.right[picked], signal.square
    if own:
        coupling = equations.coupling[own][:, picked]
        block = equations.texel_gram[np.ix_(own, own)]
        for i, index in enumerate(own):
            block[i, i] += PRIORS[TEXEL[index]] ** -2
        inverse = np.moveaxis(np.linalg.inv(np.moveaxis(block, 2, 0)), 0, 2)
        across = np.einsum("qrn,rpn->qpn", inverse, coupling)
        gram = gram - np.einsum("qpn,qsn->ps", coupling, across)
        right = right - np.einsum("qpn,qn->p", across, signal.texel_right[own])
        square -= float(np.einsum("qn,qrn,rn->", signal.texel_right[own], inverse, signal.texel_right[own]))
    start = np.zeros(len(low))
    start[:base] = np.linalg.lstsq(gram[:base, :base], right[:base], rcond=None)[0]
    x = bounded_minimum(gram, right, low, start)
    return max(float(square - 2.0 * x @ right + x @ gram @ x), 0.0)
