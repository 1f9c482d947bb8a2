# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectral lines in the residual without load: mains hum, a fan, a pump.

No effect explains a periodic disturbance, and a fit does not show it, because it is part of the noise at rest. Fisher's test
for a periodicity (Proc. R. Soc. A 125, 1929) is used with the local level of the spectrum, so that noise may be coloured.
Texels may share all of their noise; only trials count as independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
    step = min(one[0] for one in resting)
    slots = [np.round((time - time[0]) / step).astype(int) for _, time, _, _ in resting]
    length = max(int(slot[-1]) for slot in slots) + 1
    powers = []
    for slot, (_, _, values, known) in zip(slots, resting, strict=True):
        even = np.zeros((length, values.shape[1]))
        even[slot] = values
        powers.append((np.abs(np.fft.rfft(even, axis=0)) ** 2).sum(axis=1) / max(float(known.sum()), 1.0))
    usable = slice(LINE_HALF_WIDTH + 1, len(powers[0]) - 2)
    levels = [_noise_level(power) for power in powers]
    ratio = np.sum([power / level for power, level in zip(powers, levels, strict=True)], axis=0)[usable]
    if len(ratio) < 2 * NEIGHBOUR_FREQUENCIES:
        return None
    at = int(np.argmax(ratio)) + usable.start
    beside = slice(at - 1, at + 2)
    everywhere = all(float((p[beside] / q[beside]).max()) > LEAST_PROMINENCE for p, q in zip(powers, levels, strict=True))
    if not everywhere or _false_alarm_probability(float(ratio.max()), len(powers)) * len(ratio) > FALSE_ALARM:
        return None
    near = (at + np.linspace(-SEARCH_WIDTH, SEARCH_WIDTH, SEARCH_POINTS)) / (length * step)
    best = max((_line_at(resting, float(f), views[0].noise[0]) for f in near), key=lambda line: line.share)
    return best if best.share > LEAST_LINE_SHARE else None


def _unloaded_residual(view: TrialView, model: Model) -> tuple[float, np.ndarray, np.ndarray, np.ndarray] | None:
    """Median time step, times, and the residual of texels without load about its mean (zero elsewhere), with a mask of its
    values.
    """
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
    return view.predictor.trial.step, time, residual, known


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


def _line_at(resting: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]], frequency: float, noise: float) -> SpectralLine:
    """Amplitude and share of a line at a frequency, by least squares for each texel."""
    line = total = channels = 0.0
    for _, time, values, known in resting:
        wave = np.exp(-2j * np.pi * frequency * (time - time[0]))
        count = known.sum(axis=0)
        amplitude = 2.0 * np.abs(wave @ values) / np.maximum(count, 1)
        line += float((0.5 * amplitude**2 * count).sum())
        total += float((values * values).sum())
        channels += float(count.sum())
    return SpectralLine(frequency, float(np.sqrt(2.0 * line / channels)) * noise, min(line / max(total, 1e-300), 1.0))
