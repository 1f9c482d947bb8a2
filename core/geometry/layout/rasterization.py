# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pixels the triangles of a texture map cover, and with what weights of their corners."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

GUTTER = 2
"""Pixels around the surface that repeat its rim: bilinear look-ups reach one."""
_CHUNK = 1 << 19
"""Pairs of a pixel and a triangle looked at in one go."""


class OverlapError(Exception):
    """Two triangles cover the same pixel."""


def rasterise(
    corners: np.ndarray, height: int, width: int, margin: int = GUTTER
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Find for every pixel on or near the triangles the nearest one and the weights of its corners there.

    Parameters
    ----------
    corners : (m, 3, 2) float
        Pixel coordinates x, y, anticlockwise; whole numbers are the centres of pixels.
    height, width : int, pixels
    margin : int, pixels
        How far around the triangles.

    Returns
    -------
    pixel : (p,) int
        ``row · width + column``, each once.
    triangle : (p,) int
        The nearest; of equally near ones the first.
    weights : (p, 3) float
        Between 0 and 1, sum 1; of the triangle's nearest point where it does not cover the pixel.
    inside : (p,) bool

    Raises
    ------
    OverlapError
    """
    nobody = len(corners)
    owner = np.full(height * width, nobody)
    layers = np.zeros(height * width, np.int32)
    slopes = _barycentric(corners)
    for index, pixel, point in _pairs(corners, np.arange(len(corners)), 1e-6, height, width):
        least = _weights(slopes, index, point).min(axis=0)
        covered = least >= -1e-9
        np.minimum.at(owner, pixel[covered], index[covered])
        np.add.at(layers, pixel[least > 1e-6], 1)
        if layers.max() > 1:
            raise OverlapError
    inside = owner < nobody

    distance = np.where(inside, 0.0, np.inf)
    for index, pixel, point in _pairs(corners, _rim_triangles(corners), margin + 0.5, height, width):
        free = ~inside[pixel]
        index, pixel, point = index[free], pixel[free], point[free]
        away, _ = _on_edges(corners[index], point)
        before = distance[pixel]
        np.minimum.at(distance, pixel, away)
        nearer = (away < before) & (away == distance[pixel])
        owner[pixel[nearer]] = nobody
        np.minimum.at(owner, pixel[nearer], index[nearer])

    pixel = np.flatnonzero(owner < nobody)
    triangle = owner[pixel]
    inside = inside[pixel]
    point = np.column_stack([pixel % width, pixel // width]).astype(float)
    weights = np.empty((len(pixel), 3))
    weights[inside] = np.maximum(_weights(slopes, triangle[inside], point[inside]), 0.0).T
    weights[inside] /= weights[inside].sum(axis=1, keepdims=True)
    weights[~inside] = _on_edges(corners[triangle[~inside]], point[~inside])[1]
    return pixel, triangle, weights, inside


def rasterise_cells(corners: np.ndarray, side: int, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Do the same as :func:`rasterise` for an atlas, whose cells are all alike but for the order of the corners."""
    origin = np.floor(corners.min(axis=1) / side).astype(int) * side
    local = np.round(corners - origin[:, None, :])
    model = local[:2]
    pixel, triangle, weights, inside = rasterise(model, side, side)
    parts = []
    for half in range(len(model)):
        mine = np.flatnonzero(triangle == half)
        members = np.arange(half, len(corners), 2)
        place = (local[members][:, :, None] == model[half]).all(axis=-1).argmax(axis=-1)
        x = origin[members, :1] + pixel[mine] % side
        y = origin[members, 1:] + pixel[mine] // side
        parts.append(
            (
                (y * width + x).ravel(),
                np.repeat(members, len(mine)),
                weights[mine][:, place].transpose(1, 0, 2).reshape(-1, 3),
                np.tile(inside[mine], len(members)),
            )
        )
    pixel, triangle, weights, inside = (np.concatenate(part) for part in zip(*parts))
    return pixel, triangle, weights, inside


def front_triangles(corners: np.ndarray, height: int, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find which triangle is in front at each pixel; triangles that are wound clockwise are not seen.

    Parameters
    ----------
    corners : (m, 3, 3) float
        Pixel coordinates x, y as in :func:`rasterise`, and z, which is larger for what is nearer.
    height, width : int, pixels

    Returns
    -------
    pixel : (p,) int
        ``row · width + column``, each once.
    triangle : (p,) int
    weights : (p, 3) float
        Sum 1.
    """
    plane, nobody = corners[..., :2], len(corners)
    slopes = _barycentric(plane)
    chosen = np.flatnonzero(np.isfinite(slopes[0, 0]))
    nearest, owner = np.full(height * width, -np.inf), np.full(height * width, nobody)
    for index, pixel, point in _pairs(plane, chosen, 1e-6, height, width):
        weights = _weights(slopes, index, point)
        covered = weights.min(axis=0) >= -1e-9
        index, pixel = index[covered], pixel[covered]
        depth = (weights.T[covered] * corners[index, :, 2]).sum(axis=1)
        np.maximum.at(nearest, pixel, depth)
        in_front = depth == nearest[pixel]
        owner[pixel[in_front]] = index[in_front]
    pixel = np.flatnonzero(owner < nobody)
    triangle = owner[pixel]
    point = np.column_stack([pixel % width, pixel // width]).astype(float)
    weights = np.maximum(_weights(slopes, triangle, point), 0.0).T
    return pixel, triangle, weights / weights.sum(axis=1, keepdims=True)


def _pairs(
    corners: np.ndarray, chosen: np.ndarray, reach: float, height: int, width: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield triangle, flat pixel and (x, y) of all pixels within `reach` of the boxes around `chosen` triangles."""
    low = np.maximum(np.ceil(corners[chosen].min(axis=1) - reach), 0).astype(int)
    high = np.minimum(np.floor(corners[chosen].max(axis=1) + reach), (width - 1, height - 1)).astype(int)
    size = np.maximum(high - low + 1, 0)
    count = size.prod(axis=1)
    chunk = np.cumsum(count) // _CHUNK
    for part in np.split(np.arange(len(chosen)), np.flatnonzero(np.diff(chunk)) + 1):
        which = np.repeat(part, count[part])
        offset = np.arange(len(which)) - np.repeat(np.cumsum(count[part]) - count[part], count[part])
        x = low[which, 0] + offset % size[which, 0]
        y = low[which, 1] + offset // size[which, 0]
        yield chosen[which], y * width + x, np.column_stack([x, y]).astype(float)


def _barycentric(corners: np.ndarray) -> np.ndarray:
    """Return (3, 3, m): for each corner, what its weight at a point is per x, per y and at the origin of the picture.

    All are NaN where a triangle has no area.
    """
    x, y = corners[..., 0].T, corners[..., 1].T
    area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0])
    area = np.where(area > 1e-9, area, np.nan)  # square pixels
    x1, y1, x2, y2 = np.roll(x, -1, axis=0), np.roll(y, -1, axis=0), np.roll(x, -2, axis=0), np.roll(y, -2, axis=0)
    return np.stack([y1 - y2, x2 - x1, x1 * y2 - x2 * y1], axis=1) / area


