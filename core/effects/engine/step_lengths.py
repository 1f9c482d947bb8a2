# SPDX-License-Identifier: GPL-3.0-or-later
"""The different lengths of step in a series of time stamps."""

from __future__ import annotations

import numpy as np


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
    start = time[0] if before is None else before
    lengths = np.diff(time, prepend=start)
    rounding = 1e-9 * max(abs(float(time[-1])), abs(float(start)), 1e-9)
    whole = np.round(lengths / rounding) if rounding > 0.0 else lengths
    _, first, step = np.unique(whole, return_index=True, return_inverse=True)
    return lengths[first], step.ravel()
