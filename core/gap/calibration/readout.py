# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimate force and place from readings, with intervals, checked on whole recordings that were not fitted.

Numbers of each method are chosen by leaving out whole recordings, or stretches of them if there are few; check recordings
decide nothing. The errors of what was left out also scale the intervals. Of the methods the simplest is proposed whose error on
what was left out is within one standard error of the least (Breiman et al. 1984, section 3.4.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...errors import ParameterError
from ..dataset.rig import Rig
from .readout_methods import (
    ForwardInverse,
    GaussianProcess,
    Prediction,
    Predictor,
    ReadoutData,
    ReadoutRecording,
    Ridge,
    forward_curves,
    memory_of,
    readout_data,
)

Method = Ridge | GaussianProcess | ForwardInverse
MEMORY_TIMES: tuple[tuple[float, ...], ...] = ((), (1.0,), (1.0, 10.0))
"""Seconds: time constants of the low passes that are tried. Rubber and lattices of TPU creep over both."""
STEPS_PER_TIME = 3.0
"""Samples in the shortest time constant: of recordings that are sampled less often nothing is remembered."""
PENALTIES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
LENGTHS, NOISES = (2.0, 4.0, 8.0), (1e-3, 1e-2)
"""Candidates for the ridge's penalty, and for the length and the noise of the Gaussian process."""
PARTS = 5
"""Stretches that are left out, one after the other, if there are fewer than three recordings."""
MOST_SAMPLES, MOST_TRIED = 4000, 800
"""Samples from which a method is fitted, and from which its numbers are chosen: evenly taken."""
LEVEL = 0.95
"""Of intervals."""


@dataclass(frozen=True)
class ContactEstimate:
    """Stimulus of a sensor, estimated from its readings.

    Attributes
    ----------
    value, low, high : (T, q) float
        NaN where a reading is missing. The interval is of 95 %.
    """

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class FittedMethod:
    """What estimates the stimulus from readings.

    Attributes
    ----------
    predictor : callable
        From readings and memory to values and standard deviations.
    times : tuple of float, s
        Of its memory.
    factor : (q,) float
        By which standard deviations are multiplied for the interval.
    floor : (q,) float
        Values below it are set to it: zero for a force that was never negative, else minus infinity.
    """

    predictor: Predictor
    times: tuple[float, ...]
    factor: np.ndarray
    floor: np.ndarray

    def estimate(self, time: np.ndarray, readings: np.ndarray) -> ContactEstimate:
        """Return the stimulus at times (T,), in s, from the readings (T, c) of the channels that are used."""
        known = np.isfinite(readings).all(axis=1)
        found = np.full((3, len(time), len(self.floor)), np.nan)
        if known.any():
            value, deviation = self.predictor(readings[known], memory_of(time, readings, self.times)[known])
            reach = self.factor * deviation
            found[:, known] = np.maximum(np.stack([value, value - reach, value + reach]), self.floor)
        return ContactEstimate(*found)


@dataclass(frozen=True)
class MethodResult:
    """One method, fitted.

    Attributes
    ----------
    method : Ridge, GaussianProcess or ForwardInverse
    fitted : FittedMethod
    left_out : (q,) float
        Root mean square error on what was left out while numbers were chosen.
    check : (q,) float or None
        The same on the check recordings; None without any.
    check_median : (q,) float or None
        Median of the magnitude of these errors.
    coverage : (q,) float or None
        Share of the check samples inside of their interval.
    score, score_error : float
        Mean of `left_out` in units of how much each target varies, and its standard error by the parts that were left out.
    """

    method: Method
    fitted: FittedMethod = field(repr=False)
    left_out: np.ndarray
    check: np.ndarray | None
    check_median: np.ndarray | None
    coverage: np.ndarray | None
    score: float
    score_error: float


@dataclass(frozen=True)
class ReadoutFit:
    """Read-outs of a sensor.

    Attributes
    ----------
    data : ReadoutData
    results : tuple of MethodResult
        From the simplest to the least simple.
    best : MethodResult
        The one that is proposed.
    forward_check : float or None
        Error of the forward model on the check recordings as a share of the readings' range; None without one.
    reasons : tuple of str
        Where the best read-out fails, and why, a sentence each.
    """

    data: ReadoutData
    results: tuple[MethodResult, ...]
    forward_check: float | None
    reasons: tuple[str, ...]
    best: MethodResult

    def estimate(self, time: np.ndarray, readings: np.ndarray) -> ContactEstimate:
        """Return the stimulus of the sensor by the method that is proposed.

        Parameters
        ----------
        time : (T,) float, s
        readings : (T, n) float
            Of all texels of the rig.

        Raises
        ------
        ParameterError
            Their lengths differ, or there are fewer texels than the rig has.
        """
        time, readings = np.asarray(time, float), np.asarray(readings, float)
        if readings.ndim != 2 or len(readings) != len(time) or readings.shape[1] != self.data.texels:
            raise ParameterError(
                f"{len(time)} times and readings of the shape {readings.shape} do not fit: give (T, {self.data.texels})."
            )
        return self.best.fitted.estimate(time, readings[:, self.data.channels])


def fit_readout(rig: Rig) -> ReadoutFit:
    """Fit read-outs to the recordings of a rig.

    Raises
    ------
    FileError
        The rig has no readings, nothing that drove the sensor, or too few samples.
    """
    data = readout_data(rig)
    floor = np.array([_floor(data, i) for i in range(len(data.targets))])
    ways = (
        (False, True) if {"x", "y"} & set(data.targets) else (False,)
    )  # where something presses, the pattern tells, not the size
    methods: list[list[Method]] = [[ForwardInverse()]] if len(data.targets) == 1 else []
    methods += [
        [Ridge(penalty) for penalty in PENALTIES],
        [GaussianProcess(a, b, way) for way in ways for a in LENGTHS for b in NOISES],
    ]
    results = tuple(_result(data, own, floor) for own in methods)
    least = min(results, key=lambda one: one.score)
    best = next(one for one in results if one.score <= least.score + least.score_error)
    return ReadoutFit(data, results, _forward_check(data), _reasons(data, best.fitted), best)


def _size(data: ReadoutData, errors: np.ndarray) -> float:
    """Errors of all targets in one number, each in units of how much the target varies."""
    spread = np.nanstd(np.concatenate([part.targets for part in data.fit]), axis=0)
    return float(np.mean(errors / np.maximum(spread, 1e-300)))


def _floor(data: ReadoutData, target: int) -> float:
    least = min(float(np.nanmin(part.targets[:, target])) for part in data.fit)
    return 0.0 if data.targets[target] == "force" and least >= 0.0 else -np.inf


# --- samples


@dataclass(frozen=True)
class _Samples:
    """Complete samples of several recordings: readings, memory, targets, and the number of the part each belongs to."""

    readings: np.ndarray
    memory: np.ndarray
    targets: np.ndarray
    part: np.ndarray

    def of(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.readings[chosen], self.memory[chosen], self.targets[chosen]


def _samples(recordings: Sequence[ReadoutRecording], times: Sequence[float], most: int, of_targets: bool = False) -> _Samples:
    """Return the complete samples of recordings, at most so many, evenly taken; with the memory of targets, if wanted."""
    rows: list[tuple[np.ndarray, ...]] = []
    stretches = PARTS if len(recordings) < 3 else 1
    for number, one in enumerate(recordings):
        memory = memory_of(one.time, one.targets if of_targets else one.readings, times)
        (known,) = np.nonzero(np.isfinite(one.readings).all(axis=1) & np.isfinite(one.targets).all(axis=1))
        part = number * stretches + np.arange(len(known)) * stretches // max(len(known), 1)
        rows.append((one.readings[known], memory[known], one.targets[known], part))
    readings, memory, targets, part = (np.concatenate(column) for column in zip(*rows, strict=True))
    if len(part) > most:
        kept = np.linspace(0, len(part) - 1, most).astype(int)
        readings, memory, targets, part = readings[kept], memory[kept], targets[kept], part[kept]
    return _Samples(readings, memory, targets, part)


def _usable_times(data: ReadoutData) -> list[tuple[float, ...]]:
    step = max(float(np.median(np.diff(part.time))) for part in data.fit)
    return [times for times in MEMORY_TIMES if not times or min(times) >= STEPS_PER_TIME * step]


# --- choice, fit and check


def _result(data: ReadoutData, candidates: Sequence[Method], floor: np.ndarray) -> MethodResult:
    """Choose among candidates of one kind, fit the best to all, and check it."""
    best: tuple[float, Method, tuple[float, ...], np.ndarray, np.ndarray, float] | None = None
    for times in _usable_times(data):
        if times and isinstance(candidates[0], ForwardInverse):
            continue
        samples = _samples(data.fit, times, MOST_TRIED)
        for method in candidates:
            error, deviation = _left_out(method, samples, floor)
            errors = np.sqrt(np.mean(error**2, axis=0))
            if best is None or _size(data, errors) < best[0]:
                factor = np.quantile(np.abs(error) / np.maximum(deviation, 1e-300), LEVEL, axis=0)
                parts = [np.sqrt(np.mean(error[samples.part == k] ** 2, axis=0)) for k in np.unique(samples.part)]
                spread = float(np.std([_size(data, part) for part in parts], ddof=1) / np.sqrt(len(parts)))
                best = _size(data, errors), method, times, errors, factor, spread
    assert best is not None
    score, method, times, errors, factor, spread = best
    whole = _samples(data.fit, times, MOST_SAMPLES)
    fitted = FittedMethod(method.fitted(whole.readings, whole.memory, whole.targets), times, factor, floor)
    return MethodResult(method, fitted, errors, *_check(data, fitted), score, spread)


def _left_out(method: Method, samples: _Samples, floor: np.ndarray) -> Prediction:
    """Errors on parts that were left out, and the standard deviations that the method gave them, (T, q)."""
    error, deviation = np.zeros_like(samples.targets), np.ones_like(samples.targets)
    for part in np.unique(samples.part):
        out = samples.part == part
        predictor = method.fitted(*samples.of(~out))
        value, deviation[out] = predictor(samples.readings[out], samples.memory[out])
        error[out] = np.maximum(value, floor) - samples.targets[out]
    return error, deviation


def _check(data: ReadoutData, fitted: FittedMethod) -> tuple[np.ndarray | None, np.ndarray | None, np.ndarray | None]:
    """Root mean square and median error on the check recordings, and the share inside of intervals."""
    errors, inside = [], []
    for one in data.check:
        own = fitted.estimate(one.time, one.readings)
        known = np.isfinite(own.value).all(axis=1) & np.isfinite(one.targets).all(axis=1)
        errors.append((own.value - one.targets)[known])
        inside.append(((own.low <= one.targets) & (one.targets <= own.high))[known])
    if not errors:
        return None, None, None
    error = np.concatenate(errors)
    return np.sqrt(np.mean(error**2, axis=0)), np.median(np.abs(error), axis=0), np.concatenate(inside).mean(axis=0)


def _forward_check(data: ReadoutData) -> float | None:
    """Error of each channel's curve over the target on the check recordings, as a share of the range of all readings.

    A curve is a polynomial plus a share of the creep of the target. The time constant of the creep is chosen
    by leaving out parts of the fitted recordings.
    """
    if len(data.targets) > 1 or not data.check:
        return None

    def squares(fitted: _Samples, chosen: np.ndarray, other: _Samples, out: np.ndarray) -> float:
        curves = forward_curves(fitted.readings[chosen], fitted.targets[chosen, 0], fitted.memory[chosen])
        return float(np.mean((other.readings[out] - curves(other.targets[out, 0], other.memory[out])) ** 2))

    def left_out(times: tuple[float, ...]) -> float:
        own = _samples(data.fit, times, MOST_SAMPLES, of_targets=True)
        return float(np.mean([squares(own, own.part != k, own, own.part == k) for k in np.unique(own.part)]))

    times = min(_usable_times(data), key=left_out)
    fit, check = (_samples(own, times, MOST_SAMPLES * 10, of_targets=True) for own in (data.fit, data.check))
    error = squares(fit, np.ones(len(fit.part), bool), check, np.ones(len(check.part), bool))
    return float(np.sqrt(error) / np.ptp(check.readings))


def _reasons(data: ReadoutData, best: FittedMethod) -> tuple[str, ...]:
    """Say where the error of the best read-out is larger than elsewhere on the check recordings."""
    sentences = []
    whole = _samples(data.fit, (), MOST_SAMPLES * 10).targets
    for i, target in enumerate(data.targets):
        low, high = float(whole[:, i].min()), float(whole[:, i].max())
        errors, beyond, rises = [], [], []
        for one in data.check:
            own = best.estimate(one.time, one.readings)
            error = own.value[:, i] - one.targets[:, i]
            known = np.isfinite(error)
            errors.append(error[known])
            beyond.append(((one.targets[:, i] < low) | (one.targets[:, i] > high))[known])
            rises.append(np.sign(np.gradient(one.targets[:, i]))[known])
        if not errors:
            continue
        error, outside, way = (np.concatenate(part) for part in (errors, beyond, rises))
        if outside.any():
            size = float(np.sqrt(np.mean(error[outside] ** 2)))
            sentences.append(
                f"{outside.mean():.1%} of the check samples have a {target} beyond what was fitted ({low:.4g} to {high:.4g} "
                f"{data.unit(target)}): the error there is {size:.3g} {data.unit(target)}."
            )
        up, down = (float(np.mean(error[way == sign])) if (way == sign).any() else 0.0 for sign in (1.0, -1.0))
        total = float(np.sqrt(np.mean(error**2)))
        if abs(up - down) > total:
            sentences.append(
                f"The error of {target} is {up:+.3g} while it rises and {down:+.3g} {data.unit(target)} while it falls: the "
                "sensor answers on another way back, which its readings do not tell."
            )
        shift = float(np.mean(error))
        if abs(shift) > 0.5 * total:
            sentences.append(
                f"{target} is {shift:+.3g} {data.unit(target)} off on average, more than half of its error: the sensor, or its "
                "place, has moved since the fitted recordings."
            )
    return tuple(sentences)
