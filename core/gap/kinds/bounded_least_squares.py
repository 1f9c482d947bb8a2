# SPDX-License-Identifier: GPL-3.0-or-later
"""Least squares with bounds, from normal equations: scipy's bounded-variable least squares on a root of the Gram matrix."""

from __future__ import annotations

import numpy as np

RIDGE = 1e-9
"""Added to the diagonal, as a share of it, so that what the equations leave open keeps its starting value."""


def bounded_minimum(gram: np.ndarray, right: np.ndarray, low: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return the x (p,), nowhere below `low`, for which ``½ x·A x - b·x`` is least.

    Parameters
    ----------
    gram, right : (p, p), (p,) float
        A, positive semidefinite, and b.
    low : (p,) float
    start : (p,) float
        Where nothing depends on a direction, x stays there.
    """
    from scipy.optimize import lsq_linear

    diagonal = np.diagonal(gram)
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = gram / size[:, None] / size[None]
    scaled[np.diag_indices(len(size))] = np.where(diagonal > 0.0, 1.0, 0.0) + RIDGE
    squares, axes = np.linalg.eigh(scaled)
    root = np.sqrt(np.maximum(squares, RIDGE))  # rounding makes some of them negative
    origin = np.maximum(start, low)
    target = (axes / root).T @ ((right - gram @ origin) / size)
    bounds = ((low - origin) * size, np.inf)
    step = lsq_linear((axes * root).T, target, bounds, method="bvls", max_iter=10 * len(size)).x / size
    found: np.ndarray = np.maximum(origin + step, low)
    return found
