# SPDX-License-Identifier: GPL-3.0-or-later
"""Missing samples of what drove a sensor: which of them can be interpolated.

A gap is judged by its length against the stimulus, and not by the share of the samples that are missing: every second sample
may be missing where the stimulus is slow, and a single one is too many within a step. The samples that are there say how long a
gap may be: each of them is predicted from its neighbours at growing distances, and the longest distance counts at which these
predictions are good.
"""

from __future__ import annotations

import numpy as np

MOST_ERROR = 0.03
"""Share of the stimulus's range by which its linear interpolation over a gap may be wrong (95 % quantile, while it moves). Half
of the force samples of eFlesh's presses lack, 0.2 s apart in presses of 15 s; over such gaps the error is 0.5 %."""
MOVES = 0.02
"""Share of the range by which a stimulus must change over a gap to count as moving."""
FEWEST = 8
"""Known samples, and gaps of a length, from which anything is judged."""
ERROR_QUANTILE = 0.95


def longest_gap(time: np.ndarray, values: np.ndarray) -> float:
    """Return how long a gap may be to be interpolated, in seconds.

    Parameters
    ----------
    time, values : (T,) float
        Without missing values.

    Returns
    -------
    float
        Infinite for a stimulus that does not move, and zero where even neighbours do not predict the sample between them.
    """
    span = float(np.ptp(values)) if len(values) else 0.0
    if span <= 0.0 or len(values) < FEWEST:
        return np.inf
    longest, half = 0.0, 1
    while len(values) > 2 * half + FEWEST:
        first, middle, last = values[: -2 * half], values[half:-half], values[2 * half :]
        lengths = time[2 * half :] - time[: -2 * half]
        share = (time[half:-half] - time[: -2 * half]) / lengths
        error = np.abs(middle - (first + share * (last - first)))
        ends = np.stack([first, middle, last])
        moving = np.ptp(ends, axis=0) > MOVES * span
        if moving.sum() >= FEWEST and float(np.quantile(error[moving], ERROR_QUANTILE)) > MOST_ERROR * span:
            break
        longest = float(np.median(lengths))
        half *= 2
    return longest


def bridged(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values with the missing ones interpolated where the gap is short enough.

    Parameters
    ----------
    time : (T,) float, s
    values : (T,) float
        NaN where a value is missing.

    Returns
    -------
    (T,) float
        NaN within gaps that are too long, and before the first and after the last known value.
    """
    known = np.isfinite(values)
    at = np.flatnonzero(known)
    if len(at) in (len(values), 0, 1):
        return values
    place = np.arange(len(values))
    right = np.clip(np.searchsorted(at, place), 1, len(at) - 1)
    short = time[at[right]] - time[at[right - 1]] <= longest_gap(time[known], values[known])
    inside = ~known & (place > at[0]) & (place < at[-1]) & short
    return np.where(inside, np.interp(time, time[known], values[known]), values)
