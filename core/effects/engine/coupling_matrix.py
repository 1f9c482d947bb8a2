# SPDX-License-Identifier: GPL-3.0-or-later
"""What one texel gives to the others: weights as a matrix, whole for few texels and only its near part for many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

LARGEST_DENSE = 1500
"""Up to so many texels every pair counts; of more only those within reach, since the matrix would not fit."""


@dataclass(frozen=True)
class CouplingMatrix:
    """A matrix of weights: what texel ``source`` adds to texel ``target``.

    Attributes
    ----------
    matrix : (n, n) float or None
        Row: target; column: source.
    target, source : (p,) int
    weight : (p,) float
        The same as a list, sorted by target, where there is no matrix.
    """

    matrix: np.ndarray | None
    target: np.ndarray
    source: np.ndarray
    weight: np.ndarray

    def apply(self, signal: np.ndarray) -> np.ndarray:
        """Return the mixed signal, (t, n) float."""
        if self.matrix is not None:
            return signal @ self.matrix.T
        result = np.zeros_like(signal)
        starts = np.flatnonzero(np.diff(self.target, prepend=-1))
        for i in range(len(signal)):
            result[i, self.target[starts]] = np.add.reduceat(self.weight * signal[i, self.source], starts)
        return result


def coupling_matrix(
    position: np.ndarray, weight: Callable[[np.ndarray], np.ndarray], reach: float, area: np.ndarray | None
) -> CouplingMatrix:
    """Return weights that depend on the distance of two texels.

    Parameters
    ----------
    position : (n, 3) float, m
    weight : callable
        From distances (m) to weights.
    reach : float, m
        Beyond it nothing counts where there are more than :data:`LARGEST_DENSE` texels.
    area : (n,) float, m², or None
        With areas, each texel's load is shared out by weight and area and its sum kept; without, weights are taken as they are.
    """
    n = len(position)
    if n <= LARGEST_DENSE:
        matrix = weight(np.linalg.norm(position[:, None] - position[None], axis=2))
        if area is not None:
            matrix = matrix * area[:, None]
            matrix = matrix / matrix.sum(axis=0)
        nothing = np.zeros(0, dtype=int)
        return CouplingMatrix(matrix, nothing, nothing, np.zeros(0))
    target, source, distance = pairs_within(position, reach)
    values = weight(distance)
    if area is not None:
        values = values * area[target]
        values = values / np.bincount(source, values, n)[source]
    return CouplingMatrix(None, target, source, values)


def pairs_within(position: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All pairs of points no farther apart than `reach`, each with itself too: two (p,) int, sorted, and distances (p,)."""
    reach = max(float(reach), 1e-12)
    cell = np.floor((position - position.min(axis=0)) / reach).astype(np.int64) + 1
    size = cell.max(axis=0) + 2
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    order = np.argsort(key, kind="stable")
    found = key[order]
    firsts, seconds = [], []
    for step in np.ndindex(3, 3, 3):
        x, y, z = (int(s) - 1 for s in step)
        wanted = key + (x * size[1] + y) * size[2] + z
        start, stop = np.searchsorted(found, wanted, "left"), np.searchsorted(found, wanted, "right")
        count = stop - start
        firsts.append(np.repeat(np.arange(len(position)), count))
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        seconds.append(order[np.repeat(start, count) + within])
    first, second = np.concatenate(firsts), np.concatenate(seconds)
    distance = np.linalg.norm(position[first] - position[second], axis=1)
    near = distance <= reach
    first, second, distance = first[near], second[near], distance[near]
    order = np.lexsort((second, first))
    return first[order], second[order], distance[order]


def nearest_distance(position: np.ndarray) -> float:
    """Return the median over all points of the distance to the nearest other one, m."""
    if len(position) < 2:
        return 1.0
    size = np.ptp(position, axis=0)
    reach = 2.0 * float(np.sort(size)[-2:].prod() / len(position)) ** 0.5 or float(size.max())
    while True:
        first, second, distance = pairs_within(position, reach)
        other = first != second
        if len(np.unique(first[other])) == len(position):
            closest = np.full(len(position), np.inf)
            np.minimum.at(closest, first[other], distance[other])
            return float(np.median(closest))
        reach *= 2.0
