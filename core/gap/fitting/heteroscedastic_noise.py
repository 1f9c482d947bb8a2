# SPDX-License-Identifier: GPL-3.0-or-later
"""Heteroscedastic noise: noise whose standard deviation is proportional to the reading, which no fit can explain.

It is found from the squares of a residual. They must grow with the reading, and otherwise the residual must be like white
noise: uncorrelated in time and between texels. The residual of a model that lacks something else is correlated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.engine.declarations import SCATTER
from ...effects.engine.registry import only_name_where
from ...model.effect import Effect
from ..forward.predictor import Model
from .least_squares import TrialView

NOISE = only_name_where(lambda kind: kind.found_by == SCATTER)

LEAST_VARIANCE_RATIO = 1.5
"""Least mean square of the residual at large readings, in units of that at rest."""
LEAST_GROWTH = 1.2
"""Least ratio of the mean squares at large and at small readings."""
MOST_CORRELATION = 0.15
"""Largest correlation with the sample before, and between texels."""
RESTING, LOADED = 1.0, 3.0
"""Readings below and above which a sample counts as resting and as loaded, in standard deviations of the noise."""
LEAST_RESTING, LEAST_LOADED, LEAST_IN_TRIAL = 100, 400, 100
"""Least number of resting samples, of loaded ones, and of loaded ones in a trial for the trial to be judged by itself."""
LARGE_QUANTILE, SMALL_QUANTILE = 0.67, 0.33
"""Quantiles of the loaded readings that bound the large and the small ones."""
STEADY = (0.3, 3.0)
"""Bounds of each trial's coefficient, as multiples of that of all trials."""


@dataclass(frozen=True)
class _LoadedSamples:
    """Loaded samples of one trial.

    Attributes
    ----------
    size : (m,) float
        Magnitude of the predicted readings, in units of the noise.
    square : (m,) float
        Squares of the residual, in the same unit.
    serial_correlation, texel_correlation : float
        Of the residual: with the sample before, and between texels.
    """

    size: np.ndarray
    square: np.ndarray
    serial_correlation: float
    texel_correlation: float


def proportional_noise(views: Sequence[TrialView], model: Model) -> Effect | None:
    """Return noise in proportion to the reading if a model's residual is like that, else None.

    Parameters
    ----------
    views : sequence of TrialView
        Whole trials.
    model : Model
        A fitted model without noise.
    """
    found, rest = [], []
    for view in views:
        reading = view.predictor.trial.reading
        if reading is None:
            continue
        residual = view.residual(model)[:, : reading.shape[1]]
        size = np.abs(view.predictor.predict(model).reading - model.parameters.zero) / view.noise[0]
        known = np.isfinite(reading)
        rest.append(residual[known & (size < RESTING)])
        found.append(_loaded_samples(size, residual, known & (size > LOADED)))
    still = np.concatenate(rest) if rest else np.zeros(0)
    if len(still) < LEAST_RESTING or sum(len(one.size) for one in found) < LEAST_LOADED:
        return None
    floor = max(float(np.mean(still * still)), 1e-6)
    size, square = (np.concatenate([getattr(one, name) for one in found]) for name in ("size", "square"))
    each, pooled = (
        [_variance_coefficient(one.size, one.square, floor) for one in found if len(one.size) > LEAST_IN_TRIAL],
        _variance_coefficient(size, square, floor),
    )
    large = square[size > np.quantile(size, LARGE_QUANTILE)]
    small = square[size < np.quantile(size, SMALL_QUANTILE)]
    if not (len(large) and len(small)):  # all readings are equal, as at the rail of a converter
        return None
    grows = large.mean() > LEAST_VARIANCE_RATIO * floor and large.mean() > LEAST_GROWTH * small.mean()
    steady = pooled > 0.0 and min(each, default=0.0) > STEADY[0] * pooled and max(each, default=0.0) < STEADY[1] * pooled
    weight = np.array([len(one.size) for one in found], float)
    serial_correlation = float(np.average([one.serial_correlation for one in found], weights=weight))
    texel_correlation = float(np.average([one.texel_correlation for one in found], weights=weight))
    if not (grows and steady and serial_correlation < MOST_CORRELATION and texel_correlation < MOST_CORRELATION):
        return None
    return Effect(NOISE, "proportional", {"share": float(np.sqrt(pooled))})


def _loaded_samples(size: np.ndarray, residual: np.ndarray, loaded: np.ndarray) -> _LoadedSamples:
    """Loaded samples of a trial, with correlations of the large ones.

    Correlations are of residuals in units of the local reading, so that a few large ones do not decide. At small readings the
    noise at rest would hide what a model lacks.
    """
    large = loaded & (size > np.quantile(size[loaded], LARGE_QUANTILE)) if loaded.any() else loaded
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
    """Variance of the noise divided by the squared reading, by weighted least squares."""
    squares, value = size**2, 0.0
    for _ in range(4):
        weight = 1.0 / (floor + value * squares) ** 2
        value = max(float((weight * (square - floor) * squares).sum() / (weight * squares * squares).sum()), 0.0)
    return value
