# SPDX-License-Identifier: GPL-3.0-or-later
"""A learned model of the same recordings: kernel ridge regression on the stimulus and its past. It names nothing."""

from __future__ import annotations

import numpy as np

from palpate.benchmarks._recordings import Columns, Recording

from .handmade import free_factors, low_pass, responses, with_own_factor

MOST_SAMPLES = 1500
LENGTHS, RIDGES = (1.0, 2.0, 4.0, 8.0), (1e-4, 1e-2, 1.0)
MEMORIES = (0.3, 3.0, 30.0)
"""Seconds over which the past is averaged."""
STIMULUS = ("x", "z", "depth", "force", "slide_x")


def features(columns: Columns) -> np.ndarray:
    """(T, m): stimulus, its rate, its averages over the past, and the largest load so far."""
    time, found = columns["time"], []
    for name in STIMULUS:
        if name in columns and np.ptp(columns[name]) > 0:
            value = columns[name]
            found += [value, np.tanh(np.gradient(value, time) / (np.std(np.gradient(value, time)) + 1e-12))]
            found += [low_pass(time, value, tau) for tau in MEMORIES]
            found.append(np.maximum.accumulate(value))
    return np.stack(found, axis=1)


def predict_learned(recording: Recording) -> list[np.ndarray]:
    """Fit to the recordings of use "fit", and return what is predicted of all, each (T, n).

    Length scale and ridge are those that predict each fitted recording best from the others.
    """
    fitted = [columns for _, use, columns in recording.trials if use == "fit"]
    inputs, outputs = [features(c) for c in fitted], [responses(c) for c in fitted]
    if free_factors(recording):
        outputs = [y / np.nanstd(y) for y in outputs]
    mean, size = np.concatenate(inputs).mean(axis=0), np.concatenate(inputs).std(axis=0) + 1e-12
    inputs = [(x - mean) / size for x in inputs]
    everything = [(features(c) - mean) / size for _, _, c in recording.trials]
    by_channel = []
    for channel in range(outputs[0].shape[1]):
        targets = [y[:, channel] for y in outputs]
        scores = {}
        for length in LENGTHS:
            for ridge in RIDGES:
                scores[length, ridge] = _left_out_error(inputs, targets, length, ridge)
        length, ridge = min(scores, key=lambda key: scores[key])
        model = _KernelRidge(np.concatenate(inputs), np.concatenate(targets), length, ridge)
        by_channel.append([model(x) for x in everything])
    predicted = [np.stack(per_trial, axis=1) for per_trial in zip(*by_channel, strict=True)]
    return [with_own_factor(p, c, recording) for p, (_, _, c) in zip(predicted, recording.trials, strict=True)]


def _left_out_error(inputs: list[np.ndarray], targets: list[np.ndarray], length: float, ridge: float) -> float:
    error = 0.0
    for out in range(len(inputs)):
        others = [i for i in range(len(inputs)) if i != out]
        model = _KernelRidge(
            np.concatenate([inputs[i] for i in others]), np.concatenate([targets[i] for i in others]), length, ridge, 600
        )
        error += float(np.nansum((model(inputs[out]) - targets[out]) ** 2))
    return error


class _KernelRidge:
    """Ridge regression with a Gaussian kernel on at most `most` samples drawn at random."""

    def __init__(self, x: np.ndarray, y: np.ndarray, length: float, ridge: float, most: int = MOST_SAMPLES):
        good = np.flatnonzero(np.isfinite(y))
        chosen = np.random.default_rng(1).permutation(good)[:most]
        self._x, self._length = x[chosen], length
        self._mean = float(y[chosen].mean())
        matrix = self._kernel(self._x) + ridge * np.eye(len(chosen))
        self._weights = np.linalg.solve(matrix, y[chosen] - self._mean)

    def _kernel(self, x: np.ndarray) -> np.ndarray:
        squares = (x**2).sum(axis=1)[:, None] + (self._x**2).sum(axis=1)[None] - 2.0 * x @ self._x.T
        return np.exp(-0.5 * np.maximum(squares, 0.0) / (self._length**2 * x.shape[1]))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return self._mean + self._kernel(x) @ self._weights
