# SPDX-License-Identifier: GPL-3.0-or-later
"""Noise that grows with the reading: what no fit can close, told by the squares of the residual.

It is named when the residual of loaded samples is larger than that of unloaded ones, the more so the larger the reading, and
otherwise as noise is: new at every sample, and another one in each texel. What is left of a model that lacks something else is
neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...model.effect import Effect
from ..forward.predictor import Model
from .least_squares import TrialView

LEAST_VARIANCE_RATIO = 1.5
"""Least mean square of the residual at large readings, in units of that at rest."""
MOST_CORRELATION = 0.15
"""Largest correlation with the sample before, beyond that at rest, and between texels."""


@dataclass(frozen=True)
class _LoadedSamples:
    """Loaded samples of one trial: size of the reading and squares of the residual, both in units of the noise."""

    size: np.ndarray
    square: np.ndarray
    serial_correlation: float
    texel_correlation: float


def proportional_noise(views: Sequence[TrialView], model: Model) -> Effect | None:
    """Return noise in proportion to the reading where a model's residual is that; None where it is not.

    Parameters
    ----------
    shares : sequence of TrialView
        Whole trials, with readings.
    model : Model
        As it was fitted, without noise.
    """
    found, rest = [], []
    for view in views:
        reading = view.predictor.trial.reading
        if reading is None:
            continue
        residual = view.residual(model)[:, : reading.shape[1]]
        size = np.abs(view.predictor.predict(model).reading - model.parameters.zero) / view.noise[0]
        known = np.isfinite(reading)
        rest.append(residual[known & (size < 1.0)])
        found.append(_loaded_samples(size, residual, known & (size > 3.0)))
    still = np.concatenate(rest) if rest else np.zeros(0)
    if len(still) < 100 or sum(len(one.size) for one in found) < 400:
        return None
    floor = max(float(np.mean(still * still)), 1e-6)
    size, square = (np.concatenate([getattr(one, name) for one in found]) for name in ("size", "square"))
    each, pooled = (
        [_variance_coefficient(one.size, one.square, floor) for one in found if len(one.size) > 100],
        _variance_coefficient(size, square, floor),
    )
    large = square[size > np.quantile(size, 0.67)]
    small = square[size < np.quantile(size, 0.33)]
    grows = large.mean() > LEAST_VARIANCE_RATIO * floor and large.mean() > 1.2 * small.mean()
    steady = pooled > 0.0 and min(each, default=0.0) > 0.3 * pooled and max(each, default=0.0) < 3.0 * pooled
    weight = np.array([len(one.size) for one in found], float)
    serial_correlation = float(np.average([one.serial_correlation for one in found], weights=weight))
    texel_correlation = float(np.average([one.texel_correlation for one in found], weights=weight))
    if not (grows and steady and serial_correlation < MOST_CORRELATION and texel_correlation < MOST_CORRELATION):
        return None
    return Effect("noise", "proportional", {"share": float(np.sqrt(pooled))})


def _loaded_samples(size: np.ndarray, residual: np.ndarray, loaded: np.ndarray) -> _LoadedSamples:
    """Correlations are of residuals in units of their local size, so that few large ones do not decide.

    Only large readings count there: at small ones the noise that is always there hides what a model lacks.
    """
    large = loaded & (size > np.quantile(size[loaded], 0.67)) if loaded.any() else loaded
    unit = np.where(large, residual / np.maximum(size, 1.0), 0.0)
    both = large[1:] & large[:-1]
    square = float((unit * unit).sum())
    serial_correlation = float((unit[1:] * unit[:-1])[both].sum()) / max(square, 1e-300)
    together = unit.sum(axis=1)
    pairs = float((together * together).sum()) - square
    count = large.sum(axis=1)
    possible = float((count * (count - 1)).sum()) / max(float(count.sum()), 1.0)
    texel_correlation = pairs / max(square * possible, 1e-300) if possible > 0 else 0.0
    return _LoadedSamples(size[loaded], residual[loaded] ** 2, serial_correlation, texel_correlation)


def _variance_coefficient(size: np.ndarray, square: np.ndarray, floor: float) -> float:
    """Square of the share of the reading that trembles: weighted least squares of the squares on those of the reading."""
    squares, value = size**2, 0.0
    for _ in range(4):
        weight = 1.0 / (floor + value * squares) ** 2
        value = max(float((weight * (square - floor) * squares).sum() / (weight * squares * squares).sum()), 0.0)
    return value
