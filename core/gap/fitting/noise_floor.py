# SPDX-License-Identifier: GPL-3.0-or-later
"""What a recording can tell: its noise floor, and which of the things that betray an effect were done to the sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..forward.contact_phases import hold_rate_limit
from ..forward.predictor import Predictor

UNLOADED_SHARE = 0.03
"""Share of the largest load of a trial up to which a texel counts as carrying nothing: zeros of load cells wander."""
SHORTEST_STRETCH = 8
"""Samples of a stretch without load that say something about noise."""


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of one channel.

    Attributes
    ----------
    deviation : float
        Standard deviation, in the channel's unit.
    correlation_time : float
        Samples after which noise is new: 1 for white noise (the integral of its autocorrelation).
    source : str
        Where it was measured, in words.
    """

    deviation: float
    correlation_time: float
    source: str


def reading_noise(predictors: Sequence[Predictor], full: float) -> ChannelNoise:
    """Measure the noise of the readings where the texels carry nothing.

    Each stretch without load of each texel is a sample; what all texels do together and what drifts linearly is not noise. The
    median over the samples is taken, so that a few texels that answer to their neighbours do not count. Where no stretch is
    long enough, second differences of the readings are used, which only white noise survives.

    Parameters
    ----------
    full : float
        Range of the readings; noise below a ten-thousandth of it is taken as that.
    """
    variances: list[float] = []
    weights: list[float] = []
    curves: list[np.ndarray] = []
    for predictor in predictors:
        reading = predictor.trial.reading
        if reading is None:
            continue
        for start, stop in _unloaded_stretches(predictor):
            for texels in _unloaded_texels(predictor, start, stop):
                part = reading[start:stop][:, texels]
                part = part[:, np.isfinite(part).all(axis=0)]
                if part.shape[1]:
                    variance, curve = _variance_and_autocovariance(part)
                    variances += list(variance)
                    weights += [float(stop - start)] * len(variance)
                    curves.append(curve * (stop - start) * part.shape[1])
    smallest = 1e-4 * full
    alive = np.array(variances) > smallest**2
    if alive.sum() >= 1:
        values, weight = np.array(variances)[alive], np.array(weights)[alive]
        order = np.argsort(values)
        share = np.cumsum(weight[order]) / weight.sum()
        middle = values[order][np.searchsorted(share, 0.5)]
        return ChannelNoise(float(np.sqrt(middle)), _correlation_time(curves), "stretches without load")
    second = [_white_noise_deviation(p.trial.reading) for p in predictors if p.trial.reading is not None]
    deviation = float(np.median(np.concatenate(second))) if second else 0.0
    return ChannelNoise(max(deviation, smallest), 1.0, "differences between samples")


def force_noise(predictors: Sequence[Predictor], full: float) -> ChannelNoise:
    """Measure the noise of the force sensor, from second differences: there is no texel beside it to compare with."""
    second = [_white_noise_deviation(p.trial.force) for p in predictors if p.trial.force is not None]
    deviation = float(np.nanmedian(np.concatenate(second))) if second else 0.0
    return ChannelNoise(max(deviation if np.isfinite(deviation) else 0.0, 1e-4 * full), 1.0, "differences between samples")


def _unloaded_stretches(predictor: Predictor) -> list[tuple[int, int]]:
    """Stretches of samples in which nothing touches at all, and the whole trial for texels that are never touched."""
    stimulus = predictor.stimulus
    load = stimulus.load
    free = ~(load > 0).any(axis=1)
    found = [(a, b) for a, b in _runs(free) if b - a >= SHORTEST_STRETCH]
    return [*found, (0, len(load))]


def _unloaded_texels(predictor: Predictor, start: int, stop: int) -> list[np.ndarray]:
    """Texels that carry nothing in a stretch."""
    stimulus = predictor.stimulus
    load = stimulus.load
    (texels,) = np.nonzero(~(load[start:stop] > 0).any(axis=0))
    return [texels] if len(texels) else []


