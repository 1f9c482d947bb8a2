# SPDX-License-Identifier: GPL-3.0-or-later
"""Phases of contact, and the features of a trial on which a residual may depend."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .predictor import Predictor
from .stimulus import Stimulus

PHASES = ("approach", "loading", "hold", "unloading", "released", "sliding")
HOLD_RATE = 0.02
"""Rate, in shares of the largest load per second, below which a texel counts as held."""
HOLD_RATE_SHARE = 0.2
"""In a slow trial the limit is this share of the trial's own fastest rates (their 99 % quantile)."""
ROUNDING_RATE = 1e-6
"""Least limit: smaller rates are rounding errors."""
SLIDING_SPEED = 2e-4
"""Metres per second above which a held surface counts as sliding."""


def relative_load(stimulus: Stimulus) -> np.ndarray:
    """Return the load of each texel, depth or force, as a share of the largest in the trial, (T, n) float."""
    load = stimulus.load
    return load / max(float(load.max(initial=0.0)), 1e-300)


def hold_rate_limit(rate: np.ndarray) -> float:
    """Return the rate below which a load counts as held.

    Parameters
    ----------
    rate : float, 1/s
        Rates of the load, as a share of the largest load.
    """
    if not rate.size:
        return HOLD_RATE
    return float(np.clip(HOLD_RATE_SHARE * np.quantile(np.abs(rate), 0.99), ROUNDING_RATE, HOLD_RATE))


def phase_indices(stimulus: Stimulus) -> np.ndarray:
    """Return the phase of each texel at each sample as index into :data:`PHASES`, (T, n) int."""
    load = relative_load(stimulus)
    rate = np.gradient(load, stimulus.time, axis=0)
    still = hold_rate_limit(rate[load > 0]) * np.maximum(load.max(axis=0, keepdims=True), 1e-12)
    touching = load > 0
    first_of = {
        "sliding": touching & (np.abs(rate) <= 5 * still) & (stimulus.slide_speed > SLIDING_SPEED),
        "unloading": touching & (rate < -still),
        "loading": touching & (rate > still),
        "hold": touching,
        "approach": ~np.maximum.accumulate(touching, axis=0),
    }
    return np.select(list(first_of.values()), list(map(PHASES.index, first_of)), PHASES.index("released"))


CONSTANT_LOAD = 1e-9
"""Largest change, as a share of the largest load, of a load that counts as constant. Nothing can depend on it."""
TRAVEL_BANDS = (0.0, 0.02, 0.04, 0.06, 0.09, 0.12, 0.16, 0.2, 0.25, 0.32, 0.4, 1.01)
"""Bands of the travel since the surface turned back, as shares of the longest."""
UNLOADING_RATE = -0.005
"""Rate, as a share of the largest, below which a texel is unloaded."""
RELAXATION_TIMES = (0.1, 1.0, 8.0)
"""Seconds: times of the exponentials by which a residual may depend on the time since contact."""
NEAREST = 4
"""Number of nearest texels whose load counts as that of the neighbours."""
MANY_TEXELS = 2000
"""Number of texels above which the mean load stands for that of the neighbours: distances of all pairs would fill the
memory."""
LEAST_OTHERS = 0.05
"""Least sum of squares of the others' loads from which the pattern that they share is estimated."""


FEATURES: dict[str, str] = {
    "depth": "the depth",
    "rate and direction": "the rate and direction of loading",
    "time since contact": "the time since contact began",
    "history": "the previous loads",
    "neighbours": "the load on neighbouring texels",
    "texel": "the texel",
    "sliding": "the direction and speed of sliding",
    "turning": "the distance slid since the last reversal",
    "clock": "the clock time",
    "common mode": "a signal that all texels share, loaded or not",
    "shared by loaded texels": "a signal that all loaded texels share",
}


def known_readings(predictor: Predictor) -> np.ndarray:
    """Return where readings are known, (T, n) bool; everywhere if there are no readings at all."""
    reading, everywhere = predictor.trial.reading, np.ones(predictor.stimulus.load.shape, bool)
    known = everywhere if reading is None else np.isfinite(reading)
    return known if known.any() else everywhere


