# SPDX-License-Identifier: GPL-3.0-or-later
"""Methods that tell what drove a sensor from its readings: ridge regression, a Gaussian process, and a forward model inverted.

Each has a method ``fitted(readings, memory, targets)`` that returns a function from (readings, memory) to values and standard
deviations, both (T, q). `memory` are readings behind low passes, less the readings: what a sensor with creep still remembers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import FileError, counted
from ..dataset.rig import Rig
from ..dataset.trial import Trial

FEWEST_SAMPLES = 60
"""Samples with readings and targets that a fit needs."""
UNITS = {"x": "m", "y": "m", "depth": "m"}
"""Units of targets that are not in newtons."""


@dataclass(frozen=True)
class ReadoutRecording:
    """One recording.

    Attributes
    ----------
    name : str
    time : (T,) float, s
    readings : (T, c) float
    targets : (T, q) float
        NaN where one is not known.
    """

    name: str
    time: np.ndarray
    readings: np.ndarray
    targets: np.ndarray


@dataclass(frozen=True)
class ReadoutData:
    """All recordings of a rig.

    Attributes
    ----------
    targets : tuple of str
        What is wanted: "force", "x", "y", "depth", "force_x", "force_y", "force_z".
    texels : int
        Of the rig.
    channels : (c,) int
        Texels whose readings are used; those that never change are not.
    fit, check : tuple of ReadoutRecording
    notes : tuple of str
    """

    targets: tuple[str, ...]
    texels: int
    channels: np.ndarray
    fit: tuple[ReadoutRecording, ...]
    check: tuple[ReadoutRecording, ...]
    notes: tuple[str, ...] = ()

    def unit(self, target: str) -> str:
        """Return the unit of a target."""
        return UNITS.get(target, "N")


def readout_data(rig: Rig) -> ReadoutData:
    """Return the recordings of a rig for a read-out.

    Raises
    ------
    FileError
        There are no readings, or nothing that all fitted recordings say of what drove the sensor, or too few samples.
    """
    fit = [trial for trial in rig.of("fit") if trial.reading is not None]
    check = [trial for trial in rig.of("check") if trial.reading is not None]
    if not fit:
        raise FileError(
            f"No recording of '{rig.name}' to be fitted has readings: a read-out needs them beside what drove the sensor."
        )
    names = [set(_targets(trial)) for trial in fit]
    shared = tuple(name for name in _targets(fit[0]) if all(name in own for own in names) and _varies(fit, name))
    if not shared:
        raise FileError(f"The recordings of '{rig.name}' share no force, depth or place that changes: record one of them.")
    notes = []
    values = np.concatenate([trial.reading for trial in fit if trial.reading is not None])
    alive = np.fmax.reduce(values, axis=0) > np.fmin.reduce(values, axis=0)
    if not alive.any():
        raise FileError(f"No channel of '{rig.name}' changes in the fitted recordings: check the connection.")
    if not alive.all():
        named = ", ".join(f"texel_{i}" for i in np.flatnonzero(~alive)[:5])
        notes.append(f"{counted(int((~alive).sum()), 'channel')} never change and are not used: {named}.")
    channels = np.flatnonzero(alive)
    parts = tuple(_recording(trial, shared, channels) for trial in fit)
    count = sum(_complete(part) for part in parts)
    if count < FEWEST_SAMPLES:
        raise FileError(
            f"The fitted recordings of '{rig.name}' have {counted(count, 'sample')} with all readings and "
            f"{' and '.join(shared)}: a read-out needs {FEWEST_SAMPLES}."
        )
    usable = [trial for trial in check if set(shared) <= set(_targets(trial))]
    notes += [f"'{trial.name}' is no check, because it lacks {' or '.join(shared)}." for trial in check if trial not in usable]
    checks = tuple(_recording(trial, shared, channels) for trial in usable)
    return ReadoutData(shared, len(alive), channels, parts, checks, tuple(notes))


def _targets(trial: Trial) -> dict[str, np.ndarray]:
    """Known quantities of the stimulus of a recording, by name."""
    found: dict[str, np.ndarray] = {}
    if trial.level is not None:
        found["force" if trial.stimulus == "force" else "depth"] = trial.level
    if trial.position is not None:
        found |= {"x": trial.position[:, 0], "y": trial.position[:, 1]}
    if trial.force is not None:
        found |= {f"force_{axis}": column for axis, column in zip("xyz", trial.force.T) if np.isfinite(column).any()}
    return found


def _varies(trials: list[Trial], name: str) -> bool:
    return any(np.nanmax(_targets(trial)[name]) > np.nanmin(_targets(trial)[name]) for trial in trials)


def _recording(trial: Trial, targets: tuple[str, ...], channels: np.ndarray) -> ReadoutRecording:
    assert trial.reading is not None
    own = _targets(trial)
    return ReadoutRecording(
        trial.name, trial.time, trial.reading[:, channels], np.stack([own[name] for name in targets], axis=1)
    )


def _complete(part: ReadoutRecording) -> int:
    return int((np.isfinite(part.readings).all(axis=1) & np.isfinite(part.targets).all(axis=1)).sum())


Prediction = tuple[np.ndarray, np.ndarray]
Predictor = Callable[[np.ndarray, np.ndarray], Prediction]
ForwardCurves = Callable[[np.ndarray, np.ndarray], np.ndarray]
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


@dataclass(frozen=True)
class Ridge:
    """Second degree in the readings, first in their memory, with a penalty on the standardised coefficients."""

    penalty: float
    name: str = "ridge, second degree"

    def fitted(self, readings: np.ndarray, memory: np.ndarray, targets: np.ndarray) -> Predictor:
        """Return the predictor; its standard deviation is that of the fitted residuals."""
        size = np.maximum(np.sqrt(np.mean(readings**2, axis=0)), 1e-300)

        def terms(own: np.ndarray, past: np.ndarray) -> np.ndarray:
            r = own / size
            count = r.shape[1]
            pairs = [(i, j) for i in range(count) for j in (range(i, count) if count <= MOST_SQUARED else (i,))]
            scale = np.tile(size, past.shape[1] // count) if past.shape[1] else np.ones(0)
            return np.column_stack([r, *(r[:, i] * r[:, j] for i, j in pairs), past / scale])

        table = terms(readings, memory)
        mean, spread = table.mean(axis=0), np.maximum(table.std(axis=0), 1e-300)
        scaled = (table - mean) / spread
        level = targets.mean(axis=0)
        normal = scaled.T @ scaled + self.penalty * len(scaled) * np.eye(scaled.shape[1])
        weights = np.linalg.solve(normal, scaled.T @ (targets - level))
        deviation = np.std(targets - level - scaled @ weights, axis=0)

        def predict(own: np.ndarray, past: np.ndarray) -> Prediction:
            value = level + ((terms(own, past) - mean) / spread) @ weights
            return value, np.broadcast_to(deviation, value.shape).copy()

        return predict


@dataclass(frozen=True)
class GaussianProcess:
    """A Gaussian process with a squared exponential kernel (Rasmussen and Williams 2006, chapter 2).

    Attributes
    ----------
    length : float
        Of the kernel, in units of the features' size.
    noise : float
        Variance of the noise, as a share of that of the signal.
    by_direction : bool
        Features are the direction of the vector of all readings and the logarithm of its length, and not the readings.
    """

    length: float
    noise: float
    by_direction: bool = False
    name: str = "Gaussian process"

    def fitted(self, readings: np.ndarray, memory: np.ndarray, targets: np.ndarray) -> Predictor:
        """Return the predictor; its standard deviation grows away from what was fitted."""
        from scipy.linalg import cho_factor, cho_solve

        size = np.maximum(np.sqrt(np.mean(readings**2, axis=0)), 1e-300)
        least = 1e-3 * float(np.sqrt(np.mean((readings / size) ** 2)))

        def features(own: np.ndarray, past: np.ndarray) -> np.ndarray:
            r = own / size
            rest = np.arcsinh(ASINH * past / np.tile(size, past.shape[1] // r.shape[1])) if past.shape[1] else past
            if not self.by_direction:
                return np.concatenate([np.arcsinh(ASINH * r), rest], axis=1)
            length = np.maximum(np.linalg.norm(r, axis=1, keepdims=True), least)
            return np.concatenate([np.sqrt(r.shape[1]) * r / length, np.log(length), rest], axis=1)

        known = features(readings, memory)
        level, spread = targets.mean(axis=0), np.maximum(targets.std(axis=0), 1e-300)
        standard = (targets - level) / spread
        factor = cho_factor(self._kernel(known, known) + self.noise * np.eye(len(known)), lower=True)
        weights = cho_solve(factor, standard)
        amplitude = np.sqrt(np.maximum(np.mean(standard * weights, axis=0), 1e-300)) * spread

        def predict(own: np.ndarray, past: np.ndarray) -> Prediction:
            kernel = self._kernel(features(own, past), known)
            left = 1.0 + self.noise - np.sum(kernel * cho_solve(factor, kernel.T).T, axis=1)
            return level + (kernel @ weights) * spread, np.sqrt(np.maximum(left, 0.1 * self.noise))[:, None] * amplitude

        return predict

    def _kernel(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        squares = np.sum(one**2, axis=1)[:, None] + np.sum(other**2, axis=1) - 2.0 * one @ other.T
        found: np.ndarray = np.exp(-0.5 * np.maximum(squares, 0.0) / self.length**2)
        found[found < NEGLIGIBLE] = 0.0
        return found


@dataclass(frozen=True)
class ForwardInverse:
    """Each channel as a polynomial of one target, inverted with the covariance of the channels' errors."""

    name: str = "forward model, inverted"

    def fitted(self, readings: np.ndarray, memory: np.ndarray, targets: np.ndarray) -> Predictor:
        """Return the predictor; its standard deviation is that of the most likely value (Cramér and Rao)."""
        low, high = float(targets.min()), float(targets.max())
        grid = np.linspace(low - BEYOND * (high - low), high + BEYOND * (high - low), GRID)
        nothing = np.zeros((len(targets), 0))
        curves = forward_curves(readings, targets[:, 0], nothing)
        curve, residual = curves(grid, np.zeros((GRID, 0))), readings - curves(targets[:, 0], nothing)
        covariance = np.atleast_2d(np.cov(residual.T)) + FLOOR * np.diag(readings.var(axis=0))
        whitening = np.linalg.inv(np.linalg.cholesky(covariance))
        expected = curve @ whitening.T
        step = float(grid[1] - grid[0])
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


def forward_curves(readings: np.ndarray, target: np.ndarray, memory: np.ndarray) -> ForwardCurves:
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
