# SPDX-License-Identifier: GPL-3.0-or-later
"""A known effect, in a formula that the library does not have, put on top of real recordings.

The recordings keep their stimulus, their noise and all that no effect of the library explains; what the workflow did find in
them is taken out first, since the question is about one effect more. How large that one is, is counted in units of what was
left unexplained (root mean squares), without what a refitted gain, zero or damping takes up of it.
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
LARGEST, STRONGEST = 0.3, 6.0
"""Share of the range, and strength: beyond them it is no effect on a sensor but another sensor."""
Change = Callable[[np.ndarray, np.ndarray, np.ndarray, float], np.ndarray]
"""From times (T,) since a recording began, in shares of the longest one's length, loads (T, 1) and readings (T, n), both in
shares of the largest, with a strength, to what a sensor with the effect reads: one sensor, in long recordings and short."""


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
BETWEEN_TEXELS = ("gain-mismatch", "offset")


@dataclass(frozen=True)
class Ground:
    """Recordings without what was found in them.

    Attributes
    ----------
    recording : Recording
    rest : float
        Root mean square of what was left unexplained, in the sensor's unit, and
    share : float
        the same as a share of the range.
    """

    recording: Recording
    rest: float
    share: float


def without_what_was_found(recording: Recording, result: Any) -> Ground:
    """Take what the effects that were found change in the model off the readings."""
    trials, left = [], []
    for predictor, (name, use, columns) in zip(result.predictors, recording.trials, strict=True):
        best, base = (predictor.predict(model).reading for model in (result.best.model, result.base.model))
        freed = predictor.trial.reading - (best - base)
        left.append((predictor.trial.reading - best).ravel())
        trials.append((name, use, columns | {f"texel_{i}": texel for i, texel in enumerate(freed.T)}))
    rest = float(np.sqrt(np.nanmean(np.concatenate(left) ** 2)))
    return Ground(replace(recording, trials=trials), rest, rest / result.full[0])


def every(recording: Recording, step: int) -> Recording:
    """The same recordings of each `step`-th texel under a force that all share."""
    trials: list[tuple[str, str, Columns]] = []
    for name, use, columns in recording.trials:
        texels = [value for key, value in columns.items() if key.startswith("texel_")]
        kept = texels[::step]
        rest = {"time": columns["time"], "force": columns["force"] * len(kept) / len(texels)}
        trials.append((name, use, rest | {f"texel_{i}": value for i, value in enumerate(kept)}))
    return replace(recording, sensor=re.sub(r"columns = \d+", f"columns = {len(kept)}", recording.sensor), trials=trials)


def read_in_turn(recording: Recording) -> bool:
    """Whether channels are read one after the other: a number for each does then all that a drift does, and not the reverse."""
    tables = [np.stack([v for k, v in columns.items() if k.startswith("texel_")], axis=1) for _, _, columns in recording.trials]
    return all(table.shape[1] > 1 and (np.isfinite(table).sum(axis=1) <= 1).all() for table in tables)


def with_effect(ground: Ground, name: str, size: float) -> Recording | None:
    """Return recordings with an effect of a size in units of what was left unexplained; None where it does not get so large."""
    trials = ground.recording.trials
    texels = [key for key in trials[0][2] if key.startswith("texel_")]
    if name in BETWEEN_TEXELS and len(texels) == 1:
        return None
    readings = [np.stack([columns[key] for key in texels], axis=1) for _, _, columns in trials]
    zero = np.array([_first(channel) for channel in np.concatenate(readings).T])
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
        return _beyond_refitting(made, readings, times)

    strengths = np.geomspace(1e-3, STRONGEST, 14)
    enough = [float(s) for s in strengths if size_of(changes(float(s))) >= size * ground.rest]
    if not enough or size * ground.share > LARGEST:
        return None
    low, high = enough[0] * float(strengths[0] / strengths[1]), enough[0]
    for _ in range(12):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if size_of(changes(middle)) < size * ground.rest else (low, middle)
    changed = []
    for (trial, use, columns), reading, change in zip(trials, readings, changes(high), strict=True):
        changed.append((trial, use, columns | {key: (reading + change)[:, i] for i, key in enumerate(texels)}))
    return replace(ground.recording, name=f"{ground.recording.name} with {name}", trials=changed)


def _first(channel: np.ndarray) -> float:
    """Median of the first five values that were measured."""
    return float(np.median(channel[np.isfinite(channel)][:5]))


def _beyond_refitting(changes: list[np.ndarray], readings: list[np.ndarray], times: list[np.ndarray]) -> float:
    """Root mean square of what a common gain, zero and damping cannot make of the readings."""
    rates = [np.gradient(r, t, axis=0) for r, t in zip(readings, times, strict=True)]
    change, reading, rate = (np.concatenate([a.ravel() for a in arrays]) for arrays in (changes, readings, rates))
    good = np.isfinite(change) & np.isfinite(reading) & np.isfinite(rate)
    table = np.column_stack([reading[good], np.ones(good.sum()), rate[good]])
    weights, *_ = np.linalg.lstsq(table / np.linalg.norm(table, axis=0), change[good], rcond=None)
    return float(np.sqrt(np.mean((change[good] - table / np.linalg.norm(table, axis=0) @ weights) ** 2)))