def _weights(slopes: np.ndarray, triangle: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return (3, p) weights of the corners of triangles at (p, 2) points."""
    return np.stack([s[0][triangle] * point[:, 0] + s[1][triangle] * point[:, 1] + s[2][triangle] for s in slopes])


def _on_edges(corners: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far (p, 2) points are from the edges of (p, 3, 2) triangles, and the nearest place's weights."""
    edge = np.roll(corners, -1, axis=1) - corners
    away = point[:, None, :] - corners
    square = (edge**2).sum(axis=2)
    along = np.clip((away * edge).sum(axis=2) / np.where(square > 0, square, 1.0), 0.0, 1.0)
    distance = np.linalg.norm(away - along[..., None] * edge, axis=2)
    nearest = distance.argmin(axis=1)
    each = np.arange(len(point))
    weights = np.zeros((len(point), 3))
    weights[each, nearest] = 1.0 - along[each, nearest]
    weights[each, (nearest + 1) % 3] = along[each, nearest]
    return distance[each, nearest], weights


def _rim_triangles(corners: np.ndarray) -> np.ndarray:
    """Return the triangles with an edge that no other triangle on the map has."""
    places = np.round(corners * 64).astype(np.int64)
    _, node = np.unique(places[..., 1] << 32 | places[..., 0], return_inverse=True)
    node = node.reshape(-1, 3)
    ends = np.sort(np.stack([node, np.roll(node, -1, axis=1)], axis=-1), axis=-1)
    _, edge, uses = np.unique(ends[..., 0] * (node.max() + 1) + ends[..., 1], return_inverse=True, return_counts=True)
    return np.flatnonzero((uses[edge.reshape(-1, 3)] == 1).any(axis=1))
