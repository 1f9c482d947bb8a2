# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions of texels' axes."""

from __future__ import annotations

import numpy as np


def preference(direction: np.ndarray) -> float:
    """Rank directions: along +x first, and of equals along +y, then +z."""
    return float(direction @ (1.0, 1e-3, 1e-6))


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors of length one; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)
