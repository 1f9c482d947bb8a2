# SPDX-License-Identifier: GPL-3.0-or-later
"""How much later one logger's clock shows the same event than another's, by correlation.

Changes and not values are correlated, because creep, drift and hysteresis hardly move a change. An indenter moves before it
touches, so its position is also compared beyond several heights, and the height at which both agree best counts.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from ..dataset.second_logger import peak_of

HEIGHTS = (0.0, 0.2, 0.4, 0.6, 0.8)
"""Shares of the way of the stimulus below which it may not touch."""
MOST_SAMPLES = 40_000
"""Samples of the common grid."""
SMOOTHING = (0.05, 0.2, 0.8)
"""Seconds over which changes are taken, and at least two samples. Slow presses show in slow changes, under which noise is
small; that which tells the shift most clearly counts."""
LEAST_OVERLAP = 0.5
"""Least share of the changes of each logger that must lie where both recorded."""
LEAST_CORRELATION, MOST_RIVAL = 0.5, 0.6
"""The shift is sure if the correlation of changes is at least this, and that at any other shift less than this share of it.
They were chosen on 100 recordings of six presses with noise, of which 98 pass and 3 are off (by more than 0.05 s and four
standard errors); how these were made was not kept. Of 100 others (benchmarks/RESULTS.md) 100 pass with a noise of 2 and of 10 %
of the largest force, and 97 with 30 %, and none is off. Of 200 pairs of unrelated recordings 36 pass, as presses look alike:
the correlation cannot tell whose files they are."""


@dataclass(frozen=True)
class ClockShift:
    """The shift of two clocks.

    Attributes
    ----------
    late : float, s
        The second clock's time of an event minus the first one's.
    correlation : float
        Of the changes with this shift.
    rival : float
        Largest correlation at any other shift, as a share of it.
    """

    late: float
    correlation: float
    rival: float

    @property
    def clearness(self) -> float:
        """How far the correlation is above that at any other shift."""
        return self.correlation * (1.0 - self.rival)

    @property
    def is_sure(self) -> bool:
        """True if the recordings tell the shift."""
        return self.correlation >= LEAST_CORRELATION and self.rival < MOST_RIVAL

    @property
    def quality(self) -> str:
        """How well the recordings tell it, in words."""
        return f"correlation {self.correlation:.2f}, elsewhere at most {self.correlation * self.rival:.2f}"


def clock_shift(first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> ClockShift | None:
    """Return how late the second clock is.

    Parameters
    ----------
    first, second : (times (T,) s, values (T,))
        What drove the sensor, and what answered, each by its own clock.

    Returns
    -------
    ClockShift or None
        None if one of them does not change.
    """
    spans = [float(np.ptp(times)) for times, _ in (first, second)]
    steps = [float(np.median(np.diff(times))) for times, _ in (first, second)]
    step = max(*steps, max(spans) / MOST_SAMPLES)
    driven, answered = _on_grid(*first, step), _on_grid(*second, step)
    offset = float(second[0][0] - first[0][0])
    best: ClockShift | None = None
    for seconds in SMOOTHING:
        width = max(2, round(seconds / step))
        if seconds != SMOOTHING[0] and 8 * width > min(len(driven), len(answered)):
            break
        answer = _changes(answered, width)
        for sign, height in itertools.product((1.0, -1.0), HEIGHTS):
            least, most = np.percentile(sign * driven, [1.0, 99.0])
            cause = _changes(np.maximum(sign * driven - least - height * (most - least), 0.0), width)
            found = _shift_of(cause, answer, step, offset)
            if found is not None and (best is None or found.clearness > best.clearness + 1e-9):
                best = found
    return best


def _shift_of(cause: np.ndarray, answer: np.ndarray, step: float, offset: float) -> ClockShift | None:
    """Return the shift at which two series of changes agree best, None if one of them is constant."""
    lags, correlation = _correlation(cause, answer)
    size = np.abs(correlation)
    top, away, _ = peak_of(size)
    if size[top] <= 0.0:
        return None
    # the peak ends twice as far away as it first falls below half of its height
    below = np.flatnonzero(size < 0.5 * size[top])
    width = 2 * max(3, int(np.abs(below - top).min(initial=len(size))))
    elsewhere = size.copy()
    elsewhere[max(0, top - width) : top + width + 1] = 0.0
    rival = float(elsewhere.max()) / float(size[top])
    return ClockShift(offset + (lags[top] + away) * step, float(size[top]), rival)


def _on_grid(times: np.ndarray, values: np.ndarray, step: float) -> np.ndarray:
    known = np.isfinite(values) & np.isfinite(times)
    grid = np.arange(times[0], times[-1] + 0.5 * step, step)
    return np.interp(grid, times[known], values[known]) if known.any() else np.zeros(len(grid))


def _changes(values: np.ndarray, width: int) -> np.ndarray:
    """Return changes over so many samples, without their mean."""
    if len(values) <= width:
        return np.zeros(1)
    total = np.concatenate([[0.0], np.cumsum(values)])
    half = max(1, width // 2)
    means = (total[half:] - total[:-half]) / half
    change = means[half:] - means[:-half]
    return change - change.mean()


def _correlation(cause: np.ndarray, answer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all shifts in samples at which both overlap enough, and the correlation at each."""
    from scipy.signal import correlate, correlation_lags

    product, lags = correlate(answer, cause, method="fft"), correlation_lags(len(answer), len(cause))
    causes, answers = np.concatenate([[0.0], np.cumsum(cause**2)]), np.concatenate([[0.0], np.cumsum(answer**2)])
    begin, end = np.maximum(0, -lags), np.minimum(len(cause), len(answer) - lags)
    shared_cause = causes[end] - causes[begin]
    shared_answer = answers[end + lags] - answers[begin + lags]
    enough = (shared_cause >= LEAST_OVERLAP * causes[-1]) & (shared_answer >= LEAST_OVERLAP * answers[-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.where(enough, product / np.sqrt(shared_cause * shared_answer), 0.0)
    return lags, np.nan_to_num(found)
