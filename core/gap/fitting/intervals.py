# SPDX-License-Identifier: GPL-3.0-or-later
"""95 % intervals of the parameters of a fitted model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .least_squares import TEXEL_PRECISION, Fit, NormalEquations, summed_equations, value_of


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


def student_quantile(freedom: np.ndarray | float) -> np.ndarray | float:
    """Return the 97.5 % quantile of Student's t for some degrees of freedom, above zero."""
    from scipy.special import stdtrit

    return stdtrit(freedom, 0.975)


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


NORMAL_QUANTILE = 1.959964
"""97.5 % quantile of the standard normal distribution."""
UNIDENTIFIED = 1e-8
"""Eigenvalue of the normal equations, scaled to a diagonal of ones, up to which a direction is unidentified: two drags that
only act as their sum, for example."""
UNIDENTIFIED_EIGENVALUE = 1e-4 * UNIDENTIFIED
"""Eigenvalue that unidentified directions get instead, so that their variance is very large."""
TOUCHED_SHARE = 1e-9
"""A texel counts as touched if its information is above this share of the largest."""


@dataclass(frozen=True)
class ParameterInterval:
    """A fitted parameter with its 95 % interval.

    Attributes
    ----------
    effect : int
        Index of the effect in the model's stack; -1 for the base model.
    name : str
    value, low, high : float
    bounds : (float, float)
        Within which the parameter was fitted.
    """

    effect: int
    name: str
    value: float
    low: float
    high: float
    bounds: tuple[float, float] = (-np.inf, np.inf)

    @property
    def fills_bounds(self) -> bool:
        """True if the recordings tell no more of the parameter than its bounds do."""
        return self.low <= self.bounds[0] and self.high >= self.bounds[1]


def parameter_intervals(found: Fit) -> list[ParameterInterval]:
    """Return intervals of the fitted parameters that all texels share.

    Each interval is the widest of four:

    - of white noise with the variance that was measured without load;
    - from the scatter of the gradients of channels within about a second, which holds for coloured noise and for residuals of
      unequal size;
    - from the scatter of the gradients of texels over whole trials, which holds for noise of any colour;
    - from the scatter of the gradients of whole trials, which holds if the formula is not quite the sensor's.

    If few channels or trials inform about a parameter, as about friction, the last two have too few gradients: they sum to zero
    at the end of the fit. Then they hold for the other parameters only.

    Parameters
    ----------
    found : Fit
        With normal equations.
    """
    common = [item for item in found.free if not item.per_texel]
    if not common:
        return []
    kinds = _covariances(found)
    made = []
    for i, item in enumerate(common):
        at = float(item.to_coordinate(value_of(found.model, item)))
        spread = NORMAL_QUANTILE * max(float(np.sqrt(max(kind[i, i], 0.0))) for kind in kinds)
        ends = sorted((float(item.from_coordinate(at - spread)), float(item.from_coordinate(at + spread))))
        value = float(value_of(found.model, item))
        made.append(ParameterInterval(item.effect, item.name, value, ends[0], ends[1], (item.low, item.high)))
    return made


def _covariances(found: Fit) -> tuple[np.ndarray, ...]:
    """Covariances (p, p) of the common parameters in their coordinates, four of them (see :func:`parameter_intervals`)."""
    assert found.equations is not None
    total = summed_equations([one for trial in found.equations for one in trial])
    m = total.texel_gradient.shape[1]
    shift = _texel_response(total) if m else np.zeros((total.coupling.shape[0], m, len(total.common)))
    a = total.common - np.einsum("nmp,nmq->pq", total.coupling, shift)
    bread = _inverse(a)
    blocks, texels, trials = [], [], []
    for trial in found.equations:
        gradient = np.concatenate([one.gradients for one in trial])
        if m:  # less the part that parameters of single texels take over, spread evenly over the blocks
            own = np.einsum("nmp,nm->np", shift, np.sum([one.texel_gradient for one in trial], axis=0))
            gradient[:, : len(shift)] -= own / len(gradient)
        blocks.append(gradient.reshape(-1, len(a)))
        texels.append(gradient.sum(axis=0))
        trials.append(gradient.sum(axis=(0, 1))[None])
    return bread, *(_sandwich(bread, np.concatenate(groups)) for groups in (blocks, texels, trials))


def _texel_response(total: NormalEquations) -> np.ndarray:
    """How parameters of single texels follow the common ones, (n, m, p), while their mean over touched texels is constant.

    A change that all texels share is a change of the common parameter: gains of two on all texels are a gain of two of the
    sensor.
    """
    m = total.texel_gradient.shape[1]
    inverse = np.linalg.inv(total.texel + TEXEL_PRECISION * np.eye(m))
    informed = np.einsum("nmm->nm", total.texel)
    informed = (informed > TOUCHED_SHARE * informed.max(initial=1e-300)).astype(float)
    follow = inverse @ total.coupling
    pulled = np.einsum("nmk,nk->nmk", inverse, informed)
    stiffness, drift = np.einsum("nm,nmk->mk", informed, pulled), np.einsum("nm,nmp->mp", informed, follow)
    return follow - pulled @ np.linalg.lstsq(stiffness, drift, rcond=None)[0]


def _inverse(a: np.ndarray) -> np.ndarray:
    """Inverse of normal equations (p, p), with very large variances in unidentified directions."""
    squares = np.diag(a)
    # A parameter without any effect keeps its zero.
    size = np.sqrt(np.where(squares > 1e-30 * squares.max(initial=0.0), squares, 1.0))
    informed, along = np.linalg.eigh(a / np.outer(size, size))
    eigenvalue = np.where(informed > UNIDENTIFIED, informed, UNIDENTIFIED_EIGENVALUE)
    return (along / eigenvalue) @ along.T / np.outer(size, size)


def _sandwich(bread: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    """Covariance (p, p) from the scatter of the gradients of groups (g, p) (sandwich estimator).

    Noise may have any colour within a group (Liang and Zeger, Biometrika 73, 1986). With few groups the scatter itself is
    uncertain, so the covariance is widened until normal intervals are as wide as Student's. Their degrees of freedom are the
    number of equal groups that would have the same fourth moment: that of normal influences is three times the square of the
    second (effective number of clusters; Carter, Schnepel and Steigerwald, Rev. Econ. Stat. 99, 2017).
    """
    groups = int((np.abs(gradients).sum(axis=1) > 0).sum())
    influence = gradients @ bread
    squares, fourth = (influence**2).sum(axis=0), (influence**4).sum(axis=0)
    effective = np.clip(3.0 * squares**2 / np.maximum(fourth, 1e-300), 2.0, max(groups, 2))
    reach = student_quantile(effective - 1.0) / NORMAL_QUANTILE
    factor = groups / max(groups - len(bread), 1)
    return factor * np.outer(reach, reach) * (influence.T @ influence)
