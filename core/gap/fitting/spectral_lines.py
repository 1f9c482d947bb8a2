# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectral lines in the residual without load: mains hum, a fan, a pump.

No effect explains a periodic disturbance, and a fit does not show it, because it is part of the noise at rest. Fisher's test
for a periodicity (Proc. R. Soc. A 125, 1929) is used with the local level of the spectrum, so that noise may be coloured.
Texels may share all of their noise; only trials count as independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..forward.contact_phases import relative_load
from ..forward.predictor import Model
from .least_squares import TrialView

FALSE_ALARM = 1e-4
"""Probability of finding a line in pure noise."""
LEAST_LINE_SHARE = 0.2
"""Least share of the squares at rest that a line must have to be reported."""
NEIGHBOUR_FREQUENCIES, LINE_HALF_WIDTH = 16, 3
"""Number of frequencies on either side that give the level of the noise, and how many of these the line itself may cover."""
LEAST_PROMINENCE = 3.0
"""Least ratio of a line to the level of the noise in every trial."""
LONGEST_GRID = 32
"""Points of the even grid of time per sample, above which no spectrum is computed: a recording with such pauses has none."""
SEARCH_WIDTH, SEARCH_POINTS = 0.6, 13
"""The frequency of a line is refined within this many frequency steps on either side, at so many points."""


@dataclass(frozen=True)
class SpectralLine:
    """A spectral line.

    Attributes
    ----------
    frequency : float, Hz
        As sampled: a line above half the sampling rate appears at another frequency.
    amplitude : float
        Of a texel's reading, root mean square over the texels, in the sensor's unit.
    share : float
        Share of the line in the squares of the residual at rest.
    """

    frequency: float
    amplitude: float
    share: float


class UnloadedResidual(NamedTuple):
    """The residual of one trial while its texels carry no load.

    Attributes
    ----------
    step : float, seconds
        Median time between two samples.
    time : (t,) float, seconds
    values : (t, n) float
        Residual about its mean, in units of the noise; zero where it is not known.
    known : (t, n) bool
        Where a texel is unloaded and was measured.
    """

    step: float
    time: np.ndarray
    values: np.ndarray
    known: np.ndarray


def strongest_line(views: Sequence[TrialView], model: Model) -> SpectralLine | None:
    """Return the strongest line that all trials have without load; None without a line.

    Parameters
    ----------
    views : sequence of TrialView
        Whole trials.
    model : Model
    """
    resting = [one for one in (_unloaded_residual(view, model) for view in views) if one is not None]
    if not resting:
        return None
    step = min(one.step for one in resting)
    if max(float(np.ptp(one.time)) for one in resting) / step > LONGEST_GRID * max(len(one.time) for one in resting):
        return None
    sample_indices = [np.round((one.time - one.time[0]) / step).astype(int) for one in resting]
    length = max(int(indices[-1]) for indices in sample_indices) + 1
    powers = []
    for indices, one in zip(sample_indices, resting, strict=True):
        resampled = np.zeros((length, one.values.shape[1]))
        resampled[indices] = one.values
        powers.append((np.abs(np.fft.rfft(resampled, axis=0)) ** 2).sum(axis=1) / max(float(one.known.sum()), 1.0))
    usable = slice(LINE_HALF_WIDTH + 1, len(powers[0]) - 2)
    levels = [_noise_level(power) for power in powers]
    ratio = np.sum([power / level for power, level in zip(powers, levels, strict=True)], axis=0)[usable]
    if len(ratio) < 2 * NEIGHBOUR_FREQUENCIES:
        return None
    peak = int(np.argmax(ratio)) + usable.start
    around = slice(peak - 1, peak + 2)
    in_all_trials = all(
        float((power[around] / level[around]).max()) > LEAST_PROMINENCE for power, level in zip(powers, levels, strict=True)
    )
    if not in_all_trials or _false_alarm_probability(float(ratio.max()), len(powers)) * len(ratio) > FALSE_ALARM:
        return None
    near = (peak + np.linspace(-SEARCH_WIDTH, SEARCH_WIDTH, SEARCH_POINTS)) / (length * step)
    best = max((_line_at(resting, float(f), views[0].noise[0]) for f in near), key=lambda line: line.share)
    return best if best.share > LEAST_LINE_SHARE else None


def _unloaded_residual(view: TrialView, model: Model) -> UnloadedResidual | None:
    """Return the residual of a trial's texels while they are unloaded; None if there is too little of it."""
    reading = view.predictor.trial.reading
    time = view.predictor.stimulus.time
    if reading is None or len(time) < 4 * NEIGHBOUR_FREQUENCIES:
        return None
    known = (relative_load(view.predictor.stimulus) <= 0.0) & np.isfinite(reading)
    known &= known.sum(axis=0) >= len(time) // 4
    if not known.any():
        return None
    residual = np.where(known, view.residual(model)[:, : reading.shape[1]], 0.0)
    residual = np.where(known, residual - residual.sum(axis=0) / np.maximum(known.sum(axis=0), 1), 0.0)
    return UnloadedResidual(view.predictor.trial.step, time, residual, known)


def _noise_level(power: np.ndarray) -> np.ndarray:
    """Level of the noise around each frequency, from the median: that of exponential values is ln 2 times their mean."""
    wide = np.pad(power, NEIGHBOUR_FREQUENCIES, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(wide, 2 * NEIGHBOUR_FREQUENCIES + 1)
    kept = np.abs(np.arange(-NEIGHBOUR_FREQUENCIES, NEIGHBOUR_FREQUENCIES + 1)) > LINE_HALF_WIDTH
    level: np.ndarray = np.maximum(np.median(windows[:, kept], axis=1) / np.log(2.0), 1e-300)
    return level


def _false_alarm_probability(total: float, trials: int) -> float:
    """Probability that the sum of so many exponential values of mean one is larger than `total`."""
    from scipy.special import gammaincc

    return float(gammaincc(trials, total))


def _line_at(resting: list[UnloadedResidual], frequency: float, noise: float) -> SpectralLine:
    """Amplitude and share of a line at a frequency, by least squares for each texel."""
    line = total = samples = 0.0
    for _, time, values, known in resting:
        wave = np.exp(-2j * np.pi * frequency * (time - time[0]))
        count = known.sum(axis=0)
        amplitude = 2.0 * np.abs(wave @ values) / np.maximum(count, 1)
        line += float((0.5 * amplitude**2 * count).sum())
        total += float((values * values).sum())
        samples += float(count.sum())
    return SpectralLine(frequency, float(np.sqrt(2.0 * line / samples)) * noise, min(line / max(total, 1e-300), 1.0))
