# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimates with confidence intervals, after linear and nonlinear least squares."""

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
        """Return the estimate of ``factor · value``; `factor` must be positive."""
        return Estimate(factor * self.value, factor * self.low, factor * self.high)

    def text(self, unit: str = "") -> str:
        """Return the estimate in words: ``58.4 N/m (95 %: 55.1 to 61.7)``."""
        return f"{self.value:.4g}{f' {unit}' if unit else ''} (95 %: {self.low:.4g} to {self.high:.4g})"


def student_quantile(freedom: float) -> float:
    """Return the 97.5 % quantile of Student's t; infinite without degrees of freedom, since the scatter is then unknown."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975)) if freedom > 0 else float("inf")


def linear_estimates(columns: np.ndarray, values: np.ndarray) -> list[Estimate]:
    """Return the estimates of ordinary least squares, ``values ≈ columns @ coefficients``.

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
    return confidence_intervals(coefficients, spread, freedom)


def linearised_estimates(
    values: np.ndarray, jacobian: np.ndarray, transformation: np.ndarray, residual: np.ndarray, scale: float = 1.0
) -> list[Estimate]:
    """Return the estimates of nonlinear least squares, with the model linearised at the solution.

    Parameters
    ----------
    values : (p,) float
        Solution.
    jacobian : (m, p) float
        Derivatives of ``residual / scale`` with respect to the variables of the search.
    transformation : (p, p) float
        Derivatives of `values` with respect to the variables of the search.
    residual : (m,) float
        At the solution.
    scale : float
        Unit in which the search measured the residuals.

    Returns
    -------
    list of p Estimate
        The interval of a variable on which no residual depends is infinite.
    """
    freedom = len(residual) - len(values)
    covariance = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-14) * (residual @ residual) / scale**2 / max(freedom, 1)
    spread = np.sqrt(np.clip(np.diag(transformation @ covariance @ transformation.T), 0.0, None))
    spread[np.linalg.norm(jacobian, axis=0) < 1e-9 * np.linalg.norm(jacobian)] = np.inf
    return confidence_intervals(values, spread, freedom)


def confidence_intervals(values: np.ndarray, spread: np.ndarray, freedom: int) -> list[Estimate]:
    """Return estimates from values (p,), their standard errors (p,) and the degrees of freedom of those errors."""
    if freedom <= 0:
        return [Estimate(float(value), float("-inf"), float("inf")) for value in values]
    reach = student_quantile(freedom) * spread
    return [Estimate(float(v), float(v - r), float(v + r)) for v, r in zip(values, reach, strict=True)]
