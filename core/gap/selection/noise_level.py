# SPDX-License-Identifier: GPL-3.0-or-later
"""The level of the noise and its standard error, from blocks.

The noise is the residual without load (before contact, or at texels out of contact) of the model with the smallest one there. A
missing drift, lag or coupling would enlarge that residual. With few unloaded readings, the noise is the value measured before
any fit.

The error is that of the mean square of noise over all values less the one without load: each has that of a ratio of sums over
blocks, so it is large for noise that is slow or common to all texels, and never below that of white noise, √(2/N).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .rule_numbers import LEAST_NOISE_ERROR, LEAST_VALUES

ROUNDING = 1e-6
"""Least mean square of noise-free recordings, in units of the variance measured before any fit: rounding of their files."""
WHITE = 2.0
"""Variance of the square of a standard normal variable (chi-squared with one degree of freedom)."""


@dataclass(frozen=True)
class Sums:
    """Sums over each of b blocks, for readings and net forces, in units of the noise's variance: (b, 2) float each.

    Attributes
    ----------
    left, count : (b, 2) float
        Squares that a model leaves on unseen blocks, and the number of values.
    rest, rest_count : (2, b, 2) float
        The same of values without load: while nothing touches the sensor, and of texels that nothing touches.
    changes : (components, b, 2) float
        Squares of the change of the prediction that each component of the model makes, beyond a factor and a zero.
    """

    left: np.ndarray
    count: np.ndarray
    rest: np.ndarray
    rest_count: np.ndarray
    changes: np.ndarray


@dataclass(frozen=True)
class NoiseLevel:
    """Mean square of the noise of readings and of net forces.

    Attributes
    ----------
    rest, count : (b, 2) float
        Sum of squares and number of values without load, by blocks.
    error : (2,) float
        Standard error of the mean square that a right model leaves, less the level.
    """

    rest: np.ndarray
    count: np.ndarray
    error: np.ndarray

    def under(self, weights: np.ndarray) -> np.ndarray:
        """Return the mean square with weights of the blocks, (..., b) → (..., 2)."""
        count = weights @ self.count
        return np.where(count > 0, weights @ self.rest / np.maximum(count, 1e-9), 1.0)


def noise_level(many: Sequence[Sums]) -> NoiseLevel:
    """Return the noise by what the best of many models leaves without load, for readings and for net forces."""
    measured = measured_noise(many[0].count)
    rest, count, error = measured.rest.copy(), measured.count.copy(), measured.error.copy()
    for q in (0, 1):
        level, i, way = min((_level(one, way, q), i, way) for i, one in enumerate(many) for way in (0, 1))
        if np.isfinite(level):
            level = max(level, ROUNDING)
            rest[:, q], count[:, q] = many[i].rest[way][:, q], many[i].rest_count[way][:, q]
            share = _variance(rest[:, q], count[:, q]) / level**2
            error[q] = level * _error(count[:, q].sum(), many[i].count[:, q].sum(), share)
    return NoiseLevel(rest, count, error)


def measured_noise(count: np.ndarray, error: float = LEAST_NOISE_ERROR) -> NoiseLevel:
    """Return the noise measured before any fit, of `count` values, (b, 2) float, with at least the standard error `error`."""
    return NoiseLevel(count, count, np.array([max(_error(values, values, WHITE), error) for values in count.sum(axis=0)]))


def _variance(rest: np.ndarray, count: np.ndarray) -> float:
    """Variance of the sum of squares of noise in a block, for each of its values."""
    total, used = count.sum(), max((count > 0).sum(), 2)
    apart = rest - rest.sum() / total * count
    return float((apart**2).sum() * used / (used - 1) / total)


def _error(rest: float, values: float, variance: float) -> float:
    """Standard error of the mean square of noise over `values` values less its level from `rest` values, in levels."""
    level, over_all = (max(variance, WHITE) / max(count, 1.0) for count in (rest, values))
    return float(np.sqrt(max(level, LEAST_NOISE_ERROR**2) + over_all))


def _level(sums: Sums, way: int, quantity: int) -> float:
    """Mean square without load, by one of two ways; infinite where there are too few values."""
    count = sums.rest_count[way][:, quantity].sum()
    return float(sums.rest[way][:, quantity].sum() / count) if count >= LEAST_VALUES else np.inf