def _variance_and_autocovariance(part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variance of each column (c,) about a line and the common mode, and the mean autocovariance at lags up to a quarter."""
    samples, columns = part.shape
    if columns >= 8:
        part = part - np.median(part, axis=1, keepdims=True)
    t = np.linspace(-1.0, 1.0, samples)[:, None]
    part = part - part.mean(axis=0) - t * (t * part).sum(axis=0) / (t * t).sum()
    variance = (part * part).sum(axis=0) / (samples - 2)
    lags = np.arange(64)
    curve = np.zeros(len(lags))
    kept = variance <= np.median(variance) * 2.0 + 1e-300
    for lag in lags[: samples // 4 + 1]:
        curve[lag] = float((part[: samples - lag, kept] * part[lag:, kept]).sum() / max(samples - lag, 1)) / max(kept.sum(), 1)
    return variance, curve


def _correlation_time(curves: list[np.ndarray]) -> float:
    total = sum(curves, np.zeros(64))
    if total[0] <= 0:
        return 1.0
    correlation = total / total[0]
    below = np.flatnonzero(correlation < 0.05)
    last = below[0] if len(below) else len(correlation)
    return float(max(1.0, 1.0 + 2.0 * correlation[1:last].sum()))


def _white_noise_deviation(values: np.ndarray) -> np.ndarray:
    """Standard deviation of white noise in each column (c,), whatever smooth signal is under it."""
    values = values[np.isfinite(values).all(axis=1)]
    if len(values) < 5:
        return np.zeros(values.shape[1])
    second = values[2:] - 2.0 * values[1:-1] + values[:-2]
    return 1.4826 * np.median(np.abs(second), axis=0) / np.sqrt(6.0)


@dataclass(frozen=True)
class Coverage:
    """What the trials do to the sensor, as far as it matters for telling effects apart.

    Attributes
    ----------
    touched_share : float
        Share of the texels that are ever touched.
    speed_ratio : float
        Ratio of fast to slow loading (90th to 10th percentile of the speed while loading).
    longest_hold : float, s
    unloading : bool
        Whether a load was ever taken back by more than a tenth of the largest, while it was recorded.
    cycles : int
        Times that contact began, in the trial that has most.
    slides : bool
    unloaded_share : float
        Share of a trial between the first and the last moment at which a texel carries nothing; the largest of all trials.
    load_moves : bool
        Whether what presses part of the texels did so at more than one place.
    held_load_ratio : float
        Largest of the loads that were held for a while, by the smallest.
    """

    touched_share: float
    speed_ratio: float
    longest_hold: float
    unloading: bool
    cycles: int
    slides: bool
    unloaded_share: float
    load_moves: bool = True
    held_load_ratio: float = 1.0


def coverage(predictors: Sequence[Predictor]) -> Coverage:
    """Look at what trials cover."""
    texels = predictors[0].rig.texels
    touched, middles = np.zeros(len(texels), bool), []
    speeds: list[np.ndarray] = []
    levels: list[float] = []
    hold, unloading, cycles, slides, rest = 0.0, False, 0, False, 0.0
    for predictor in predictors:
        s = predictor.stimulus
        load = s.load
        touched |= (load > 0).any(axis=0)
        pressed = load.sum(axis=1)
        at = pressed > 0.05 * max(float(pressed.max(initial=0.0)), 1e-300)
        middles.append(load[at] @ texels.position / pressed[at, None])
        total = load.max(axis=1)
        full = max(total.max(initial=0.0), 1e-300)
        rate = np.gradient(total, s.time) / full
        pace = hold_rate_limit(rate[total > 0])
        speeds.append(rate[rate > pace])
        unloading |= bool((np.maximum.accumulate(total) - total).max() > 0.1 * full)
        still = (np.abs(rate) < pace) & (total > 0.05 * full)
        holds = _runs(still)
        hold = max([hold, *(float(s.time[min(b, len(total) - 1)] - s.time[a]) for a, b in holds)])
        levels += [float(total[a:b].mean()) for a, b in holds if b - a >= SHORTEST_STRETCH]
        idle = s.time[(load <= UNLOADED_SHARE * max(float(load.max(initial=0.0)), 1e-300)).any(axis=1)]
        rest = max(rest, float(np.ptp(idle)) / float(np.ptp(s.time)) if len(idle) else 0.0)
        starts = np.flatnonzero((total > 0) & (np.concatenate([[0.0], total[:-1]]) <= 0))
        cycles = max(cycles, len(starts))
        slides |= bool(s.slide.max(initial=0.0) > 1e-5)
    quick = np.concatenate(speeds) if speeds else np.zeros(0)
    spread = float(np.quantile(quick, 0.9) / np.quantile(quick, 0.1)) if len(quick) > 4 else 1.0
    return Coverage(
        touched_share=float(touched.mean()),
        speed_ratio=spread,
        longest_hold=hold,
        unloading=unloading,
        cycles=cycles,
        slides=slides,
        unloaded_share=rest,
        load_moves=_load_moves(np.concatenate(middles), texels.area, touched),
        held_load_ratio=max(levels) / min(levels) if levels else 1.0,
    )


def _load_moves(middle: np.ndarray, area: np.ndarray, touched: np.ndarray) -> bool:
    """Whether the middle of the load (T, 3) moved by more than a texel's width; where most texels are touched it need not."""
    if len(middle) == 0 or touched.mean() > 0.5:
        return True
    return float(np.ptp(middle, axis=0).max()) > float(np.sqrt(np.median(area)))


def _runs(flag: np.ndarray) -> list[tuple[int, int]]:
    """First sample of each stretch for which a flag is set, and the one behind it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(int))).reshape(-1, 2)
    return [(int(a), int(b)) for a, b in edges]
