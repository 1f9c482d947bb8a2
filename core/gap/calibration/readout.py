# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimate force and place from readings, with intervals, checked on whole recordings that were not fitted.

Numbers of each method are chosen by leaving out whole recordings, or stretches of them if there are few; check recordings
decide nothing. The errors of what was left out also scale the intervals. Of the methods the simplest is proposed whose error on
what was left out is within one standard error of the least (Breiman et al. 1984, section 3.4.3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from ...errors import FileError, ParameterError, counted
from ..dataset.rig import Rig
from ..dataset.trial import Trial
from .readout_methods import Prediction, Predictor, forward_curves, forward_inverse, gaussian_process, memory_of, ridge

Method = Callable[[np.ndarray, np.ndarray, np.ndarray], Predictor]
MEMORY_TIMES: tuple[tuple[float, ...], ...] = ((), (1.0,), (1.0, 10.0))
"""Seconds: time constants of the low passes that are tried. Rubber and lattices of TPU creep over both."""
STEPS_PER_TIME = 3.0
"""Samples in the shortest time constant: of recordings that are sampled less often nothing is remembered."""
PENALTIES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
LENGTHS, NOISES = (2.0, 4.0, 8.0), (1e-3, 1e-2)
"""Candidates for the ridge's penalty, and for the length and the noise of the Gaussian process."""
PARTS = 5
"""Stretches that are left out, one after the other, if there are fewer than three recordings."""
FEWEST_SAMPLES = 60
"""Samples with readings and targets that a fit needs."""
MOST_SAMPLES, MOST_TRIED = 4000, 800
"""Samples from which a method is fitted, and from which its numbers are chosen: evenly taken."""
LEVEL = 0.95
"""Of intervals."""


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

    @property
    def is_complete(self) -> np.ndarray:
        """(T,) bool: samples of which all readings and targets are known."""
        return np.isfinite(np.column_stack([self.readings, self.targets])).all(axis=1)


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
        return "m" if target in ("x", "y", "depth") else "N"


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


Estimator = Callable[[np.ndarray, np.ndarray], ContactEstimate]
"""From times (T,), in s, and the readings (T, c) of the channels that are used to the stimulus."""


@dataclass(frozen=True)
class MethodResult:
    """One method, fitted.

    Attributes
    ----------
    name : str
    times : tuple of float, s
        Of its memory.
    estimate : Estimator
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

    name: str
    times: tuple[float, ...]
    estimate: Estimator = field(repr=False)
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
        return self.best.estimate(time, readings[:, self.data.channels])


def fit_readout(rig: Rig) -> ReadoutFit:
    """Fit read-outs to the recordings of a rig.

    Raises
    ------
    FileError
        The rig has no readings, nothing that drove the sensor, or too few samples.
    """
    data = readout_data(rig)
    ways = (False, True) if {"x", "y"} & set(data.targets) else (False,)  # the pattern shows a place, not the size
    processes = [partial(gaussian_process, length=a, noise=b, by_direction=c) for c, a, b in product(ways, LENGTHS, NOISES)]
    times = _usable_times(data)
    results = [_result(data, "forward model, inverted", [forward_inverse], [()])] if len(data.targets) == 1 else []
    results.append(_result(data, "ridge, second degree", [partial(ridge, penalty=one) for one in PENALTIES], times))
    results.append(_result(data, "Gaussian process", processes, times))
    least = min(results, key=lambda one: one.score)
    best = next(one for one in results if one.score <= least.score + least.score_error)
    return ReadoutFit(data, tuple(results), _forward_check(data, times), _reasons(data, best.estimate), best)


# --- recordings and their samples


def readout_data(rig: Rig) -> ReadoutData:
    """Return the recordings of a rig for a read-out.

    Raises
    ------
    FileError
        There are no readings, or nothing that all fitted recordings say of what drove the sensor, or too few samples.
    """
    fit, check = ([trial for trial in rig.of(use) if trial.reading is not None] for use in ("fit", "check"))
    if not fit:
        raise FileError(
            f"No recording of '{rig.name}' to be fitted has readings: a read-out needs them beside what drove the sensor."
        )
    known = [_targets(trial) for trial in fit]
    shared = [name for name in known[0] if all(name in one for one in known)]
    shared = [name for name in shared if any(np.nanmax(one[name]) > np.nanmin(one[name]) for one in known)]
    if not shared:
        raise FileError(f"The recordings of '{rig.name}' share no force, depth or place that changes: record one of them.")
    values = np.concatenate([trial.reading for trial in fit if trial.reading is not None])
    alive = np.fmax.reduce(values, axis=0) > np.fmin.reduce(values, axis=0)
    if not alive.any():
        raise FileError(f"No channel of '{rig.name}' changes in the fitted recordings: check the connection.")
    notes = []
    if not alive.all():
        named = ", ".join(f"texel_{i}" for i in np.flatnonzero(~alive)[:5])
        notes.append(f"{counted(int((~alive).sum()), 'channel')} never change and are not used: {named}.")
    channels = np.flatnonzero(alive)
    lacking = [trial.name for trial in check if not set(shared) <= set(_targets(trial))]
    notes += [f"'{name}' is no check, because it lacks {' or '.join(shared)}." for name in lacking]
    parts = tuple(_recording(trial, shared, channels) for trial in fit)
    count = sum(int(part.is_complete.sum()) for part in parts)
    if count < FEWEST_SAMPLES:
        raise FileError(
            f"The fitted recordings of '{rig.name}' have {counted(count, 'sample')} with all readings and "
            f"{' and '.join(shared)}: a read-out needs {FEWEST_SAMPLES}."
        )
    checks = tuple(_recording(trial, shared, channels) for trial in check if trial.name not in lacking)
    return ReadoutData(tuple(shared), len(alive), channels, parts, checks, tuple(notes))


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


def _recording(trial: Trial, targets: Sequence[str], channels: np.ndarray) -> ReadoutRecording:
    assert trial.reading is not None
    known = _targets(trial)
    own = np.stack([known[name] for name in targets], axis=1)
    return ReadoutRecording(trial.name, trial.time, trial.reading[:, channels], own)


class _Samples(NamedTuple):
    """Complete samples of several recordings: readings, memory, targets, and the number of the part each belongs to."""

    readings: np.ndarray
    memory: np.ndarray
    targets: np.ndarray
    part: np.ndarray

    def of(self, chosen: np.ndarray) -> _Samples:
        return _Samples(*(column[chosen] for column in self))


def _samples(recordings: Sequence[ReadoutRecording], times: Sequence[float], most: int, of_targets: bool = False) -> _Samples:
    """Return the complete samples of recordings, at most so many, evenly taken; with the memory of targets, if wanted."""
    rows: list[tuple[np.ndarray, ...]] = []
    stretches = PARTS if len(recordings) < 3 else 1
    for number, one in enumerate(recordings):
        memory = memory_of(one.time, one.targets if of_targets else one.readings, times)
        (known,) = np.nonzero(one.is_complete)
        part = number * stretches + np.arange(len(known)) * stretches // max(len(known), 1)
        rows.append((one.readings[known], memory[known], one.targets[known], part))
    found = _Samples(*(np.concatenate(column) for column in zip(*rows, strict=True)))
    count = len(found.part)
    return found.of(np.linspace(0, count - 1, most).astype(int)) if count > most else found


def _usable_times(data: ReadoutData) -> list[tuple[float, ...]]:
    step = max(float(np.median(np.diff(part.time))) for part in data.fit)
    return [times for times in MEMORY_TIMES if not times or min(times) >= STEPS_PER_TIME * step]


# --- choice, fit and check


def _result(data: ReadoutData, name: str, candidates: Sequence[Method], memories: Sequence[tuple[float, ...]]) -> MethodResult:
    """Choose among candidates of one kind, fit the best to all, and check it."""
    targets = np.concatenate([part.targets for part in data.fit])
    never_negative = (np.array(data.targets) == "force") & (np.nanmin(targets, axis=0) >= 0.0)
    floor = np.where(never_negative, 0.0, -np.inf)
    spread = np.maximum(np.nanstd(targets, axis=0), 1e-300)

    def score_of(error: np.ndarray) -> float:
        return float(np.mean(_root_mean_square(error) / spread))

    tried = []
    for times in memories:
        samples = _samples(data.fit, times, MOST_TRIED)
        tried += [(method, times, samples.part, *_left_out(method, samples, floor)) for method in candidates]
    method, times, part, error, deviation = min(tried, key=lambda one: score_of(one[3]))
    factor = np.quantile(np.abs(error) / np.maximum(deviation, 1e-300), LEVEL, axis=0)
    scores = [score_of(error[part == k]) for k in np.unique(part)]
    score_error = float(np.std(scores, ddof=1) / np.sqrt(len(scores)))
    predictor = method(*_samples(data.fit, times, MOST_SAMPLES)[:3])

    def estimate(time: np.ndarray, readings: np.ndarray) -> ContactEstimate:
        known = np.isfinite(readings).all(axis=1)
        found = np.full((3, len(time), len(floor)), np.nan)
        if known.any():
            value, deviation = predictor(readings[known], memory_of(time, readings, times)[known])
            reach = factor * deviation
            found[:, known] = np.maximum(np.stack([value, value - reach, value + reach]), floor)
        return ContactEstimate(*found)

    checked = _check(data, estimate)
    return MethodResult(name, times, estimate, _root_mean_square(error), *checked, score_of(error), score_error)


def _root_mean_square(errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(errors**2, axis=0)))


def _left_out(method: Method, samples: _Samples, floor: np.ndarray) -> Prediction:
    """Errors on parts that were left out, and the standard deviations that the method gave them, (T, q)."""
    error, deviation = np.zeros_like(samples.targets), np.ones_like(samples.targets)
    for part in np.unique(samples.part):
        out = samples.part == part
        predictor = method(*samples.of(~out)[:3])
        value, deviation[out] = predictor(samples.readings[out], samples.memory[out])
        error[out] = np.maximum(value, floor) - samples.targets[out]
    return error, deviation


def _check(data: ReadoutData, estimate: Estimator) -> tuple[np.ndarray | None, np.ndarray | None, np.ndarray | None]:
    """Root mean square and median error on the check recordings, and the share inside of intervals."""
    if not data.check:
        return None, None, None
    errors, inside = [], []
    for one in data.check:
        own = estimate(one.time, one.readings)
        errors.append((own.value - one.targets)[one.is_complete])
        inside.append(((own.low <= one.targets) & (one.targets <= own.high))[one.is_complete])
    error = np.concatenate(errors)
    return _root_mean_square(error), np.median(np.abs(error), axis=0), np.concatenate(inside).mean(axis=0)


def _forward_check(data: ReadoutData, memories: Sequence[tuple[float, ...]]) -> float | None:
    """Error of each channel's curve over the target on the check recordings, as a share of the range of all readings.

    A curve is a polynomial plus a share of the creep of the target. The time constant of the creep is chosen
    by leaving out parts of the fitted recordings.
    """
    if len(data.targets) > 1 or not data.check:
        return None

    def squares(fit: _Samples, other: _Samples) -> float:
        curves = forward_curves(fit.readings, fit.targets[:, 0], fit.memory)
        return float(np.mean((other.readings - curves(other.targets[:, 0], other.memory)) ** 2))

    def left_out(times: tuple[float, ...]) -> float:
        own = _samples(data.fit, times, MOST_SAMPLES, of_targets=True)
        return float(np.mean([squares(own.of(own.part != k), own.of(own.part == k)) for k in np.unique(own.part)]))

    times = min(memories, key=left_out)
    fit, check = (_samples(own, times, MOST_SAMPLES * 10, of_targets=True) for own in (data.fit, data.check))
    return float(np.sqrt(squares(fit, check)) / np.ptp(check.readings))


def _reasons(data: ReadoutData, estimate: Estimator) -> tuple[str, ...]:
    """Say where the error of the best read-out is larger than elsewhere on the check recordings."""
    if not data.check:
        return ()
    sentences = []
    fitted = _samples(data.fit, (), MOST_SAMPLES * 10).targets
    errors = np.concatenate([estimate(one.time, one.readings).value - one.targets for one in data.check])
    wanted = np.concatenate([one.targets for one in data.check])
    ways = np.concatenate([np.sign(np.gradient(one.targets, axis=0)) for one in data.check])
    for i, target in enumerate(data.targets):
        unit, low, high = data.unit(target), float(fitted[:, i].min()), float(fitted[:, i].max())
        known = np.isfinite(errors[:, i])
        error, value, way = errors[known, i], wanted[known, i], ways[known, i]
        outside = (value < low) | (value > high)
        if outside.any():
            size = float(_root_mean_square(error[outside]))
            sentences.append(
                f"{outside.mean():.1%} of the check samples have a {target} beyond what was fitted ({low:.4g} to {high:.4g} "
                f"{unit}): the error there is {size:.3g} {unit}."
            )
        up, down = (float(np.mean(error[way == sign])) if (way == sign).any() else 0.0 for sign in (1.0, -1.0))
        total = float(_root_mean_square(error))
        if abs(up - down) > total:
            sentences.append(
                f"The error of {target} is {up:+.3g} while it rises and {down:+.3g} {unit} while it falls: the sensor answers "
                "on another way back, which its readings do not tell."
            )
        shift = float(np.mean(error))
        if abs(shift) > 0.5 * total:
            sentences.append(
                f"{target} is {shift:+.3g} {unit} off on average, more than half of its error: the sensor, or its place, has "
                "moved since the fitted recordings."
            )
    return tuple(sentences)
