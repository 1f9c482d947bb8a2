# SPDX-License-Identifier: GPL-3.0-or-later
"""The noise of the recordings, and their coverage: which signatures of effects the trials can contain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...errors import FileError
from ..dataset.trial import UNLOADED_SHARE, columns_at, runs
from ..forward.contact_phases import hold_rate_limit
from ..forward.predictor import Predictor

SHORTEST_STRETCH = 8
"""Least number of samples of an unloaded stretch from which noise is measured, and of a hold whose load is compared."""
SMALLEST_NOISE = 1e-4
"""Least standard deviation of the noise, as a share of the range."""
AUTOCOVARIANCE_LAGS = 64
MANY_TEXELS = 8
"""Number of texels from which on their common mode is removed before their noise is measured."""
OUTLIER_VARIANCE = 2.0
"""Texels with more than this many times the median variance do not count in the autocovariance."""
WHITE_CORRELATION = 0.05
"""Autocorrelation below which samples count as uncorrelated."""
LEAST_DIFFERENCES = 3
"""Least number of known second differences from which the noise of a column is measured."""
MAD_TO_DEVIATION = 1.4826
"""Standard deviation of a normal distribution divided by its median absolute deviation."""
DEAD_BAND, LEAST_BAND = 5.0, 1e-4
"""Half the width of the dead band behind which cycles and holds of a measured load are counted, in standard deviations of its
noise; and the share of the largest load from which on there is such noise."""
ALTERNATION = -0.3
"""Correlation of neighbouring second differences of a load, below which they are noise."""
LEAST_NOISY_SHARE = 0.2
"""Share of the loaded samples in which a load has to change its rate, or it has no noise: weights that are put down change it
in few samples. Of 200 simulated rows of weights the share was at most 0.13, of 390 noisy loads with steps of up to four
deviations at least 0.29. Of two other families, 60 piles of weights and 60 slow waves, all were judged right
(tests/core/gap/fitting/test_noise.py)."""
PRESSED_SHARE, UNLOADING_SHARE = 0.05, 0.1
"""Shares of the largest load: above the first the sensor counts as pressed; a decrease by the second is an unloading."""
LEAST_SLIDING_SPEED = 1e-5
"""Metres per second above which a surface slides."""
MOST_OF_THE_TEXELS = 0.5
"""If more than this share of the texels is touched, the load need not move to touch different ones."""


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of a channel.

    Attributes
    ----------
    deviation : float
        Standard deviation, in the channel's unit.
    correlation_time : float
        Integral of the autocorrelation, in samples: 1 for white noise.
    source : str
        Where it was measured, in words.
    """

    deviation: float
    correlation_time: float
    source: str


def reading_noise(predictors: Sequence[Predictor], full: float) -> ChannelNoise:
    """Measure the noise of the readings without load.

    Every unloaded stretch of every texel gives an estimate of the variance, without the texels' common mode and a linear drift.
    The result is the weighted median of these, so that a few texels that respond to their neighbours do not matter. If no
    stretch is long enough, second differences of the readings are used, which assumes white noise.

    Parameters
    ----------
    predictors : sequence of Predictor
    full : float
        Range of the readings; smaller noise than a ten-thousandth of it is taken as that.
    """
    parts = [_variance_and_autocovariance(part) for predictor in predictors for part in _unloaded_parts(predictor)]
    values, weight = (np.concatenate([np.zeros(0), *(part[i] for part in parts)]) for i in (0, 2))
    smallest = SMALLEST_NOISE * full
    alive = values > smallest**2
    if alive.any():
        values, weight = values[alive], weight[alive]
        order = np.argsort(values)
        share = (np.cumsum(weight[order]) - 0.5 * weight[order]) / weight.sum()
        middle = np.interp(0.5, share, values[order])
        curves = [curve * known.sum() for _, curve, known in parts]
        return ChannelNoise(float(np.sqrt(middle)), integral_time(curves), "stretches without load")
    deviation = _white_noise_deviation([p.trial.reading for p in predictors if p.trial.reading is not None])
    return ChannelNoise(max(deviation, smallest), 1.0, "differences between samples")


def force_noise(predictors: Sequence[Predictor], full: float) -> ChannelNoise:
    """Measure the noise of the force sensor from second differences: there is no other channel to compare with."""
    deviation = _white_noise_deviation([p.trial.force for p in predictors if p.trial.force is not None])
    return ChannelNoise(max(deviation, SMALLEST_NOISE * full), 1.0, "differences between samples")


