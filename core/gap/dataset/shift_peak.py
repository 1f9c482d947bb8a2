# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the best of evenly spaced shifts of two clocks is, to a fraction of their spacing."""

from __future__ import annotations

import numpy as np


def peak_offset(values: np.ndarray, top: int) -> float:
    """Return where the maximum is by a parabola through three values.

    Parameters
    ----------
    values : (n,) float
        Agreement at each shift.
    top : int
        The largest of them.

    Returns
    -------
    float
        In spacings, from `top`; zero at the ends, where one of the three is missing.
    """
    if not 0 < top < len(values) - 1:
        return 0.0
    before, here, after = values[top - 1 : top + 2]
    bend = before - 2.0 * here + after
    return float(0.5 * (before - after) / bend) if bend < 0.0 else 0.0
