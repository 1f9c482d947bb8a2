# SPDX-License-Identifier: GPL-3.0-or-later
"""The few different lengths of step that a series of time stamps has."""

from __future__ import annotations

import numpy as np


def steps_of(time: np.ndarray, before: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of step that occur (m,), and which of them leads to each sample (t,); to the very first one leads none.

    Lengths that differ by rounding of the time stamps only are the same.
    """
    start = time[0] if before is None else before
    lengths = np.diff(time, prepend=start)
    rounding = 1e-9 * max(abs(float(time[-1])), abs(float(start)), 1e-9)
    whole = np.round(lengths / rounding) if rounding > 0.0 else lengths
    _, first, step = np.unique(whole, return_index=True, return_inverse=True)
    return lengths[first], step.ravel()
