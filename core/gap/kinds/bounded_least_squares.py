# SPDX-License-Identifier: GPL-3.0-or-later
"""Least squares with bounds, from normal equations, by coordinate descent and an active set.

Each coordinate in turn goes to its best value inside its bounds (Tseng, J. Optim. Theory Appl. 109, 2001). The sweeps find
which coefficients are at a bound. Among columns that are nearly the same they are slow, so the others are then solved for
directly (Stark and Parker, Computational Statistics 10, 1995: bounded-variable least squares).
"""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import kernel

MOST_SWEEPS = 200
TOLERANCE = 1e-9
"""The sweeps end when none of them lowers the function by more than this share of what it is lowered by altogether."""
RIDGE = 1e-9
"""Added to the diagonal, as a share of it, so that a column of zeros keeps its value."""


@kernel
def descend(gram, right, low, high, x, gradient, most_sweeps, tolerance):  # type: ignore[no-untyped-def]
    """Lower ``½ x·A x - b·x`` by sweeps over the coordinates of `x` (p,), in place.

    Parameters
    ----------
    gram, right : (p, p), (p,) float
        A, with a positive diagonal, and b.
    low, high : (p,) float
    x : (p,) float
        Inside the bounds.
    gradient : (p,) float
        Room for A x - b.
    most_sweeps : int
    tolerance : float
    """
    size, total = x.shape[0], 0.0
    for i in range(size):
        gradient[i] = -right[i]
        for j in range(size):
            gradient[i] += gram[i, j] * x[j]
    for _ in range(most_sweeps):
        lowered = 0.0
        for i in range(size):
            goal = min(max(x[i] - gradient[i] / gram[i, i], low[i]), high[i])
            step = goal - x[i]
            if step != 0.0:
                lowered -= step * (gradient[i] + 0.5 * gram[i, i] * step)
                x[i] = goal
                for j in range(size):
                    gradient[j] += gram[i, j] * step
        total += lowered
        if lowered <= tolerance * total:
            break


def bounded_minimum(
    gram: np.ndarray, right: np.ndarray, low: np.ndarray, high: np.ndarray, start: np.ndarray | None = None
) -> np.ndarray:
    """Return the x (p,) inside bounds for which ``½ x·A x - b·x`` is least.

    Parameters
    ----------
    gram, right : (p, p), (p,) float
        A, positive semidefinite, and b.
    low, high : (p,) float
    start : (p,) float, optional
    """
    diagonal = np.diagonal(gram)
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = gram / size[:, None] / size[None]
    scaled[np.diag_indices(len(size))] = np.where(diagonal > 0.0, 1.0, 0.0) + RIDGE
    x = np.clip(np.zeros(len(size)) if start is None else start, low, high) * size
    descend(scaled, right / size, low * size, high * size, x, np.empty(len(size)), MOST_SWEEPS, TOLERANCE)
    found: np.ndarray = _polished(scaled, right / size, low * size, high * size, x) / size
    return found


def _polished(gram: np.ndarray, right: np.ndarray, low: np.ndarray, high: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Solve for the coefficients between their bounds, and let go of bounds one at a time, until nothing leads down."""
    least = TOLERANCE * float(np.abs(right).max(initial=0.0))
    for _ in range(10 * len(x)):
        gradient = gram @ x - right
        free = (x > low) & (x < high)
        if float(np.abs(gradient[free]).max(initial=0.0)) <= least:
            inwards = np.where(x <= low, -gradient, gradient)
            inwards[free] = 0.0
            if float(inwards.max(initial=0.0)) <= least:
                break
            free[int(np.argmax(inwards))] = True
        step = np.zeros(len(x))
        step[free] = np.linalg.solve(gram[np.ix_(free, free)], -gradient[free])
        goal = np.where(step > 0.0, high, low)
        moving = step != 0.0
        room = np.full(len(x), np.inf)
        room[moving] = (goal[moving] - x[moving]) / step[moving]
        ratio = min(float(room.min(initial=np.inf)), 1.0)
        x = np.clip(x + ratio * step, low, high)
        x = np.where(room <= ratio, goal, x)
    return x
