# SPDX-License-Identifier: GPL-3.0-or-later
"""Physical models of recordings, as somebody would write them who knows what was measured and nothing of Palpate.

A model is a list of terms of the stimulus, nonlinear in a few numbers. The numbers are fitted by least squares; the terms'
weights follow from a linear fit, in the fitted recordings alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ._recordings import Columns, Recording

Terms = Callable[[np.ndarray, Columns], list[np.ndarray]]
"""Terms (T,) from the nonlinear numbers and the columns of a recording."""


@dataclass(frozen=True)
class HandmadeModel:
    """Terms, and start and bounds of their nonlinear numbers.

    Attributes
    ----------
    terms : Terms
    start, low, high : tuple of float
    """

    terms: Terms
    start: tuple[float, ...] = ()
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()


def low_pass(time: np.ndarray, x: np.ndarray, tau: float) -> np.ndarray:
    """Return x after a low pass of first order, exact where x is constant between samples."""
    out = np.array(x, float)
    keep = np.exp(-np.diff(time) / tau)
    for t in range(1, len(out)):
        out[t] = x[t] + (out[t - 1] - x[t]) * keep[t - 1]
    return out


def responses(columns: Columns) -> np.ndarray:
    """(T, n): readings, or the net force along x where there are none."""
    names = [name for name in columns if name.startswith("texel_")] or ["force_x"]
    return np.stack([columns[name] for name in names], axis=1)


def predict_by_hand(model: HandmadeModel, recording: Recording) -> list[np.ndarray]:
    """Fit a model to the recordings of use "fit", and return what it predicts of all recordings, each (T, n)."""
    from scipy.optimize import least_squares

    fitted = [columns for _, use, columns in recording.trials if use == "fit"]
    measured = [responses(columns) for columns in fitted]
    scale = max(float(np.nanmax(m) - np.nanmin(m)) for m in measured)

    def tables(numbers: np.ndarray, of: list[Columns]) -> list[np.ndarray]:
        return [np.stack(model.terms(numbers, columns), axis=1) for columns in of]

    def predicted(numbers: np.ndarray, of: list[Columns]) -> list[np.ndarray]:
        table, values, weights = np.concatenate(tables(numbers, fitted)), np.concatenate(measured), []
        for channel in values.T:
            good = np.isfinite(channel)
            weights.append(np.linalg.lstsq(table[good], channel[good], rcond=None)[0])
        return [np.stack([own @ weight for weight in weights], axis=1) for own in tables(numbers, of)]

    def residual(numbers: np.ndarray) -> np.ndarray:
        whole = np.concatenate([((m - p) / scale).ravel() for m, p in zip(measured, predicted(numbers, fitted), strict=True)])
        return whole[np.isfinite(whole)]

    numbers = np.array(model.start)
    if len(numbers):
        numbers = least_squares(residual, numbers, bounds=(model.low, model.high), x_scale=np.maximum(np.abs(numbers), 0.1)).x
    return predicted(numbers, [columns for _, _, columns in recording.trials])
