# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact points: where on a texel's cell its forces act.

The paper has one contact point per texel, at its vertex (section 6 names several as future work). Several points are spread
evenly over the part of the surface that belongs to the texel, and share its stiffness. Every point is a fixed weighted mean of
a few texels, so that it moves with them when the surface bends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .grid_layout import GridLayout
from .mesh import TriangleMesh, triangle_areas
from .texels import Texels


@dataclass(frozen=True)
class ContactPoints:
    """The contact points of one sensor, sorted by texel.

    Attributes
    ----------
    texel : (p,) int
        The texel that each point belongs to.
    corner : (p, 4) int
        Texels whose weighted mean the point is.
    weight : (p, 4) float
        Weights of these texels; they sum to 1. Outside the rim of a grid some are negative.
    """

    texel: np.ndarray
    corner: np.ndarray
    weight: np.ndarray

    def positions(self, position: np.ndarray) -> np.ndarray:
        """Return the points' (p, 3) positions from the texels' (n, 3)."""
        return np.einsum("pc,pcx->px", self.weight, position[self.corner])

    def normals(self, normal: np.ndarray) -> np.ndarray:
        """Return the points' (p, 3) unit normals from the texels' (n, 3)."""
        mixed = self.positions(normal)
        return mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def contact_points(texels: Texels, per_texel: int) -> ContactPoints:
    """Spread contact points over the cells of the texels.

    In a grid a cell reaches half-way to the neighbours, and as far beyond the rim, so that all cells have the same
    area. On any other mesh it is the barycentric cell: the third of each adjoining triangle that is nearest to the vertex.

    Parameters
    ----------
    texels : Texels
    per_texel : int
        A square number; 1 is the texel's vertex itself.
    """
    n, across = len(texels), math.isqrt(per_texel)
    each = np.arange(n)
    if across == 1:
        return ContactPoints(each, np.tile(each[:, None], 4), np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)))
    if isinstance(texels.layout, GridLayout):
        corner, weight = _in_grid(texels.layout, across)
    else:
        corner, weight = _in_fans(texels.layout.triangles, texels.position, across)
    return ContactPoints(np.repeat(each, per_texel), corner, weight)


def _in_grid(layout: GridLayout, across: int) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate bilinearly between neighbours; extrapolate from the last cell beyond the rim."""
    number = np.empty(layout.shape, int)
    number[layout.row, layout.column] = np.arange(len(layout.row))
    offset = (np.arange(across) + 0.5) / across - 0.5
    up, right = (grid.ravel() for grid in np.meshgrid(offset, offset, indexing="ij"))
    row, row_share = _neighbour(layout.row, layout.rows, up)
    column, column_share = _neighbour(layout.column, layout.columns, right)
    own_row, own_column = (np.broadcast_to(own[:, None], row.shape) for own in (layout.row, layout.column))
    corner = np.stack([number[i, j] for i in (own_row, row) for j in (own_column, column)], axis=-1)
    weight = np.stack([a * b for a in (1 - row_share, row_share) for b in (1 - column_share, column_share)], axis=-1)
    return corner.reshape(-1, 4), weight.reshape(-1, 4)


def _neighbour(place: np.ndarray, count: int, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (n, m) neighbouring rows or columns and their shares, which are negative where the neighbour is behind."""
    wanted = place[:, None] + np.sign(offset).astype(int)
    beyond = (wanted < 0) | (wanted >= count)
    other = np.where(beyond, 2 * place[:, None] - wanted, wanted)
    return other, np.where(beyond, -np.abs(offset), np.abs(offset))


def _in_fans(triangles: np.ndarray, position: np.ndarray, across: int) -> tuple[np.ndarray, np.ndarray]:
    """Place the points on rings of equal area around each vertex; rings are turned by the golden ratio."""
    size = triangle_areas(TriangleMesh(position, triangles))
    ring, place = (grid.ravel() for grid in np.meshgrid(np.arange(across), np.arange(across), indexing="ij"))
    radius = np.sqrt((ring + 0.5) / across)
    around = (place + (0.25 + 0.618 * ring) % 1.0) / across
    corners, weights = [], []
    for vertex, fan in enumerate(_fans(triangles, len(position))):
        # Each triangle gives two halves of equal area: from the middle of its first edge to its centroid, and on to the second.
        halves = np.cumsum(np.repeat(size[fan], 2))
        at = around * halves[-1]
        half = np.minimum(np.searchsorted(halves, at, side="right"), len(halves) - 1)
        begin = np.where(half > 0, halves[half - 1], 0.0)
        share = (at - begin) / np.where(halves[half] > begin, halves[half] - begin, 1.0)
        turned = np.stack([np.roll(triangles[t], -int(np.flatnonzero(triangles[t] == vertex)[0])) for t in fan])[half // 2]
        toward = np.where(half % 2 == 0, share, 1.0 - share)[:, None]  # how far on the way from the edge to the centroid
        edge = np.where((half % 2 == 0)[:, None], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5])
        rim = (1.0 - toward) * edge + toward / 3.0
        mixed = radius[:, None] * rim
        mixed[:, 0] += 1.0 - radius
        corners.append(np.hstack([turned, turned[:, :1]]))
        weights.append(np.hstack([mixed, np.zeros((len(mixed), 1))]))
    return np.concatenate(corners), np.concatenate(weights)


def _fans(triangles: np.ndarray, count: int) -> Iterator[list[int]]:
    """Yield the triangles at each vertex in the order in which they lie around it, as far as they hang together."""
    at: list[dict[int, tuple[int, int]]] = [{} for _ in range(count)]
    for t, (a, b, c) in enumerate(triangles.tolist()):
        for vertex, first, second in ((a, b, c), (b, c, a), (c, a, b)):
            at[vertex].setdefault(first, (t, second))
    for following in at:
        seconds = {second for _, second in following.values()}
        starts = [first for first in following if first not in seconds] + list(following)
        fan: list[int] = []
        for start in starts:
            while start in following:
                t, start = following.pop(start)
                fan.append(t)
        yield fan
