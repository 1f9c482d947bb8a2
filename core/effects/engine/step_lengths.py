# SPDX-License-Identifier: GPL-3.0-or-later
"""The different lengths of step in a series of time stamps."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

SERIES_KEPT, LONGEST_KEPT = 64, 20_000
"""Number of series whose steps are kept, and how many samples they have at most: as many recordings as a rig may have, without
holding on to memory."""


def steps_of(time: np.ndarray, before: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the lengths of step that occur in a series of time stamps.

    Lengths that differ only by the rounding of the time stamps count as one.

    Parameters
    ----------
    time : (t,) float, s, increasing
    before : float, s, optional
        Time of the sample before these. Without it, the step that leads to the first sample has length zero.

    Returns
    -------
    lengths : (m,) float, s
    step : (t,) int
        Index of the length of the step that leads to each sample.
    """
    time = np.asarray(time, float)
    if len(time) > LONGEST_KEPT:
        return _computed_steps(time, before)
    lengths, step = _steps_kept(time.tobytes(), before)
    return lengths.copy(), step.copy()


@lru_cache(maxsize=SERIES_KEPT)
def _steps_kept(stamps: bytes, before: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Steps of time stamps that are given as bytes: a fit asks thousands of times for the same few series."""
    return _computed_steps(np.frombuffer(stamps), before)


def _computed_steps(time: np.ndarray, before: float | None) -> tuple[np.ndarray, np.ndarray]:
    start = time[0] if before is None else before
    lengths = np.diff(time, prepend=start)
    rounding = 1e-9 * max(abs(float(time[-1])), abs(float(start)), 1e-9)
    whole = np.round(lengths / rounding) if rounding > 0.0 else lengths
    _, first, step = np.unique(whole, return_index=True, return_inverse=True)
    return lengths[first], step.ravel()
