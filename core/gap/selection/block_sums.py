# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums over blocks of recordings of what a model leaves there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sums:
    """Sums over each of b blocks, for readings and net forces, in units of the noise's variance: (b, 2) float each.

    Attributes
    ----------
    left, count : (b, 2) float
        Squares that a model leaves on unseen blocks, and the number of values.
    rest, rest_count : (2, b, 2) float
        The same of values without load: while nothing touches the sensor, and of texels that nothing touches.
    changes : (components, b, 2) float
        Squares of the change of the prediction that each component of the model makes, beyond a factor and a zero.
    """

    left: np.ndarray
    count: np.ndarray
    rest: np.ndarray
    rest_count: np.ndarray
    changes: np.ndarray
