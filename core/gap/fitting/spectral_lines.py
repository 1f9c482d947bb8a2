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

from ..forward.contact_phases import load_of
from ..forward.predictor import Model
from .least_squares import Share

FALSE_ALARM = 1e-4
"""Chance that noise alone is taken for a line."""
CARRIES = 0.2
"""Least share of the squares at rest that a line carries to be worth a word: beneath it is noise like any other."""
AROUND, BESIDE = 16, 3
"""Frequencies on either side that tell the level of the noise, and those of them that the line itself may smear over."""
EACH = 3.0
"""How far it must stand out of that level in every trial."""


@dataclass(frozen=True)
class Line:
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


def line_of(shares: Sequence[Share], model: Model) -> Line | None:
    """Return the strongest line that all trials have at rest; None where there is none.

    Parameters
    ----------
    shares : sequence of Share
        Whole trials.
    model : Model
    """
    resting = [one for one in (_at_rest(share, model) for share in shares) if one is not None]
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
    usable = slice(BESIDE + 1, len(powers[0]) - 2)
    levels = [_level(power) for power in powers]
    ratio = np.sum([power / level for power, level in zip(powers, levels, strict=True)], axis=0)[usable]
    if len(ratio) < 2 * AROUND:
        return None
    at = int(np.argmax(ratio)) + usable.start
    beside = slice(at - 1, at + 2)
    everywhere = all(float((p[beside] / q[beside]).max()) > EACH for p, q in zip(powers, levels, strict=True))
    if not everywhere or _chance(float(ratio.max()), len(powers)) * len(ratio) > FALSE_ALARM:
        return None
    near = (at + np.linspace(-0.6, 0.6, 13)) / (length * step)
    best = max((_measured(resting, float(f), shares[0].noise[0]) for f in near), key=lambda line: line.share)
    return best if best.share > CARRIES else None


def _at_rest(share: Share, model: Model) -> tuple[float, np.ndarray, np.ndarray, np.ndarray] | None:
    """Step, times, the residual of texels while nothing touches them (about its mean, zero elsewhere), and where that is."""
    reading = share.predictor.trial.reading
    time = share.predictor.stimulus.time
    if reading is None or len(time) < 4 * AROUND:
        return None
    known = (load_of(share.predictor.stimulus) <= 0.0) & np.isfinite(reading)
    known &= known.sum(axis=0) >= len(time) // 4
    if not known.any():
        return None
    residual = np.where(known, share.residual(model)[:, : reading.shape[1]], 0.0)
    residual = np.where(known, residual - residual.sum(axis=0) / np.maximum(known.sum(axis=0), 1), 0.0)
    return share.predictor.trial.step, time, residual, known


def _level(power: np.ndarray) -> np.ndarray:
    """Mean of the noise around each frequency, told by the median (that of exponential values is ln 2 of their mean)."""
    wide = np.pad(power, AROUND, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(wide, 2 * AROUND + 1)
    kept = np.abs(np.arange(-AROUND, AROUND + 1)) > BESIDE
    level: np.ndarray = np.maximum(np.median(windows[:, kept], axis=1) / np.log(2.0), 1e-300)
    return level


def _chance(total: float, trials: int) -> float:
    """Chance that the sum of so many exponential values of mean one is larger."""
    from scipy.special import gammaincc

    return float(gammaincc(trials, total))


def _measured(resting: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]], frequency: float, noise: float) -> Line:
    """Amplitude by least squares at a frequency, texel by texel."""
    line = total = channels = 0.0
    for _, time, values, known in resting:
        wave = np.exp(-2j * np.pi * frequency * (time - time[0]))
        count = known.sum(axis=0)
        amplitude = 2.0 * np.abs(wave @ values) / np.maximum(count, 1)
        line += float((0.5 * amplitude**2 * count).sum())
        total += float((values * values).sum())
        channels += float(count.sum())
    return Line(frequency, float(np.sqrt(2.0 * line / channels)) * noise, min(line / max(total, 1e-300), 1.0))
