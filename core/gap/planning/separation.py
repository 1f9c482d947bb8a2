# SPDX-License-Identifier: GPL-3.0-or-later
"""How well recordings separate two kinds of effects, as the forward model predicts it.

Each form of a kind is put on the base model with several values, or about those that were fitted. What that changes in the
predicted readings and net forces is a signal of the kind. The base model's parameters and the signals of a form of the rival
imitate as much of it as they can, by least squares; what the best form leaves separates the two (a T-optimal design: Atkinson
and Fedorov, Biometrika 62, 1975). Sums of products of signals are kept: a further recording is added.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...model.sensor import Effect
from ..candidates.candidates import Candidate, scales_of
from ..fitting.least_squares import FreeParameter, TrialView, coordinates_of, derivatives
from ..fitting.noise_floor import ChannelNoise
from ..forward.predictor import Model, Predictor

STARTS = 4
"""Values of each form whose signals are compared, spread over the ranges in which a form would show."""
TYPICAL = 0.04
"""Root mean square of a signal under load, as a share of full load: the least size of the hidden effects of
benchmarks/_hidden."""
IN_CONTACT = 0.05
"""Share of full load from which on a texel counts as loaded."""
LEAST_SHARE = 0.1
"""Share of a signal's square that a rival has to leave. By eye: a sensor's own formula differs from all that are known, so that
the right kind leaves a part of the gap as well."""
LEAST_SEPARATION = 5.0
"""Separation, in standard deviations of the noise, from which on two kinds are separated. By eye."""
MOST_SAMPLES, LEAST_RATE = 600, 20.0
"""Samples to which a recording is thinned, as long as so many a second are left."""
PATTERNS = 2
"""Random patterns of parameters of single texels whose signals are compared."""
LARGEST = 1e9
"""Signals with larger changes, in standard deviations of the noise, are left out: the form blows up at these values."""
RANK = 1e-9
"""Directions with a smaller share of the squares count as imitated by nobody."""


@dataclass(frozen=True)
class Separation:
    """How well recordings separate a kind that acts from a rival.

    Attributes
    ----------
    kind, other : str
        The kind that acts, and the rival that imitates it.
    share : float
        Median share of the square of the kind's signals, beside the base model, that the rival cannot imitate: 0 to 1.
    deviations : float
        Median size of that part, in standard deviations of the noise, of signals of a typical size.
    """

    kind: str
    other: str
    share: float
    deviations: float

    @property
    def is_separated(self) -> bool:
        """True if an effect of a typical size is distinguishable from the rival although its formula may be another one."""
        return self.share >= LEAST_SHARE and self.deviations >= LEAST_SEPARATION


@dataclass(frozen=True)
class Products:
    """Sums of products of signals over recordings, in units of the noise.

    Attributes
    ----------
    common : (p, p) float
        Of the base model's derivatives and of all signals.
    coupling : (q, p, n) float
        Of these with the derivatives by parameters of single texels.
    texel : (q, q, n) float
        Of the latter with each other.
    loaded : float
        Number of values under load.
    """

    common: np.ndarray
    coupling: np.ndarray
    texel: np.ndarray
    loaded: float

    def __add__(self, other: Products) -> Products:
        """Return the sums over two sets of recordings."""
        return Products(*(one + another for one, another in zip(vars(self).values(), vars(other).values(), strict=True)))


class Signals:
    """The signals of kinds of effects about a base model.

    Parameters
    ----------
    model : Model
        The base model.
    free : sequence of FreeParameter
        Its free parameters.
    candidates : sequence of Candidate
    fitted : sequence of Predictor
        The recordings.
    noise : (ChannelNoise, ChannelNoise)
        Of readings and net forces.
    known : mapping of str to Effect, optional
        Kinds that were fitted: the signal is that of the fitted effect, and the derivatives by its parameters imitate others.
    """

    def __init__(
        self,
        model: Model,
        free: Sequence[FreeParameter],
        candidates: Sequence[Candidate],
        fitted: Sequence[Predictor],
        noise: tuple[ChannelNoise, ChannelNoise],
        known: Mapping[str, Effect] | None = None,
    ):
        scales = scales_of(fitted, model)
        self._model, self._free, self._noise, self._touched = model, tuple(free), noise, IN_CONTACT * scales.force
        forces = [float(np.nanmax(np.abs(p.trial.force))) for p in fitted if p.trial.force is not None]
        read = any(p.trial.reading is not None for p in fitted)
        full = scales.reading / noise[0].deviation if read else max(forces) / noise[1].deviation
        self._known = known or {}
        self._typical = TYPICAL * full  # in units of the noise
        gain = model.parameters.gain
        self._effects: list[tuple[Effect, tuple[FreeParameter, ...]]] = []  # with parameters whose derivatives are signals, too
        self._forms: dict[str, list[tuple[range, range]]] = {}  # columns in sums of products: common ones, and of texels
        p, q = len(self._free), 0
        for one in candidates:
            items = tuple(one.free_parameters(len(model.effects), scales, gain))
            texel = tuple(item for item in items if item.per_texel)
            if texel:
                effects = [(one.effect({}, scales.texels, gain), texel)]
            elif one.name in self._known:
                effects = [(self._known[one.name], items)]
            else:
                starts = one.starting_values(scales, gain, STARTS)
                effects = [(one.effect(values, scales.texels, gain), ()) for values in starts]
            self._effects += effects
            own = PATTERNS * len(texel) or sum(1 + len(with_derivatives) for _, with_derivatives in effects)
            self._forms.setdefault(one.name, []).append((range(p, p + own), range(q, q + len(texel))))
            p, q = p + own, q + len(texel)
        self._width = p, q

    def products(self, predictors: Sequence[Predictor]) -> Products:
        """Return the sums of products over recordings. What is not recorded yet counts where it is not None."""
        first, *others = map(self._of_recording, predictors)
        return sum(others, first)

    def _of_recording(self, predictor: Predictor) -> Products:
        time = predictor.trial.time
        stride = max(1, min(len(time) // MOST_SAMPLES, int(1.0 / (LEAST_RATE * predictor.trial.step))))
        deviations = self._noise[0].deviation, self._noise[1].deviation
        view = TrialView(predictor, None, slice(None, None, stride), deviations)
        start = view.residual(self._model)
        n, (p, q) = len(view.texels), self._width
        common, texel = np.zeros((p, *start.shape)), np.zeros((q, len(start), n))
        at = coordinates_of(self._model, self._free)
        derivatives(view, self._model, self._free, at, start, common[: len(self._free)], 0)
        row, own = len(self._free), 0
        rng = np.random.default_rng(0)
        for effect, items in self._effects:
            model = self._model.with_effect(effect)
            there, table = view.residual(model), np.empty((len(items), *start.shape))
            derivatives(view, model, items, coordinates_of(model, items), there, table, 0)
            if not any(item.per_texel for item in items):
                common[row : row + 1 + len(items)] = start - there, *table
                row += 1 + len(items)
                continue
            for change in table[:, :, :n]:
                texel[own] = change
                for _ in range(PATTERNS):
                    common[row, :, :n] = change * rng.normal(size=n)
                    row += 1
                own += 1
        for signal in (*common, *texel):
            if not np.abs(signal).max() < LARGEST:
                signal[...] = 0.0
        flat = common.reshape(p, -1)
        load = np.abs(predictor.normal_force(self._model)[::stride])
        loaded = (load > self._touched).sum() if predictor.trial.reading is not None else 0
        pressed = (load.max(axis=1) > self._touched).sum() if predictor.trial.force is not None else 0
        return Products(
            flat @ flat.T,
            np.einsum("qtn,ptn->qpn", texel, common[:, :, :n], optimize=True),
            np.einsum("qtn,rtn->qrn", texel, texel),
            float(loaded + pressed) / max(self._noise[0].correlation_time / stride, 1.0),
        )

    def separation(self, products: Products, kind: str, other: str) -> Separation:
        """Return how well a kind that acts is separated from a rival."""
        base, signals = range(len(self._free)), [column for common, _ in self._forms[kind] for column in common]
        signals = signals[:1] if kind in self._known else signals
        whole, alone = np.diagonal(products.common)[signals], _residuals(products, base, (), signals)
        left = np.min([_residuals(products, (*base, *common), texel, signals) for common, texel in self._forms[other]], axis=0)
        acts = alone > RANK * np.maximum(whole, 1e-300)
        if not acts.any():
            return Separation(kind, other, 0.0, 0.0)
        size = self._typical * np.sqrt(products.loaded * left[acts] / whole[acts])
        return Separation(kind, other, float(np.median(left[acts] / alone[acts])), float(np.median(size)))


def _residuals(products: Products, columns: Sequence[int], texel: Sequence[int], signals: Sequence[int]) -> np.ndarray:
    """Return the residual squares of k signals after least squares on columns and on texels' parameters, (k,) float."""
    both = [*columns, *signals]
    gram = products.common[np.ix_(both, both)]
    size = np.sqrt(np.where(np.diagonal(gram) > 0.0, np.diagonal(gram), 1.0))
    if texel:
        coupling = products.coupling[list(texel)][:, both]
        own = products.texel[np.ix_(texel, texel)].transpose(2, 0, 1)
        ridge = RANK * (1.0 + np.einsum("nqq->nq", own))[:, :, None] * np.eye(len(texel))
        follow = np.linalg.solve(own + ridge, coupling.transpose(2, 0, 1))
        gram = gram - np.einsum("qpn,nqs->ps", coupling, follow)
    gram = gram / size[:, None] / size
    m = len(columns)
    values, axes = np.linalg.eigh(gram[:m, :m])
    kept = values > RANK * m
    along = axes[:, kept].T @ gram[:m, m:]
    left = np.diagonal(gram)[m:] - (along**2 / values[kept][:, None]).sum(axis=0)
    return np.maximum(left, 0.0) * size[m:] ** 2
