# SPDX-License-Identifier: GPL-3.0-or-later
"""The level of the noise and its standard error, from blocks.

The noise is what is left without load by that model, of all that were tried, that leaves least there: while nothing touches the
sensor, or at texels that nothing touches. A drift, a lag or a coupling that a model lacks leaves more. The error is that of a
ratio of sums over blocks, so it is large for noise that is slow or common to all texels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .blocks import Sums
from .rule_numbers import LEAST_NOISE_ERROR, LEAST_VALUES


@dataclass(frozen=True)
class NoiseLevel:
    """Mean square of the noise of readings and of net forces.

    Attributes
    ----------
    rest, count : (b, 2) float
        Sum of squares and number of values without load, by blocks.
    error : (2,) float
        Standard error of the level.
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
    best = [min((_level(one, way, q), i, way) for i, one in enumerate(many) for way in (0, 1)) for q in (0, 1)]
    rest = np.stack([many[i].rest[way][:, q] for q, (_, i, way) in enumerate(best)], axis=1)
    count = np.stack([many[i].rest_count[way][:, q] for q, (_, i, way) in enumerate(best)], axis=1)
    total = count.sum(axis=0)
    level = np.where(total > 0, rest.sum(axis=0) / np.maximum(total, 1.0), 1.0)
    apart = rest - level * count
    used = np.maximum((count > 0).sum(axis=0), 2)
    error = np.sqrt((apart**2).sum(axis=0) * used / (used - 1)) / np.maximum(total, 1.0)
    return NoiseLevel(rest, count, np.maximum(error, LEAST_NOISE_ERROR * np.maximum(level, 1e-6)))


def measured_noise(count: np.ndarray, error: float = LEAST_NOISE_ERROR) -> NoiseLevel:
    """Return the noise as it was measured before any fit; `count` of values, (b, 2) float."""
    return NoiseLevel(count, count, np.full(2, error))


def _level(sums: Sums, way: int, quantity: int) -> float:
    """Mean square without load, by one of two ways; infinite where there are too few values."""
    count = sums.rest_count[way][:, quantity].sum()
    return float(sums.rest[way][:, quantity].sum() / count) if count >= LEAST_VALUES else np.inf
