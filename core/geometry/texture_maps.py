# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture maps of a region: flattened, cut into an atlas of triangles, or taken from a UV map of its mesh."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import ImageError
from .grid_layout import preference, unit
from .mesh import unique_edges

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
    _, which, count = unique_edges(node.reshape(-1, 3))
    return np.flatnonzero((count[which] == 1).any(axis=1))


_PIXELS_APART = 3.0  # neighbouring texels in a flattened region, so that a bilinear look-up can tell them apart
_LEGS = 6  # pixels along the short sides of a triangle in an atlas
_LEAST_LEGS = 3
_LEAST_SIDE = 64
_MOST_SIDE = 2048
_PIXELS_PER_TRIANGLE = (
    36.0  # on average, at most; regular meshes need five: a few tiny triangles must not blow up the whole picture
)
_STEEPEST = 0.1  # cosine to the mean normal below which a triangle is squeezed when it is flattened
_SQUEEZED = 0.01  # share of the surface that may be
_MAP_MARGIN = 8  # pixels around the islands of a mesh's own map: smaller copies, for the distance, reach further than one
_SLACK = 1e-4  # of the square by which a map may miss it, by rounding


@dataclass(frozen=True)
class UVLayout:
    """Texels on a texture map; pixels between them are interpolated over the triangles, or show the nearest texel.

    Attributes
    ----------
    triangles : (m, 3) int
        Texels at the corners of the region's triangles.
    corner_uv : (m, 3, 2) float
        Texture coordinates of those corners, 0 to 1. In an atlas, and along the seams of a mesh's own map, a texel has others
        in each of its triangles.
    height, width : int, pixels
    cell : int, pixels
        Side of an atlas's cells, of two triangles each; 0 elsewhere.
    map_name : str
        Of the mesh's own texture map that the coordinates are from; empty where the region was laid out here.
    nearest : bool
        Each pixel shows one texel: the one whose share of the surface it lies in. Else values are linear on each triangle.
    margin : int, pixels
        Width of the rim around the surface that repeats its edge.
    """

    triangles: np.ndarray
    corner_uv: np.ndarray
    height: int
    width: int
    cell: int = 0
    map_name: str = ""
    nearest: bool = False
    margin: int = GUTTER

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture, pixels."""
        return self.height, self.width

    def image(self, values: np.ndarray) -> np.ndarray:
        """Return the picture of (n,) or (n, c) values: (height, width[, c]) float, row 0 at the bottom.

        Around the surface its edge is repeated over the margin; all other pixels are zero.
        """
        values = np.asarray(values, float)
        pixel, corner, weights, _ = self._stencil
        table = values.reshape(len(values), -1).T
        picture = np.zeros((len(table), self.height * self.width))
        for values_of_channel, of_channel in zip(table, picture):
            if values_of_channel.any():
                of_channel[pixel] = np.einsum("ij,ij->i", values_of_channel[corner], weights)
        picture = picture.reshape(len(table), *self.shape)
        return picture[0] if values.ndim == 1 else np.moveaxis(picture, 0, -1)

    def mask(self) -> np.ndarray:
        """Return (height, width) bool: which pixels show the sensor; the repeated edge does not count."""
        pixel, _, _, inside = self._stencil
        mask = np.zeros(self.height * self.width, bool)
        mask[pixel[inside]] = True
        return mask.reshape(self.shape)

    def uv(self) -> np.ndarray:
        """Return the (n, 2) texture coordinates of the texels, 0 to 1: those of their first corner."""
        texel, first = np.unique(self.triangles, return_index=True)
        uv = np.zeros((texel[-1] + 1, 2))
        uv[texel] = self.corner_uv.reshape(-1, 2)[first]
        return uv

    def unresolved_texels(self) -> int:
        """Return the number of texels that are nearest to no pixel, because the picture is too coarse."""
        _, corner, weights, inside = self._stencil
        nearest = np.take_along_axis(corner, weights.argmax(axis=1)[:, None], axis=1)[inside]
        return len(np.unique(self.triangles)) - len(np.unique(nearest))

    @cached_property
    def _stencil(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Pixels that are not empty: flat index, (p, c) texels they are made of, their weights, and if they are covered."""
        pixel, triangle, weights, inside = self._pixels
        corner = self.triangles[triangle]
        if self.nearest:
            # By weight and not by distance: each texel then covers a third of its triangles, like its area, and both sides of
            # an edge agree on the nearest texel, which makes seams invisible.
            corner = np.take_along_axis(corner, weights.argmax(axis=1)[:, None], axis=1)
            weights = np.ones((len(corner), 1))
        return pixel, corner, weights, inside

    @cached_property
    def _pixels(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Pixels that are not empty: flat index, nearest triangle, weights of its corners, and if it covers them."""
        corners = self.corner_uv * (self.width, self.height) - 0.5  # whole numbers are the centres of pixels
        if self.cell:
            return rasterise_cells(corners, self.cell, self.width)
        (ax, ay), (bx, by) = ((corners[:, i] - corners[:, 0]).T for i in (1, 2))
        mirrored = ax * by < ay * bx
        corners[mirrored] = corners[mirrored, ::-1]
        pixel, triangle, weights, inside = rasterise(corners, self.height, self.width, self.margin)
        turned = mirrored[triangle]
        weights[turned] = weights[turned, ::-1]
        return pixel, triangle, weights, inside


def mapped_layout(
    triangles: np.ndarray, corner_uv: np.ndarray, side: int, *, map_name: str, nearest: bool = False, sensor: str = "sensor"
) -> UVLayout:
    """Lay a region out as a texture map of its mesh does.

    Parameters
    ----------
    triangles : (m, 3) int
        Texels at the corners of the region's triangles.
    corner_uv : (m, 3, 2) float
        Texture coordinates there; islands may be mirrored, and triangles without area on the map are left out.
    side : int, pixels
        Of the square picture.
    map_name, sensor : str
        For messages.
    nearest : bool
        See :class:`UVLayout`.

    Raises
    ------
    ImageError
        The map has no area, reaches beyond its square, or lays parts of the region over one another.
    """
    known = f"The UV map '{map_name}' of sensor '{sensor}'"
    remedy = "unwrap it (Edit Mode, UV › Smart UV Project), or set Readout › Image to Automatic"
    if not np.isfinite(corner_uv).all() or corner_uv.min() < -_SLACK or corner_uv.max() > 1 + _SLACK:
        raise ImageError(f"{known} reaches beyond its square: use UV › Pack Islands, or {remedy}.")
    a, b = corner_uv[:, 1] - corner_uv[:, 0], corner_uv[:, 2] - corner_uv[:, 0]
    if not (np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 1e-12).any():
        raise ImageError(f"{known} has no area where the texels are: {remedy}.")
    layout = UVLayout(triangles, np.clip(corner_uv, 0.0, 1.0), side, side, 0, map_name, nearest, _MAP_MARGIN)
    try:
        layout._pixels  # noqa: B018, SLF001 computed once and kept
    except OverlapError:
        raise ImageError(f"{known} lays parts of the region over one another: {remedy}.") from None
    return layout


def uv_layout(position: np.ndarray, normal: np.ndarray, triangles: np.ndarray) -> tuple[UVLayout, np.ndarray]:
    """Lay any region out on a texture map.

    Flattened along its mean normal where no triangle flips or covers another, and neighbouring texels then are at
    least three pixels apart (fewer where few triangles are much smaller than the rest, or the picture would pass
    2048 pixels). Otherwise every triangle gets a place of its own, half a cell of an atlas; its short sides have six
    pixels, three where there are too many triangles, and only beyond 69,192 triangles is it larger than 2048 pixels.

    Parameters
    ----------
    position, normal : (n, 3) float
        Texels; every one is a corner of a triangle.
    triangles : (m, 3) int
        Wound anticlockwise seen from outside.

    Returns
    -------
    layout : UVLayout
    along : (n, 3) float
        Unit vectors of the texels' x axes before they are put across the normal: the picture's +u where the region
        is flattened, else +x of the body (+y where the normal is within 8° of x).
    """
    position = np.asarray(position, float)
    triangles = np.asarray(triangles)
    flat = _flattened(position, triangles)
    if flat is not None:
        layout, axis = flat
        return layout, np.tile(axis, (len(position), 1))
    near_x = np.abs(normal[:, 0]) > 0.99
    return _atlas(position, triangles), np.where(near_x[:, None], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])


def _flattened(position: np.ndarray, triangles: np.ndarray) -> tuple[UVLayout, np.ndarray] | None:
    """Project along the mean normal; None when that flips or squeezes a triangle or lays one over another."""
    a, b, c = np.moveaxis(position[triangles], 1, 0)
    area = np.cross(b - a, c - a)
    size = np.linalg.norm(area, axis=1)
    mean = unit(area.sum(axis=0))
    seen = area @ mean
    solid = size > 1e-9 * size.max()
    if not solid.any() or (seen[solid] <= 0).any() or size[seen < _STEEPEST * size].sum() > _SQUEEZED * size.sum():
        return None
    u = _main_axis(position, mean)
    plane = position @ np.column_stack([u, np.cross(mean, u)])
    plane -= plane.min(axis=0)
    extent = plane.max(axis=0)
    edge = np.linalg.norm(plane[triangles] - plane[np.roll(triangles, -1, axis=1)], axis=2)[solid]
    densest = (_PIXELS_PER_TRIANGLE * len(triangles) / (seen.sum() / 2)) ** 0.5
    scale = min(_PIXELS_APART / max(edge.min(), 1e-300), densest)
    room = 2 * GUTTER + 2
    scale = min(max(scale, (_LEAST_SIDE - room) / extent.max()), (_MOST_SIDE - room) / extent.max())
    width, height = (int(side) for side in np.ceil(extent * scale - 1e-9) + room)
    uv = (plane * scale + GUTTER + 1) / (width, height)
    layout = UVLayout(triangles, uv[triangles], height, width)
    try:
        layout._pixels  # noqa: B018, SLF001 computed once and kept
    except OverlapError:
        return None
    return layout, u


def _main_axis(position: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Return the unit vector across `mean` along which the texels reach furthest; the body's x or y when none is."""
    spread = position - position.mean(axis=0)
    spread = spread - np.outer(spread @ mean, mean)
    values, vectors = np.linalg.eigh(spread.T @ spread)
    axis = vectors[:, 2]
    if values[1] > 0.9 * values[2]:  # round or square: a trifle would choose
        body = np.eye(3)[0 if abs(mean[0]) < 0.9 else 1]
        axis = unit(body - (body @ mean) * mean)
    return axis if preference(axis) >= preference(-axis) else -axis


def _atlas(position: np.ndarray, triangles: np.ndarray) -> UVLayout:
    """Give each triangle half a square cell, its longest edge along the cell's diagonal."""
    cells = (len(triangles) + 1) // 2
    across = int(np.ceil(cells**0.5))
    legs = int(np.clip(_MOST_SIDE // across - 2 * GUTTER - 4, _LEAST_LEGS, _LEGS))
    side = legs + 2 * GUTTER + 4  # corners at the centres of pixels, six pixels between the two diagonals
    down = -(-cells // across)
    cell = np.arange(len(triangles)) // 2
    origin = np.column_stack([cell % across, cell // across]) * side
    lower = np.array([[0, 0], [legs, 0], [0, legs]]) + GUTTER
    both = np.stack([lower, side - 1 - lower])
    corners = both[np.arange(len(triangles)) % 2] + origin[:, None, :]
    # turn each so that the first place, at the right angle, goes to the corner opposite the longest edge
    places = position[triangles]
    opposite = np.linalg.norm(np.roll(places, -1, axis=1) - np.roll(places, -2, axis=1), axis=2)
    first = opposite.argmax(axis=1)
    turned = (np.arange(3) - first[:, None]) % 3
    corners = np.take_along_axis(corners, turned[..., None], axis=1)
    height, width = down * side, across * side
    return UVLayout(triangles, (corners + 0.5) / (width, height), height, width, side)
