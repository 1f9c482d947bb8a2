# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers that a logger writes where it has no value: −1 between forces that are never negative, 9999, −999."""

from __future__ import annotations

import numpy as np

LEAST_SHARE, FEWEST = 0.005, 8
"""Share of the samples, and number of them, that must have the code: a single −1 is an outlier."""
JUMP, LEAST_JUMPS = 0.05, 0.05
"""A signal jumps into a code: at least the second share of its samples is next to a value that is off by more than the first
share of the range of all others. Noise of a converter around zero also repeats one number, but never jumps so far."""
APART = 1.0
"""Ranges of all other values by which a code is apart from them, where it is not the only negative number."""


def missing_code(values: np.ndarray) -> float | None:
    """Return the number that stands for a missing value in a column, None if there is none.

    Parameters
    ----------
    values : (T,) float
    """
    known = values[np.isfinite(values)]
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
        if span > 0.0 and (is_only_negative or gap > APART * span) and _jumps(known, is_code, JUMP * span) >= FEWEST:
            return code
    return None


def _jumps(values: np.ndarray, is_code: np.ndarray, far: float) -> int:
    """Number of samples with the code that are next to a value far from it; zero if they are a small share of them."""
    border = is_code[1:] != is_code[:-1]
    jumps = border & (np.abs(np.diff(values)) > far)
    count = int(jumps.sum())
    return count if count >= LEAST_JUMPS * is_code.sum() else 0
