# SPDX-License-Identifier: GPL-3.0-or-later
"""A spectral line in what is left where nothing is loaded: hum, a fan, a pump.

No effect explains it, and no fit shows it, since it is in the noise at rest as well. Fisher's test for a periodicity (Proc. R.
Soc. A 125, 1929), with the level of the noise taken from the frequencies around, so that noise may be coloured. Texels may
share all of their noise: only trials count as independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..forward.contact_phases import relative_load
from ..forward.predictor import Model
from .least_squares import TrialView

FALSE_ALARM = 1e-4
"""Chance that noise alone is taken for a line."""
LEAST_LINE_SHARE = 0.2
"""Least share of the squares at rest that a line carries to be worth a word: beneath it is noise like any other."""
NEIGHBOUR_FREQUENCIES, LINE_HALF_WIDTH = 16, 3
"""Frequencies on either side that tell the level of the noise, and those of them that the line itself may smear over."""
LEAST_PROMINENCE = 3.0
"""How far it must stand out of that level in every trial."""


@dataclass(frozen=True)
class SpectralLine:
    """A line.

    Attributes
    ----------
    frequency : float, Hz
        As it was sampled: one above half the rate shows at another place.
    amplitude : float
        Of a texel's reading, root mean square over the texels, in the sensor's unit.
    share : float
        Of the squares of what is left at rest.
    """

    frequency: float
    amplitude: float
    share: float


def strongest_line(views: Sequence[TrialView], model: Model) -> SpectralLine | None:
    """Return the strongest line that all trials have at rest; None where there is none.

    Parameters
    ----------
    shares : sequence of TrialView
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
    near = (at + np.linspace(-0.6, 0.6, 13)) / (length * step)
    best = max((_line_at(resting, float(f), views[0].noise[0]) for f in near), key=lambda line: line.share)
    return best if best.share > LEAST_LINE_SHARE else None


def _unloaded_residual(view: TrialView, model: Model) -> tuple[float, np.ndarray, np.ndarray, np.ndarray] | None:
    """Step, times, the residual of texels while nothing touches them (about its mean, zero elsewhere), and where that is."""
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
    """Mean of the noise around each frequency, told by the median (that of exponential values is ln 2 of their mean)."""
    wide = np.pad(power, NEIGHBOUR_FREQUENCIES, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(wide, 2 * NEIGHBOUR_FREQUENCIES + 1)
    kept = np.abs(np.arange(-NEIGHBOUR_FREQUENCIES, NEIGHBOUR_FREQUENCIES + 1)) > LINE_HALF_WIDTH
    level: np.ndarray = np.maximum(np.median(windows[:, kept], axis=1) / np.log(2.0), 1e-300)
    return level


def _false_alarm_probability(total: float, trials: int) -> float:
    """Chance that the sum of so many exponential values of mean one is larger."""
    from scipy.special import gammaincc

    return float(gammaincc(trials, total))


def _line_at(resting: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]], frequency: float, noise: float) -> SpectralLine:
    """Amplitude by least squares at a frequency, texel by texel."""
    line = total = channels = 0.0
    for _, time, values, known in resting:
        wave = np.exp(-2j * np.pi * frequency * (time - time[0]))
        count = known.sum(axis=0)
        amplitude = 2.0 * np.abs(wave @ values) / np.maximum(count, 1)
        line += float((0.5 * amplitude**2 * count).sum())
        total += float((values * values).sum())
        channels += float(count.sum())
    return SpectralLine(frequency, float(np.sqrt(2.0 * line / channels)) * noise, min(line / max(total, 1e-300), 1.0))