def features(predictor: Predictor, residual: np.ndarray) -> dict[str, np.ndarray]:
    """Return features of each texel at each sample, arrays (f, T, n) by group of :data:`FEATURES`.

    Parameters
    ----------
    predictor : Predictor
    residual : (T, n) float
        Used for the last two groups, which contain the residual of the other texels.
    """
    s, time = predictor.stimulus, predictor.stimulus.time
    d = relative_load(s)
    rate = np.gradient(d, time, axis=0)
    rate /= max(float(np.abs(rate).max(initial=0.0)), 1e-300)
    touching = d > 0
    since = _time_since_contact(touching, time)
    top = np.maximum.accumulate(d, axis=0)
    step = np.diff(time, prepend=time[0])[:, None]
    done = np.cumsum(d * step, axis=0)
    done /= max(float(done.max(initial=0.0)), 1e-300)
    falling = rate < UNLOADING_RATE
    clock = np.broadcast_to(((time - time[0]) / max(time[-1] - time[0], 1e-300))[:, None], d.shape)
    groups = {
        "depth": [d, d**2, d**3, touching.astype(float)],
        "rate and direction": [rate, np.abs(rate), d * falling, d**2 * falling, np.abs(rate) ** 0.3 * np.sign(rate)],
        "time since contact": [*(d * np.exp(-since / tau) for tau in RELAXATION_TIMES), np.exp(-since) * touching],
        "history": [top - d, (top - d) * touching, top**2 - d**2, done * d, done],
        "clock": [clock, clock**2, clock * d],
    }
    if np.ptp(d) < CONSTANT_LOAD:
        del groups["depth"]
    if predictor.trial.reading is None and s.slip is not None:
        groups |= _sliding_features(s.slip, time, d.shape)
    if d.shape[1] > 1:
        around = _neighbour_load(predictor, d)
        groups["neighbours"] = [around - d, around * touching, np.broadcast_to(d.mean(axis=1, keepdims=True), d.shape)]
        # A missing reading is no residual of zero: it is no other texel either.
        known = known_readings(predictor).astype(float)
        others = (residual.sum(axis=1, keepdims=True) - residual) / np.maximum(known.sum(axis=1, keepdims=True) - known, 1.0)
        groups["common mode"] = [others]
        groups["shared by loaded texels"] = [_pattern_of_others(residual, shape, known) for shape in (d, rate)]
    return {name: np.stack(columns) for name, columns in groups.items()}


def _sliding_features(slip: np.ndarray, time: np.ndarray, shape: tuple[int, ...]) -> dict[str, list[np.ndarray]]:
    """Speed in the main direction of sliding, and travel since that speed last changed its sign. `slip` (T, n, 3) is in m/s,
    `time` (T,) in s, and `shape` that of the features, (T, n).
    """
    mean = slip.mean(axis=1)
    _, _, axes = np.linalg.svd(mean, full_matrices=False)
    along = axes[0] * np.sign(axes[0][np.argmax(np.abs(axes[0]))])  # the same in every trial
    speed = mean @ along
    sign, fast = np.where(speed < 0, -1.0, 1.0), max(float(np.abs(speed).max()), 1e-300)
    step = np.abs(speed) * np.diff(time, prepend=time[0])
    way = np.cumsum(step)
    turned = np.concatenate([[False], sign[1:] * sign[:-1] < 0])
    since = way - np.maximum.accumulate(np.where(turned, way, 0.0))
    since /= max(float(since.max()), 1e-300)
    wide = lambda x: np.broadcast_to(x[:, None], shape)  # noqa: E731
    bands = [wide(sign * ((since >= a) & (since < b))) for a, b in pairwise(TRAVEL_BANDS)]
    return {"sliding": [wide(x) for x in (np.ones(len(sign)), sign, speed / fast, (speed / fast) ** 2)], "turning": bands}


def _time_since_contact(touching: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Seconds since the current contact of each texel began, (T, n); zero without contact."""
    began = touching.copy()
    began[1:] &= ~touching[:-1]
    start = np.maximum.accumulate(np.where(began, time[:, None], -np.inf), axis=0)
    return np.where(touching, time[:, None] - start, 0.0)


def _neighbour_load(predictor: Predictor, d: np.ndarray) -> np.ndarray:
    """Mean load of the four nearest texels, (T, n).

    Ties of the distance are common on a grid; the sorted table of all distances breaks them in the same way everywhere.
    """
    p = predictor.rig.texels.position
    count = min(NEAREST, len(p) - 1)
    if len(p) > MANY_TEXELS:
        return np.broadcast_to(d.mean(axis=1, keepdims=True), d.shape)
    distance = np.linalg.norm(p[:, None] - p[None], axis=2)
    nearest = np.argsort(distance, axis=1)[:, 1 : count + 1]
    mean = np.zeros_like(d)
    for k in range(count):
        mean += d[:, nearest[:, k]]
    return mean / count


def _pattern_of_others(residual: np.ndarray, shape: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Residual that each texel would have if all followed `shape` with one amplitude per sample, found from the others.

    `known` (T, n) is zero where a reading is missing, and one elsewhere.
    """
    shape = shape * known
    top = (residual * shape).sum(axis=1, keepdims=True) - residual * shape
    square = (shape * shape).sum(axis=1, keepdims=True) - shape * shape
    # A texel that is nearly alone under load has no others to compare with.
    amplitude = np.where(square > LEAST_OTHERS, top / np.maximum(square, LEAST_OTHERS), 0.0)
    return amplitude * shape