def _unloaded_parts(predictor: Predictor) -> list[np.ndarray]:
    """Readings of untouched texels, (t, c): in each stretch without any contact, and those never touched in the whole trial."""
    reading, pressed = predictor.trial.reading, predictor.stimulus.load > 0
    if reading is None:
        return []
    free = [(a, b) for a, b in runs(~pressed.any(axis=1)) if b - a >= SHORTEST_STRETCH]
    return [reading[a:b][:, ~pressed[a:b].any(axis=0)] for a, b in (*free, (0, len(pressed)))]


def _variance_and_autocovariance(part: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Variance of each column (c,), the mean autocovariance (64,), and known values (c,), without lines and the common mode.

    For white noise the median of such variances, not their mean, is unbiased: the median of a chi-squared variable of ν degrees
    of freedom is ν (1 - 2/9ν)³ (Wilson and Hilferty, Proc. Natl. Acad. Sci. 17, 1931). Missing values are NaN. The
    autocovariance is computed up to lags of a quarter of the samples, over pairs of known values.
    """
    samples = len(part)
    part = _about_lines(part)
    if part.shape[1] >= MANY_TEXELS:
        together = np.isfinite(part).sum(axis=1)
        enough = together >= MANY_TEXELS // 2
        part[~enough] = np.nan
        part[enough] -= np.nanmedian(part[enough], axis=1, keepdims=True)
        # The variance of the median of n standard normal values is π/2n in the limit. The terms beside a small n were found by
        # simulation (4·10⁵ draws each); from four values on the variance is right within 0.005.
        of_median = np.pi / 2.0 / (together + np.where(together % 2, 0.45, 1.35))
        part /= np.sqrt(1.0 - 2.0 / np.maximum(together, 3) + of_median)[:, None]
        part = _about_lines(part)  # where cells are missing, lines and the common mode depend on each other
    known = np.isfinite(part)
    count = known.sum(axis=0)
    part = np.where(known, part, 0.0)
    freedom = count - 2
    variance = (part * part).sum(axis=0) / (freedom * (1.0 - 2.0 / (9.0 * freedom)) ** 3)
    curve = np.zeros(AUTOCOVARIANCE_LAGS)
    if len(variance) == 0:
        return variance, curve, count
    kept = variance <= np.median(variance) * OUTLIER_VARIANCE + 1e-300
    for lag in range(min(AUTOCOVARIANCE_LAGS, samples // 4 + 1)):
        first, second = slice(0, samples - lag), slice(lag, samples)
        pairs = float((known[first] & known[second])[:, kept].sum())
        curve[lag] = float((part[first, kept] * part[second, kept]).sum()) / max(pairs, 1.0)
    return variance, curve, count


def _about_lines(part: np.ndarray) -> np.ndarray:
    """The columns with enough known values, each less its regression line; missing values stay NaN."""
    known = np.isfinite(part)
    enough = known.sum(axis=0) >= SHORTEST_STRETCH
    part, known = part[:, enough], known[:, enough]
    count = known.sum(axis=0)
    t = np.linspace(-1.0, 1.0, len(part))[:, None]
    t = np.where(known, t - (t * known).sum(axis=0) / count, 0.0)
    part = part - np.nansum(part, axis=0) / count
    return part - t * np.nansum(t * part, axis=0) / (t * t).sum(axis=0)


def integral_time(curves: list[np.ndarray]) -> float:
    """Return the integral of the autocorrelation up to where it vanishes, in samples, from autocovariances (64,)."""
    total = sum(curves, np.zeros(AUTOCOVARIANCE_LAGS))
    if total[0] <= 0:
        return 1.0
    correlation = total / total[0]
    below = np.flatnonzero(correlation < WHITE_CORRELATION)
    last = below[0] if len(below) else len(correlation)
    return float(max(1.0, 1.0 + 2.0 * correlation[1:last].sum()))


def _white_noise_deviation(values: Sequence[np.ndarray]) -> float:
    """Median, over columns of arrays (T, c), of the standard deviation of white noise on top of any smooth signal; 0 if in no
    column enough values are known.
    """
    deviations = []
    for column in (column for array in values for column in array.T):
        second = column[2:] - 2.0 * column[1:-1] + column[:-2]
        known = np.abs(second[np.isfinite(second)])
        if len(known) >= LEAST_DIFFERENCES:
            deviations.append(MAD_TO_DEVIATION * np.median(known) / np.sqrt(6.0))
    return float(np.median(deviations)) if deviations else 0.0


@dataclass(frozen=True)
class Coverage:
    """Coverage of the trials: features of their stimuli that help to distinguish effects.

    Attributes
    ----------
    touched_share : float
        Share of the texels that are ever touched.
    speed_ratio : float
        Ratio of fast to slow loading: 90th to 10th percentile of the speed during loading.
    longest_hold : float, s
    unloading : bool
        True if a load ever decreased by more than a tenth of the largest.
    cycles : int
        Number of times that contact began, in the trial or session with most.
    slides : bool
        True if a surface slid over the sensor.
    unloaded_share : float
        Share of a trial between the first and the last time that a texel was unloaded; the largest of all trials.
    load_moves : bool
        True if the load moved over the texels, or touched most of them.
    held_load_ratio : float
        Ratio of the largest to the smallest load that was held.
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
    """Return the coverage of the trials of some predictors."""
    texels = predictors[0].rig.texels
    touched, centres = np.zeros(len(texels), bool), []
    speeds: list[np.ndarray] = []
    levels: list[float] = []
    hold, unloading, slides, rest = 0.0, False, False, 0.0
    cycles: dict[object, int] = {}
    for predictor in predictors:
        s = predictor.stimulus
        load = s.load
        touched |= (load > 0).any(axis=0)
        pressed = load.sum(axis=1)
        at = pressed > PRESSED_SHARE * max(float(pressed.max(initial=0.0)), 1e-300)
        centres.append(load[at] @ texels.position / pressed[at, None])
        raw = load.max(axis=1)
        full = max(raw.max(initial=0.0), 1e-300)
        total, rate, band = _without_load_noise(raw, s.time)
        rate = rate / full
        pace = hold_rate_limit(rate[total > 0])
        speeds.append(rate[rate > pace])
        unloading |= bool((np.maximum.accumulate(total) - total).max() > UNLOADING_SHARE * full)
        still = (np.abs(rate) < pace) & (total > PRESSED_SHARE * full)
        holds = runs(still)
        hold = max([hold, *(float(s.time[min(b, len(total) - 1)] - s.time[a]) for a, b in holds)])
        levels += [float(total[a:b].mean()) for a, b in holds if b - a >= SHORTEST_STRETCH]
        idle = s.time[(load <= UNLOADED_SHARE * max(float(load.max(initial=0.0)), 1e-300)).any(axis=1)]
        rest = max(rest, float(np.ptp(idle)) / float(np.ptp(s.time)) if len(idle) else 0.0)
        where = predictor.trial.session or id(predictor)  # the sensor remembers the cycles of a whole session
        cycles[where] = cycles.get(where, 0) + _cycle_count(total, max(UNLOADED_SHARE * full, band))
        slides |= bool(s.slide_speed.max(initial=0.0) > LEAST_SLIDING_SPEED)
    quick, centre = np.concatenate(speeds), np.concatenate(centres)
    mostly_touched = bool(touched.mean() > MOST_OF_THE_TEXELS)
    spread = float(np.quantile(quick, 0.9) / np.quantile(quick, 0.1)) if len(quick) > 4 else 1.0
    return Coverage(
        touched_share=float(touched.mean()),
        speed_ratio=spread,
        longest_hold=hold,
        unloading=unloading,
        cycles=max(cycles.values()),
        slides=slides,
        unloaded_share=rest,
        load_moves=mostly_touched or len(centre) == 0 or bool(np.ptp(centre, axis=0).max() > np.sqrt(np.median(texels.area))),
        held_load_ratio=max(levels) / min(levels) if levels else 1.0,
    )


def _without_load_noise(load: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """A load (T,) behind a dead band as wide as its noise, its rate (T,), and the band.

    A load that is programmed has no noise, and is returned as it is. Behind the dead band a measured load only moves if it
    leaves the band. Where it rests there, its rate is that of a line through the measured values: a slow ramp is no hold.
    """
    band = DEAD_BAND * _load_noise(load)
    if not band > LEAST_BAND * max(float(load.max(initial=0.0)), 1e-300):
        return load, np.gradient(load, time), 0.0
    out = np.empty_like(load)
    at = low = high = float(load[0])
    edges = [0]  # of pieces in which it moves by less than half the band
    for i, value in enumerate(load.tolist()):
        at = min(max(at, value - band), value + band)
        low, high = min(low, at), max(high, at)
        if high - low > 0.5 * band:
            edges.append(i)
            low = high = at
        out[i] = at
    out = np.maximum(out, 0.0)
    rate = np.gradient(out, time)
    for a, b in pairwise([*edges, len(load)]):
        if b - a >= SHORTEST_STRETCH:
            t = time[a:b] - time[a:b].mean()
            rate[a:b] = float(t @ load[a:b]) / float(t @ t)
    return out, rate, band


def _load_noise(load: np.ndarray) -> float:
    """Standard deviation of the noise of a load (T,); 0 if its second differences are those of a smooth curve.

    Those of white noise have a correlation of -2/3 from sample to sample, those of a curve a positive one.
    """
    second = np.diff(load, 2)
    pressed = load[1:-1] > PRESSED_SHARE * float(load.max(initial=0.0))  # a force below zero counts as none
    moving = second[pressed & (second != 0.0)]
    if len(moving) < max(SHORTEST_STRETCH, LEAST_NOISY_SHARE * pressed.sum()) or float(
        second[1:] @ second[:-1]
    ) > ALTERNATION * float(second @ second):
        return 0.0
    return float(MAD_TO_DEVIATION * np.median(np.abs(moving)) / np.sqrt(6.0))


def _cycle_count(load: np.ndarray, band: float) -> int:
    """Number of times that a load (T,) rises above twice a dead band after it was within the band, or begins above it."""
    state = np.where(load > 2.0 * band, 1, np.where(load <= band, 0, -1))
    known = state[state >= 0]
    return int(np.count_nonzero(np.diff(known, prepend=0) > 0))


MEASURED_REPEATS = "measured repeats"
"""Source of such noise, in words."""
MOST_DIFFERENT = 0.1
"""Root mean square difference of the loads of two repeats, as a share of the largest load, above which they are none."""

MOST_SQUARE = 2.0
"""Mean square of a fit's residual, in units of the variance of repeats, up to which the residual is their scatter. In simulated
sets of four repeats that differed in gain, zero, delay or by a slow wander, the base model left 0.3 to 1.6 where nothing was
hidden (6 sets), 1.3 where the effect was smaller than the scatter, and 7.7 to 12.9 with larger effects (5 sets). It was judged
on sets of other stimuli, scatter and effects: 0.5 to 1.2 with nothing hidden (6 sets), 2.9 and more with effects (7 sets)."""


def with_repeats(noise: ChannelNoise, predictors: Sequence[Predictor], part: str) -> ChannelNoise:
    """Return the noise of a channel, or the scatter of the recordings that are repeats of each other where that is larger.

    Parameters
    ----------
    noise : ChannelNoise
    predictors : sequence of Predictor
    part : "reading" or "force"

    Raises
    ------
    FileError
        Recordings are called repeats and do not have the same load.
    """
    groups: dict[str, list[Predictor]] = {}
    for one in predictors:
        if one.trial.repeats and getattr(one.trial, part) is not None:
            groups.setdefault(one.trial.repeats, []).append(one)
    curve, square, count = np.zeros(AUTOCOVARIANCE_LAGS), 0.0, 0
    for name, members in groups.items():
        if len(members) < 2:
            continue
        scatter = _scatter(members, part, name)
        values = np.where(np.isfinite(scatter), scatter, 0.0)
        square += float((values**2).sum())
        count += int(np.isfinite(scatter).sum())
        for lag in range(min(AUTOCOVARIANCE_LAGS, values.shape[1] // 4 + 1)):
            curve[lag] += float((values[:, : values.shape[1] - lag] * values[:, lag:]).sum())
    deviation = float(np.sqrt(square / count)) if count else 0.0
    if deviation <= noise.deviation:
        return noise
    return ChannelNoise(deviation, integral_time([curve]), MEASURED_REPEATS)


def _scatter(members: Sequence[Predictor], part: str, name: str) -> np.ndarray:
    """Differences of repeats from their mean at equal times, scaled to the deviation of one recording, (members, T, c).

    They are NaN beside missing values.
    """
    first = members[0]
    clocks = [one.trial.time - one.trial.time[0] for one in members]
    clock = clocks[0][clocks[0] <= min(float(np.ptp(one.trial.time)) for one in members)]
    loads = np.array([columns_at(clock, own, one.stimulus.load) for own, one in zip(clocks, members, strict=True)])
    most = max(float(loads.max(initial=0.0)), 1e-300)
    for one, load in zip(members[1:], loads[1:], strict=True):
        if float(np.sqrt(np.mean((load - loads[0]) ** 2))) > MOST_DIFFERENT * most:
            raise FileError(
                f"'{one.trial.name}.csv' and '{first.trial.name}.csv' are called repeats ({name}) and their loads differ: "
                "name only recordings of the same stimulus, begun at the same moment of it."
            )
    values = np.array([columns_at(clock, own, getattr(one.trial, part)) for own, one in zip(clocks, members, strict=True)])
    return (values - values.mean(axis=0)) * np.sqrt(len(members) / (len(members) - 1.0))
