# SPDX-License-Identifier: GPL-3.0-or-later
"""How columns behave: what their names and units do not say, as the numbers −1 and 9999 where a logger has no value."""

from __future__ import annotations

import numpy as np

ZERO, RESTS, BELOW = 0.02, 0.05, 0.05
"""A force is within the first share of its range of zero for at least the second share of its samples, and not below zero by
more than the third."""
LEAST_CONTACT = 6.0
"""How many times the noise from sample to sample a response must rise above it. Of 1000 recordings of white noise of 20 to
20,000 samples (evenly on a logarithmic scale) none reaches it after the mean over five samples that is taken here; the largest
is at 4.2."""
ORDERED = 0.5
"""Correlation of a load with itself one sample later below which the samples are points in no order."""
LEAST_SHARE, FEWEST = 0.005, 8
"""Share of the samples, and number of them, that must have a code for missing values: a single −1 is an outlier."""
JUMP, LEAST_JUMPS = 0.05, 0.05
"""A signal jumps into a code: at least the second share of its samples is next to a value that is off by more than the first
share of the range of all others. Noise of a converter around zero also repeats one number, but never jumps so far."""
APART = 1.0
"""Ranges of all other values by which a code is apart from them, where it is not the only negative number."""


def finite(values: np.ndarray) -> np.ndarray:
    """Return the values that are known."""
    return values[np.isfinite(values)]


def is_clock(values: np.ndarray, strictly: bool = False) -> bool:
    """Return True if values rise like a clock; strictly: with few that repeat."""
    steps = np.diff(finite(values))
    return len(steps) >= 7 and not (steps < 0).any() and bool(steps.any()) and not (strictly and (steps == 0).mean() > 0.3)


def is_force(values: np.ndarray) -> bool:
    """Return True if values behave as a force of contact."""
    known = finite(values)
    low, high = np.percentile(known, [0.1, 99.9])
    span = float(high - low)
    return bool(span > 0.0 and low > -BELOW * span and (np.abs(known) < ZERO * span).mean() > RESTS)


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    """Return the correlation of two columns where both are known, without its sign; 0 if one does not change."""
    known = np.isfinite(one) & np.isfinite(other)
    if known.sum() < 8 or np.ptp(one[known]) == 0.0 or np.ptp(other[known]) == 0.0:
        return 0.0
    return abs(float(np.corrcoef(one[known], other[known])[0, 1]))


def is_unordered(load: np.ndarray) -> bool:
    """Return True if a load jumps from sample to sample, as in a table of calibration points."""
    known = finite(load)
    return len(known) >= 16 and float(np.ptp(known)) > 0.0 and float(np.corrcoef(known[:-1], known[1:])[0, 1]) < ORDERED


def contact_of(values: np.ndarray) -> float:
    """Return how far values, averaged over five samples, leave their noise from sample to sample, in units of that."""
    known = finite(values)
    if len(known) < 8:
        return 0.0
    noise = 1.4826 * float(np.median(np.abs(np.diff(known)))) / np.sqrt(2.0)
    span = float(np.ptp(np.convolve(known, np.full(5, 0.2), mode="valid")))
    return np.inf if span > 0.0 and noise == 0.0 else span / noise if noise else 0.0


def missing_code(values: np.ndarray) -> float | None:
    """Return the number that stands for a missing value in a column, None if there is none.

    Parameters
    ----------
    values : (T,) float
    """
    known = finite(values)
    if len(known) < FEWEST:
        return None
    for code in (float(known.min()), float(known.max())):
        is_code = known == code
        others = known[~is_code]
        if code != round(code) or len(others) < FEWEST or is_code.sum() < max(FEWEST, LEAST_SHARE * len(known)):
            continue
        span = float(np.ptp(others))
        is_only_negative = code < 0.0 <= float(others.min())
        gap = min(abs(code - float(others.min())), abs(code - float(others.max())))
        jumps = (is_code[1:] != is_code[:-1]) & (np.abs(np.diff(known)) > JUMP * span)
        does_jump = jumps.sum() >= max(FEWEST, LEAST_JUMPS * is_code.sum())
        if span > 0.0 and (is_only_negative or gap > APART * span) and does_jump:
            return code
    return None
