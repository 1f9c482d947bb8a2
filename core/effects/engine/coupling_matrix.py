# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear coupling of texels: a dense matrix for few texels, and a sparse one of the pairs within reach for many."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Weights: TypeAlias = "np.ndarray | csr_array"
"""Weights with which texels add to texels, (n, n) float; row: target, column: source. No row is empty."""

LARGEST_DENSE = 1500
"""Up to this number of texels every pair counts. Of more texels only pairs within reach count, since the matrix would not fit
into memory."""

LARGEST_KEPT = 256
"""Up to this number of texels all distances are kept: a fit asks thousands of times for those of the same texels."""


def coupled(signal: np.ndarray, weights: Weights) -> np.ndarray:
    """Return ``signal @ weights.T``, (t, n) float; each sample of a sparse matrix by itself, with the same bits.

    A signal that is no smaller than a dense matrix goes without the texels that are never loaded: an indenter touches few, and
    selecting the others costs less than their products. One sample is multiplied as it is.
    """
    if not isinstance(weights, np.ndarray):
        sums = [np.add.reduceat(weights.data * sample[weights.indices], weights.indptr[:-1]) for sample in signal]
        return np.reshape(sums, signal.shape)
    if len(signal) < len(weights):
        return np.asarray(signal @ weights.T)
    (source,) = np.nonzero((signal != 0.0).any(axis=0))
    return np.asarray(signal[:, source] @ weights[:, source].T)


def divided(weights: Weights, by: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Weights:
    """Return each weight divided by a number, which `by` computes from the indices of its target and of its source."""
    if isinstance(weights, np.ndarray):
        texel = np.arange(len(weights))
        return weights / by(texel[:, None], texel)
    target = np.repeat(np.arange(weights.shape[0]), np.diff(weights.indptr))
    return type(weights)((weights.data / by(target, weights.indices), weights.indices, weights.indptr), weights.shape)


def balancing_scale(weights: Weights) -> np.ndarray:
    """Return the numbers u, (n,) float, with which rows and columns of ``uᵢ wᵢⱼ uⱼ`` sum to one, for symmetric weights w.

    Knight, Ruiz and Uçar, SIAM J. Matrix Anal. 35 (2014): Sinkhorn's iteration for symmetric matrices. Each step halves
    what the sums lack, where no eigenvalue is negative, so as many steps as a number has bits reach rounding. All weights
    have the same number of steps, so that the result is a smooth function of them.
    """
    scale = weights.sum(axis=0) ** -0.5
    for _ in range(np.finfo(float).nmant):
        scale = np.sqrt(scale / coupled(scale[None], weights)[0])
    return scale


def coupling_matrix(
    position: np.ndarray, weight: Callable[[np.ndarray], np.ndarray], reach: float, area: np.ndarray | None
) -> Weights:
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
        weights: Weights = weight(_distances_kept(position.tobytes()) if n <= LARGEST_KEPT else _distances(position))
        if area is not None:
            weights = weights * area[:, None]
    else:
        from scipy.sparse import csr_array

        target, source, distance = pairs_within(position, reach)
        values = weight(distance) if area is None else weight(distance) * area[target]
        weights = csr_array((values, source, np.searchsorted(target, np.arange(n + 1))), (n, n))
    if area is None:
        return weights
    sums = weights.sum(axis=0)
    return divided(weights, lambda _, source: sums[source])


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
