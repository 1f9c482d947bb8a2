# SPDX-License-Identifier: GPL-3.0-or-later
"""Known effects on top of real recordings, by formulas that the library does not have.

The recordings keep their stimulus, their noise and everything that no effect of the library explains. Effects that the workflow
found in them are taken out first, because the question is about one further effect. Its size is the root mean square of what it
adds, less what a refitted gain, zero or damping takes up, in units of the root mean square of the unexplained residual.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ._recordings import Columns, Recording

SIZES = (1.0, 2.0, 4.0)
"""How many times as large as what was left unexplained."""
LARGEST_SHARE, LARGEST_STRENGTH = 0.3, 6.0
"""Share of the range, and strength, beyond which an effect makes another sensor."""
Change = Callable[[np.ndarray, np.ndarray, np.ndarray, float], np.ndarray]
"""How an effect changes readings.

Arguments are times (T,) since the recording began, as shares of the length of the longest recording; loads (T, 1) and readings
(T, n), both as shares of the largest; and a strength. The result is the changed readings (T, n). One sensor has one effect, in
long recordings and in short ones.
"""


def _low_pass(time: np.ndarray, x: np.ndarray, tau: float) -> np.ndarray:
    out = x.copy()
    for t in range(1, len(x)):
        out[t] = x[t] + (out[t - 1] - x[t]) * np.exp(-(time[t] - time[t - 1]) / tau)
    return out


def lag(time, load, x, strength):
    """Three equal low passes in turn."""
    for _ in range(3):
        x = _low_pass(time, x, 0.03 * strength)
    return x


def saturation(time, load, x, strength):
    """An arctangent."""
    return np.arctan(x * strength) / strength


def dead_zone(time, load, x, strength):
    """A quadratic onset that runs into the line."""
    size, start = np.abs(x), 0.3 * strength
    return np.sign(x) * np.where(size < 2 * start, size**2 / (4 * start), size - start)


def drift(time, load, x, strength):
    """A power of the time."""
    return x + 0.3 * strength * time[:, None] ** 1.3


def creep(time, load, x, strength):
    """The reading goes on rising, with two times."""
    return x + strength * (0.3 * _low_pass(time, x, 0.03) + 0.3 * _low_pass(time, x, 0.15))


def hysteresis(time, load, x, strength):
    """Where load was taken back, readings bulge out over the way in: by a parabola up to the largest load before."""
    out, top = x.copy(), np.zeros(1)
    for t in range(len(x)):
        top = np.where(load[t] < 0.02, load[t], np.maximum(top, load[t]))
        out[t] = x[t] + strength * x[t] * (1.0 - load[t] / np.maximum(top, 1e-9))
    return out


def gain_mismatch(time, load, x, strength):
    """Gains spread by the logarithm."""
    return x * np.exp(0.3 * strength * np.random.default_rng(1).normal(size=x.shape[1]))


def offset(time, load, x, strength):
    """Zeros spread evenly."""
    return x + 0.3 * strength * np.random.default_rng(2).uniform(-1.0, 1.0, x.shape[1])


CHANGES: dict[str, Change] = {
    "lag": lag,
    "saturation": saturation,
    "dead-zone": dead_zone,
    "drift": drift,
    "creep": creep,
    "hysteresis": hysteresis,
    "gain-mismatch": gain_mismatch,
    "offset": offset,
}
TEXEL_EFFECTS = ("gain-mismatch", "offset")


@dataclass(frozen=True)
class CleanedRecordings:
    """Recordings without the effects that were found in them.

    Attributes
    ----------
    recording : Recording
    residual_rms : float
        Root mean square of the unexplained residual, in the sensor's unit.
    residual_share : float
        The same as a share of the range.
    """

    recording: Recording
    residual_rms: float
    residual_share: float


def without_found_effects(recording: Recording, result: Any) -> CleanedRecordings:
    """Subtract from the readings what the effects that were found change in the model."""
    trials, left = [], []
    for predictor, (name, use, columns) in zip(result.predictors, recording.trials, strict=True):
        best, base = (predictor.predict(model).reading for model in (result.best.model, result.base.model))
        freed = predictor.trial.reading - (best - base)
        left.append((predictor.trial.reading - best).ravel())
        trials.append((name, use, columns | {f"texel_{i}": texel for i, texel in enumerate(freed.T)}))
    rest = float(np.sqrt(np.nanmean(np.concatenate(left) ** 2)))
    return CleanedRecordings(replace(recording, trials=trials), rest, rest / result.full[0])


def thinned_texels(recording: Recording, step: int) -> Recording:
    """Return the recordings of each `step`-th texel; a force that all texels share is reduced accordingly."""
    trials: list[tuple[str, str, Columns]] = []
    for name, use, columns in recording.trials:
        texels = [value for key, value in columns.items() if key.startswith("texel_")]
        kept = texels[::step]
        rest = {"time": columns["time"], "force": columns["force"] * len(kept) / len(texels)}
        trials.append((name, use, rest | {f"texel_{i}": value for i, value in enumerate(kept)}))
    return replace(recording, sensor=re.sub(r"columns = \d+", f"columns = {len(kept)}", recording.sensor), trials=trials)


def is_multiplexed(recording: Recording) -> bool:
    """Return whether channels are read one after the other.

    Then parameters of single texels can do all that a drift does, and not the other way round.
    """
    tables = [np.stack([v for k, v in columns.items() if k.startswith("texel_")], axis=1) for _, _, columns in recording.trials]
    return all(table.shape[1] > 1 and (np.isfinite(table).sum(axis=1) <= 1).all() for table in tables)


def with_effect(cleaned: CleanedRecordings, name: str, size: float) -> Recording | None:
    """Return recordings with an effect of a size in units of the unexplained residual; None if it cannot be so large."""
    trials = cleaned.recording.trials
    texels = [key for key in trials[0][2] if key.startswith("texel_")]
    if name in TEXEL_EFFECTS and len(texels) == 1:
        return None
    readings = [np.stack([columns[key] for key in texels], axis=1) for _, _, columns in trials]
    zero = np.array([_resting_value(channel) for channel in np.concatenate(readings).T])
    full = max(float(np.nanmax(np.abs(r - zero))) for r in readings)
    plain = [np.nan_to_num((r - zero) / full) for r in readings]  # a channel that is not read out is at rest

    times = [columns["time"] - columns["time"][0] for _, _, columns in trials]
    longest = max(float(time[-1]) for time in times)
    loads = [next(columns[key] for key in ("force", "depth") if key in columns)[:, None] for _, _, columns in trials]
    most = max(float(load.max()) for load in loads)

    def changes(strength: float) -> list[np.ndarray]:
        made = []
        for time, load, x, reading in zip(times, loads, plain, readings, strict=True):
            change = CHANGES[name](time / longest, load / most, x, strength) - x
            made.append(np.where(np.isnan(reading), np.nan, full * change))
        return made

    def size_of(made: list[np.ndarray]) -> float:
        return _rms_beyond_refitting(made, readings, times)

    strengths = np.geomspace(1e-3, LARGEST_STRENGTH, 14)
    enough = [float(s) for s in strengths if size_of(changes(float(s))) >= size * cleaned.residual_rms]
    if not enough or size * cleaned.residual_share > LARGEST_SHARE:
        return None
    low, high = enough[0] * float(strengths[0] / strengths[1]), enough[0]
    for _ in range(12):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if size_of(changes(middle)) < size * cleaned.residual_rms else (low, middle)
    changed = []
    for (trial, use, columns), reading, change in zip(trials, readings, changes(high), strict=True):
        changed.append((trial, use, columns | {key: (reading + change)[:, i] for i, key in enumerate(texels)}))
    return replace(cleaned.recording, name=f"{cleaned.recording.name} with {name}", trials=changed)


def _resting_value(channel: np.ndarray) -> float:
    """Median of the first five values that were measured."""
    return float(np.median(channel[np.isfinite(channel)][:5]))


def _rms_beyond_refitting(changes: list[np.ndarray], readings: list[np.ndarray], times: list[np.ndarray]) -> float:
    """Root mean square of changes, less what a common gain, zero and damping make of the readings."""
    rates = [np.gradient(r, t, axis=0) for r, t in zip(readings, times, strict=True)]
    change, reading, rate = (np.concatenate([a.ravel() for a in arrays]) for arrays in (changes, readings, rates))
    good = np.isfinite(change) & np.isfinite(reading) & np.isfinite(rate)
    table = np.column_stack([reading[good], np.ones(good.sum()), rate[good]])
    weights, *_ = np.linalg.lstsq(table / np.linalg.norm(table, axis=0), change[good], rcond=None)
    return float(np.sqrt(np.mean((change[good] - table / np.linalg.norm(table, axis=0) @ weights) ** 2)))
