# SPDX-License-Identifier: GPL-3.0-or-later
"""Methods that tell what drove a sensor from its readings: ridge regression, a Gaussian process, and a forward model inverted.

Each takes readings (T, c), memory (T, m) and targets (T, q), and returns a function from readings and memory to values and
standard deviations, both (T, q). `memory` are readings behind low passes, less the readings: what a sensor with creep still
remembers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

Prediction = tuple[np.ndarray, np.ndarray]
Predictor = Callable[[np.ndarray, np.ndarray], Prediction]
MOST_SQUARED = 40
"""Channels up to which the ridge takes all products of two; of more it takes the squares."""
ASINH = 2.0
"""Readings are compressed as asinh(2 r), in units of their root mean square, before distances between them are taken."""
DEGREE = 5
"""Of the polynomial of each channel over a force or a depth in the forward model. Over eFlesh's presses the error on the other
recording is 1.14, 1.11, 1.08 and 1.06 % of the range with 3 to 6."""
GRID, BEYOND = 241, 0.05
"""Values at which the forward model is compared with the readings, and how far they go beyond those that were fitted."""
NEGLIGIBLE = 1e-30
"""Smaller values of a kernel are zero: products of them would be denormal, with which processors are ten times as slow."""
FLOOR = 1e-4
"""Share of each channel's variance that is added to the covariance of the forward model's errors, so that it has an inverse."""


def memory_of(time: np.ndarray, readings: np.ndarray, times: Sequence[float]) -> np.ndarray:
    """Return readings behind low passes of first order, less the readings, (T, c · len(times)).

    Parameters
    ----------
    time : (T,) float, s, increasing
    readings : (T, c) float
        A sample with a missing channel leaves the states as they are.
    times : sequence of float, s
        Time constants.
    """
    parts = []
    known = np.isfinite(readings).all(axis=1)
    for tau in times:
        keeps = np.exp(-np.diff(time, prepend=time[:1]) / tau)
        out, state = np.full_like(readings, np.nan), None
        for i in np.flatnonzero(known):
            state = readings[i] if state is None else keeps[i] * state + (1.0 - keeps[i]) * readings[i]
            out[i] = state
        parts.append(out - readings)
    return np.concatenate(parts, axis=1) if parts else np.zeros((len(readings), 0))


def ridge(readings: np.ndarray, memory: np.ndarray, targets: np.ndarray, penalty: float) -> Predictor:
    """Fit second degree in the readings, first in their memory, with a penalty on the standardised coefficients.

    The standard deviation is that of the fitted residuals.
    """
    size = np.maximum(np.sqrt(np.mean(readings**2, axis=0)), 1e-300)

    def terms(own: np.ndarray, past: np.ndarray) -> np.ndarray:
        r = own / size
        count = r.shape[1]
        pairs = [(i, j) for i in range(count) for j in (range(i, count) if count <= MOST_SQUARED else (i,))]
        return np.column_stack([r, *(r[:, i] * r[:, j] for i, j in pairs), past / np.tile(size, past.shape[1] // count)])

    table = terms(readings, memory)
    mean, spread = table.mean(axis=0), np.maximum(table.std(axis=0), 1e-300)
    scaled = (table - mean) / spread
    level = targets.mean(axis=0)
    normal = scaled.T @ scaled + penalty * len(scaled) * np.eye(scaled.shape[1])
    weights = np.linalg.solve(normal, scaled.T @ (targets - level))
    deviation = np.std(targets - level - scaled @ weights, axis=0)

    def predict(own: np.ndarray, past: np.ndarray) -> Prediction:
        value = level + ((terms(own, past) - mean) / spread) @ weights
        return value, np.broadcast_to(deviation, value.shape).copy()

    return predict


def gaussian_process(
    readings: np.ndarray, memory: np.ndarray, targets: np.ndarray, length: float, noise: float, by_direction: bool = False
) -> Predictor:
    """Fit a Gaussian process with a squared exponential kernel (Rasmussen and Williams 2006, chapter 2).

    The standard deviation grows away from what was fitted.

    Parameters
    ----------
    readings, memory, targets : (T, c), (T, m), (T, q) float
    length : float
        Of the kernel, in units of the features' size.
    noise : float
        Variance of the noise, as a share of that of the signal.
    by_direction : bool
        Features are the direction of the vector of all readings and the logarithm of its length, and not the readings.
    """
    from scipy.linalg import cho_factor, cho_solve

    size = np.maximum(np.sqrt(np.mean(readings**2, axis=0)), 1e-300)
    least = 1e-3 * float(np.sqrt(np.mean((readings / size) ** 2)))

    def features(own: np.ndarray, past: np.ndarray) -> np.ndarray:
        r = own / size
        rest = np.arcsinh(ASINH * past / np.tile(size, past.shape[1] // r.shape[1]))
        if not by_direction:
            return np.concatenate([np.arcsinh(ASINH * r), rest], axis=1)
        size_of_all = np.maximum(np.linalg.norm(r, axis=1, keepdims=True), least)
        return np.concatenate([np.sqrt(r.shape[1]) * r / size_of_all, np.log(size_of_all), rest], axis=1)

    def kernel(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        squares = np.sum(one**2, axis=1)[:, None] + np.sum(other**2, axis=1) - 2.0 * one @ other.T
        found: np.ndarray = np.exp(-0.5 * np.maximum(squares, 0.0) / length**2)
        found[found < NEGLIGIBLE] = 0.0
        return found

    known = features(readings, memory)
    level, spread = targets.mean(axis=0), np.maximum(targets.std(axis=0), 1e-300)
    standard = (targets - level) / spread
    factor = cho_factor(kernel(known, known) + noise * np.eye(len(known)), lower=True)
    weights = cho_solve(factor, standard)
    amplitude = np.sqrt(np.maximum(np.mean(standard * weights, axis=0), 1e-300)) * spread

    def predict(own: np.ndarray, past: np.ndarray) -> Prediction:
        near = kernel(features(own, past), known)
        left = 1.0 + noise - np.sum(near * cho_solve(factor, near.T).T, axis=1)
        return level + (near @ weights) * spread, np.sqrt(np.maximum(left, 0.1 * noise))[:, None] * amplitude

    return predict


def forward_inverse(readings: np.ndarray, memory: np.ndarray, targets: np.ndarray) -> Predictor:
    """Fit each channel as a polynomial of one target, to be inverted with the covariance of the channels' errors.

    The standard deviation is that of the most likely value (Cramér and Rao). Nothing is remembered.
    """
    low, high = float(targets.min()), float(targets.max())
    grid = np.linspace(low - BEYOND * (high - low), high + BEYOND * (high - low), GRID)
    curves = forward_curves(readings, targets[:, 0], memory[:, :0])
    curve, residual = curves(grid, np.zeros((GRID, 0))), readings - curves(targets[:, 0], memory[:, :0])
    covariance = np.atleast_2d(np.cov(residual.T)) + FLOOR * np.diag(readings.var(axis=0))
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    expected, step = curve @ whitening.T, float(grid[1] - grid[0])
    slope = np.gradient(expected, step, axis=0)
    deviation = 1.0 / np.sqrt(np.maximum(np.sum(slope**2, axis=1), 1e-300))

    def predict(own: np.ndarray, past: np.ndarray) -> Prediction:
        seen = own @ whitening.T
        distance = np.sum(seen**2, axis=1)[:, None] - 2.0 * seen @ expected.T + np.sum(expected**2, axis=1)
        best = np.clip(np.argmin(distance, axis=1), 1, GRID - 2)
        row = np.arange(len(own))
        before, here, after = (distance[row, best + k] for k in (-1, 0, 1))
        bend = before - 2.0 * here + after
        away = np.where(bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), 0.0)
        value = grid[best] + np.clip(away, -1.0, 1.0) * step
        return value[:, None], deviation[best][:, None]

    return predict


def forward_curves(
    readings: np.ndarray, target: np.ndarray, memory: np.ndarray
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Fit each channel as a polynomial of a target, and its memory times a line in the target.

    Parameters
    ----------
    readings : (T, c) float
    target : (T,) float
    memory : (T, m) float
        The target behind low passes, less the target; m may be zero.

    Returns
    -------
    function
        From target and memory to readings.
    """
    middle, half = 0.5 * (target.max() + target.min()), 0.5 * float(np.ptp(target))

    def terms(values: np.ndarray, past: np.ndarray) -> np.ndarray:
        powers, scaled = np.polynomial.chebyshev.chebvander((values - middle) / half, DEGREE), past / half
        return np.column_stack([powers, scaled, powers[:, 1:2] * scaled])  # where the curve is steeper, creep shows more

    weights = np.linalg.lstsq(terms(target, memory), readings, rcond=None)[0]
    return lambda values, past: terms(values, past) @ weights
