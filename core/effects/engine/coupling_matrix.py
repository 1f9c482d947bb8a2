# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear coupling of texels: a dense matrix for few texels, and a list of the pairs within reach for many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

LARGEST_DENSE = 1500
"""Up to this number of texels every pair counts. Of more texels only pairs within reach count, since the matrix would not fit
into memory."""

LARGEST_KEPT = 256
"""Up to this number of texels all distances are kept: a fit asks thousands of times for those of the same texels."""


@dataclass(frozen=True)
class CouplingMatrix:
    """Weights with which the texels `source` add to the texels `target`.

    Attributes
    ----------
    matrix : (n, n) float or None
        Row: target; column: source.
    target, source : (p,) int
    weight : (p,) float
        The same as a list of pairs, sorted by target, if there is no matrix.
    """

    matrix: np.ndarray | None
    target: np.ndarray
    source: np.ndarray
    weight: np.ndarray

    def apply(self, signal: np.ndarray) -> np.ndarray:
        """Return the coupled signal, (t, n) float."""
        if self.matrix is not None:
            return coupled(signal, self.matrix)
        result = np.zeros_like(signal)
        starts = np.flatnonzero(np.diff(self.target, prepend=-1))
        for i in range(len(signal)):
            result[i, self.target[starts]] = np.add.reduceat(self.weight * signal[i, self.source], starts)
        return result

    def sums(self, texels: int) -> np.ndarray:
        """Return the sum of the weights of each source, (n,) float."""
        return np.bincount(self.source, self.weight, texels) if self.matrix is None else self.matrix.sum(axis=0)

    def divided(self, by: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> CouplingMatrix:
        """Return each weight divided by a number, which `by` computes from the indices of its target and of its source."""
        if self.matrix is None:
            return replace(self, weight=self.weight / by(self.target, self.source))
        texel = np.arange(len(self.matrix))
        return replace(self, matrix=self.matrix / by(texel[:, None], texel))

    def balance(self, texels: int) -> np.ndarray:
        """Return the numbers u, (n,) float, with which rows and columns of ``uᵢ wᵢⱼ uⱼ`` sum to one, for symmetric weights w.

        Knight, Ruiz and Uçar, SIAM J. Matrix Anal. 35 (2014): Sinkhorn's iteration for symmetric matrices. Each step halves
        what the sums lack, where no eigenvalue is negative, so as many steps as a number has bits reach rounding. All weights
        have the same number of steps, so that the result is a smooth function of them.
        """
        scale = self.sums(texels) ** -0.5
        for _ in range(np.finfo(float).nmant):
            scale = np.sqrt(scale / self.apply(scale[None])[0])
        return scale


def coupled(signal: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return ``signal @ matrix.T``, (t, n) float.

    A signal that is no smaller than the matrix goes without the texels that are never loaded: an indenter touches few, and
    selecting the others costs less than their products. One sample is multiplied as it is.
    """
    if len(signal) < len(matrix):
        return np.asarray(signal @ matrix.T)
    (source,) = np.nonzero((signal != 0.0).any(axis=0))
    return np.asarray(signal[:, source] @ matrix[:, source].T)


def coupling_matrix(
    position: np.ndarray, weight: Callable[[np.ndarray], np.ndarray], reach: float, area: np.ndarray | None
) -> CouplingMatrix:
    """Return weights that depend on the distance between two texels.

    Parameters
    ----------
    position : (n, 3) float, m
    weight : callable
        From distances (m) to weights.
    reach : float, m
        With more than :data:`LARGEST_DENSE` texels, pairs farther apart are left out.
    area : (n,) float, m², or None
        With areas, the load of each texel is distributed in proportion to weight and area, and its sum is preserved. Without
        areas the weights are used as they are.
    """
    position = np.asarray(position, float)
    n = len(position)
    if n <= LARGEST_DENSE:
        matrix = weight(_distances_kept(position.tobytes()) if n <= LARGEST_KEPT else _distances(position))
        if area is not None:
            matrix = matrix * area[:, None]
        nothing = np.zeros(0, dtype=int)
        weights = CouplingMatrix(matrix, nothing, nothing, np.zeros(0))
    else:
        target, source, distance = pairs_within(position, reach)
        values = weight(distance)
        weights = CouplingMatrix(None, target, source, values if area is None else values * area[target])
    if area is None:
        return weights
    sums = weights.sums(n)
    return weights.divided(lambda _, source: sums[source])


def _distances(position: np.ndarray) -> np.ndarray:
    """Distances of all pairs of texels, (n, n) float, m."""
    distance: np.ndarray = np.linalg.norm(position[:, None] - position[None], axis=2)
    return distance


@lru_cache(maxsize=8)
def _distances_kept(position: bytes) -> np.ndarray:
    """Coupling matrix for positions given as bytes. Nobody may write to the result."""
    distance = _distances(np.frombuffer(position).reshape(-1, 3))
    distance.setflags(write=False)
    return distance


def pairs_within(position: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return all ordered pairs of points no farther apart than `reach` (m), including each point with itself.

    Returns
    -------
    first, second : (p,) int
        Sorted by first, then by second.
    distance : (p,) float, m
    """
    from scipy.spatial import cKDTree

    reach = max(float(reach), 1e-12)
    tree = cKDTree(position)
    # The tree rounds distances in its own way: ask for a little more, and decide by the distances computed here.
    found = tree.query_pairs(reach * (1.0 + 1e-9), output_type="ndarray")
    each = np.arange(len(position))
    first, second = np.concatenate([found[:, 0], found[:, 1], each]), np.concatenate([found[:, 1], found[:, 0], each])
    distance = np.linalg.norm(position[first] - position[second], axis=1)
    order = np.lexsort((second, first))
    order = order[distance[order] <= reach]
    return first[order], second[order], distance[order]


def nearest_distance(position: np.ndarray) -> float:
    """Return the median over all points of the distance to the nearest other point, m."""
    from scipy.spatial import cKDTree

    if len(position) < 2:
        return 1.0
    _, nearest = cKDTree(position).query(position, k=2)
    itself = np.arange(len(position))
    other = np.where(nearest[:, 0] == itself, nearest[:, 1], nearest[:, 0])  # of two equal points either may come first
    return float(np.median(np.linalg.norm(position - position[other], axis=1)))
