# SPDX-License-Identifier: GPL-3.0-or-later
"""What the fits share: an estimate with its interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Estimate:
    """A fitted number and its 95 % confidence interval."""

    value: float
    low: float
    high: float

    def scaled(self, factor: float) -> Estimate:
        """Return the estimate of ``factor · value``; `factor` is positive."""
        return Estimate(factor * self.value, factor * self.low, factor * self.high)

    def text(self, unit: str = "") -> str:
        """Return it in words: ``58.4 N/m (95 %: 55.1 to 61.7)``."""
        return f"{self.value:.4g}{f' {unit}' if unit else ''} (95 %: {self.low:.4g} to {self.high:.4g})"


def student(freedom: float) -> float:
    """97.5 % quantile of Student's t; infinite without a degree of freedom, since nothing tells the scatter then."""
    from scipy.stats import t

    return float(t.ppf(0.975, freedom)) if freedom > 0 else float("inf")


def linear_estimates(columns: np.ndarray, values: np.ndarray) -> list[Estimate]:
    """Ordinary least squares of ``values ≈ columns @ coefficients`` with Student intervals.

    Parameters
    ----------
    columns : (m, p) float
        Of full rank.
    values : (m,) float

    Returns
    -------
    list of p Estimate
    """
    coefficients, *_ = np.linalg.lstsq(columns, values, rcond=None)
    freedom = len(values) - columns.shape[1]
    residual = values - columns @ coefficients
    variance = float(residual @ residual) / freedom if freedom > 0 else 0.0
    spread = np.sqrt(variance * np.diag(np.linalg.inv(columns.T @ columns)))
    return intervals(coefficients, spread, freedom)


def intervals(values: np.ndarray, spread: np.ndarray, freedom: int) -> list[Estimate]:
    """Estimates from values, their standard errors and the degrees of freedom behind those."""
    if freedom <= 0:
        return [Estimate(float(value), float("-inf"), float("inf")) for value in values]
    reach = student(freedom) * spread
    return [Estimate(float(v), float(v - r), float(v + r)) for v, r in zip(values, reach, strict=True)]
