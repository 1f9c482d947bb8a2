# SPDX-License-Identifier: GPL-3.0-or-later
"""How texels become a picture: rows and columns where they form a grid, a texture map of the surface otherwise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

_PIXELS_APART = 3.0  # neighbouring texels in a flattened region, so that a bilinear look-up can tell them apart
_LEGS = 6  # pixels along the short sides of a triangle in an atlas
_LEAST_LEGS = 3
_GUTTER = 2  # pixels around the surface that repeat its rim: bilinear look-ups reach one
_LEAST_SIDE = 64
_MOST_SIDE = 2048
_PIXELS_PER_TRIANGLE = (
    36.0  # on average, at most; regular meshes need five: a few tiny triangles must not blow up the whole picture
)
_STEEPEST = 0.1  # cosine to the mean normal below which a triangle is squeezed when it is flattened
_SQUEEZED = 0.01  # share of the surface that may be
_CHUNK = 1 << 19  # pairs of a pixel and a triangle looked at in one go


@dataclass(frozen=True)
class GridLayout:
    """Texels in rows and columns; one pixel each.

    Attributes
    ----------
    rows, columns : int
    row, column : (n,) int
        Of each texel. Rows run along +y and columns along +x of the sensor's body, as far as it goes.
    triangles : (m, 3) int
        Texels at the corners of the region's triangles, for :attr:`corner_uv`.
    """

    rows: int
    columns: int
    row: np.ndarray
    column: np.ndarray
    triangles: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), int))

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture, pixels."""
        return self.rows, self.columns

    def image(self, values: np.ndarray) -> np.ndarray:
        """Return the picture of (n,) or (n, c) values: (rows, columns[, c]) float, row 0 at the bottom."""
        values = np.asarray(values, float)
        picture = np.zeros((*self.shape, *values.shape[1:]))
        picture[self.row, self.column] = values
        return picture

    def mask(self) -> np.ndarray:
        """Return (rows, columns) bool: which pixels show the sensor."""
        mask = np.zeros(self.shape, bool)
        mask[self.row, self.column] = True
        return mask

    def uv(self) -> np.ndarray:
        """Return the (n, 2) texture coordinates of the texels, 0 to 1: the centres of their pixels."""
        return np.column_stack([(self.column + 0.5) / self.columns, (self.row + 0.5) / self.rows])

    @property
    def corner_uv(self) -> np.ndarray:
        """(m, 3, 2) texture coordinates at the corners of `triangles`."""
        return self.uv()[self.triangles]


@dataclass(frozen=True)
class UVLayout:
    """Texels on a texture map; pixels between them are interpolated linearly inside the triangles.

    Attributes
    ----------
    triangles : (m, 3) int
        Texels at the corners of the region's triangles.
    corner_uv : (m, 3, 2) float
        Texture coordinates of those corners, 0 to 1. In an atlas a texel has others in each of its triangles.
    height, width : int, pixels
    cell : int, pixels
        Side of an atlas's cells, of two triangles each; 0 where the region is flattened in one piece.
    """

    triangles: np.ndarray
    corner_uv: np.ndarray
    height: int
    width: int
    cell: int = 0

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture, pixels."""
        return self.height, self.width

    def image(self, values: np.ndarray) -> np.ndarray:
        """Return the picture of (n,) or (n, c) values: (height, width[, c]) float, row 0 at the bottom.

        Around the surface its rim is repeated over at least two pixels; all others are zero.
        """
        values = np.asarray(values, float)
        pixel, triangle, weights, _ = self._pixels
        table = values.reshape(len(values), -1).T
        picture = np.zeros((len(table), self.height * self.width))
        for values_of_channel, of_channel in zip(table, picture):
            if values_of_channel.any():
                of_channel[pixel] = np.einsum("ij,ij->i", values_of_channel[self.triangles][triangle], weights)
        picture = picture.reshape(len(table), *self.shape)
        return picture[0] if values.ndim == 1 else np.moveaxis(picture, 0, -1)

    def mask(self) -> np.ndarray:
        """Return (height, width) bool: which pixels show the sensor; the repeated rim does not count."""
        pixel, _, _, inside = self._pixels
        mask = np.zeros(self.height * self.width, bool)
        mask[pixel[inside]] = True
        return mask.reshape(self.shape)

    def uv(self) -> np.ndarray:
        """Return the (n, 2) texture coordinates of the texels, 0 to 1: those of their first corner."""
        texel, first = np.unique(self.triangles, return_index=True)
        uv = np.zeros((texel[-1] + 1, 2))
        uv[texel] = self.corner_uv.reshape(-1, 2)[first]
        return uv

    @cached_property
    def _pixels(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Pixels that are not empty: flat index, nearest triangle, weights of its corners, and if it covers them."""
        corners = self.corner_uv * (self.width, self.height) - 0.5  # whole numbers are the centres of pixels
        if self.cell:
            return _rasterise_cells(corners, self.cell, self.width)
        return _rasterise(corners, self.height, self.width)


# --- grids


def grid_layout(
    position: np.ndarray, normal: np.ndarray, triangles: np.ndarray, quads: np.ndarray | None = None
) -> tuple[GridLayout, np.ndarray] | tuple[None, None]:
    """Recognise a grid of rows and columns by its topology.

    Two numbers tell what grid it could be: R·C vertices and 2(R−1)(C−1) triangles. The rim then holds the first row
    and the first column, and cell after cell follows from them, whichever way its diagonal runs. Of several ways to
    see a grid the one with the shortest edges (and the longest diagonals) is taken.

    Parameters
    ----------
    position, normal : (n, 3) float
        Texels; every one is a corner of a triangle.
    triangles : (m, 3) int
        Wound alike, anticlockwise seen from outside.
    quads : (q, 4) int, optional
        Faces with four corners whose halves are among `triangles`; −1 marks corners outside the region.

    Returns
    -------
    layout : GridLayout or None
        Of the four ways to turn the grid, columns run along the one nearest to +x of the body (then +y, then +z), and
        column × row is the normal; so row 0, column 0 is the corner with the lowest x and y of a pad that faces +z.
    along : (n, 3) float or None
        Unit vectors in the direction of the columns.
    """
    sizes = _grid_sizes(len(position), len(triangles))
    if sizes is None:
        return None, None
    edges = _Edges.of(triangles, len(position))
    if edges is None or len(edges.rim) != 2 * sum(sizes) - 4:
        return None, None
    position = np.asarray(position, float)
    grid = _find_grid(position, edges, sizes, _whole_quads(quads))
    if grid is None:
        return None, None
    grid = _turned(grid, position, normal)
    along = np.empty((len(position), 3))
    along[grid] = np.gradient(position[grid], axis=1)
    rows, columns = grid.shape
    row, column = _places(grid)
    return GridLayout(rows, columns, row, column, np.asarray(triangles)), _unit(along)


def _grid_sizes(vertices: int, triangles: int) -> tuple[int, int] | None:
    """Solve R·C = vertices and 2(R−1)(C−1) = triangles for R ≤ C; None when whole numbers from 2 up do not."""
    total = vertices + 1 - triangles / 2
    root = total * total - 4 * vertices
    if root < 0:
        return None
    rows = round((total - root**0.5) / 2)
    columns = round((total + root**0.5) / 2)
    fits = rows >= 2 and rows * columns == vertices and 2 * (rows - 1) * (columns - 1) == triangles
    return (rows, columns) if fits else None


@dataclass(frozen=True)
class _Edges:
    """Directed edges of triangles that are wound alike, and the single rim around them.

    Attributes
    ----------
    key : (3m,) int
        ``from · n + to``, ascending.
    third : (3m,) int
        The triangle's other corner.
    rim : (r,) int
        Vertices of the rim in order, the surface on the left.
    fan : (n,) int
        Number of triangles at each vertex.
    """

    key: np.ndarray
    third: np.ndarray
    rim: np.ndarray
    fan: np.ndarray

    @classmethod
    def of(cls, triangles: np.ndarray, count: int) -> _Edges | None:
        """Return None when an edge occurs twice in one direction or the rim is not one loop."""
        start = np.asarray(triangles, np.int64).T.ravel()
        end = np.roll(triangles, -1, axis=1).T.ravel()
        third = np.roll(triangles, -2, axis=1).T.ravel()
        key = start * count + end
        order = np.argsort(key, kind="stable")
        key = key[order]
        if (key[1:] == key[:-1]).any():
            return None
        alone = ~np.isin(key, end * count + start, assume_unique=True)
        first, second = key[alone] // count, key[alone] % count
        following = np.full(count, -1)
        following[first] = second
        rim = [int(first[0])] if len(first) else []
        while rim and len(rim) <= len(first):
            after = int(following[rim[-1]])
            if after < 0 or after == rim[0]:
                break
            rim.append(after)
        if len(rim) != len(first):
            return None
        return cls(key, third[order], np.array(rim, int), np.bincount(start, minlength=count))

    def across(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the third corners of the triangles left of edges, −1 where there is none."""
        wanted = start * len(self.fan) + end
        at = np.minimum(np.searchsorted(self.key, wanted), len(self.key) - 1)
        return np.where(self.key[at] == wanted, self.third[at], -1)


def _whole_quads(quads: np.ndarray | None) -> np.ndarray:
    if quads is None or len(quads) == 0:
        return np.zeros((0, 4), int)
    quads = np.asarray(quads)
    return quads[(quads >= 0).all(axis=1)]


def _find_grid(position: np.ndarray, edges: _Edges, sizes: tuple[int, int], quads: np.ndarray) -> np.ndarray | None:
    """Return the (R, C) vertices of the best grid, None when there is none or two are equally good."""
    rows, columns = sizes
    rim = edges.rim
    # at a corner meet one or two triangles, elsewhere on the rim two or more
    corners = np.array([0, columns - 1, columns + rows - 2, 2 * columns + rows - 3])
    fan = edges.fan[rim]
    shifts = np.arange(len(rim) // (4 if rows == columns else 2))
    possible = (fan[(shifts[:, None] + corners) % len(rim)] <= 2).all(axis=1)
    ones = np.flatnonzero(fan == 1)  # each of these must be a corner
    if len(ones) > 4:
        return None
    offset = (ones[None, :] - shifts[:, None]) % len(rim)
    possible &= (offset[..., None] == corners).any(axis=-1).all(axis=1)
    found: list[tuple[float, np.ndarray]] = []
    for shift in shifts[possible]:
        grid = _grow(edges, np.roll(rim, -shift), rows, columns)
        if grid is not None and _keeps(grid, quads):
            steps = (np.diff(position[grid], axis=0), np.diff(position[grid], axis=1))
            found.append((sum(float((step**2).sum()) for step in steps), grid))
    found.sort(key=lambda item: item[0])
    if not found or (len(found) > 1 and found[0][0] > 0.99 * found[1][0]):
        return None  # a fan of eight triangles is a 3 × 3 grid in two ways: better none than either
    return found[0][1]


def _grow(edges: _Edges, rim: np.ndarray, rows: int, columns: int) -> np.ndarray | None:
    """Fill a grid from its first row and column, which the rim begins and ends with, one diagonal at a time."""
    grid = np.full((rows, columns), -1)
    grid[0] = rim[:columns]
    grid[1:, 0] = rim[:-rows:-1]
    placed = np.zeros(len(edges.fan), bool)
    placed[grid[0]] = placed[grid[1:, 0]] = True
    for step in range(rows + columns - 3):
        i = np.arange(max(0, step - columns + 2), min(step, rows - 2) + 1)
        j = step - i
        corner, right, above = grid[i, j], grid[i, j + 1], grid[i + 1, j]
        third = edges.across(corner, right)
        fourth = np.where(third == above, edges.across(above, right), third)
        fits = (third == above) | (edges.across(above, corner) == fourth)
        if not fits.all() or (fourth < 0).any() or placed[fourth].any():
            return None
        placed[fourth] = True
        grid[i + 1, j + 1] = fourth
    return grid if placed.all() else None


def _keeps(grid: np.ndarray, quads: np.ndarray) -> bool:
    """Tell whether every quad is a cell of the grid."""
    row, column = _places(grid)
    sides = [place[quads].max(axis=1) - place[quads].min(axis=1) for place in (row, column)]
    return bool((sides[0] == 1).all() and (sides[1] == 1).all())


def _places(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the row and the column of each vertex."""
    row = np.empty(grid.size, int)
    column = np.empty(grid.size, int)
    row[grid] = np.arange(grid.shape[0])[:, None]
    column[grid] = np.arange(grid.shape[1])
    return row, column


def _turned(grid: np.ndarray, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Turn the grid so that its columns run along x as well as a quarter turn can do it."""
    diagonals = position[grid[1:, 1:]] - position[grid[:-1, :-1]], position[grid[1:, :-1]] - position[grid[:-1, 1:]]
    if (np.cross(*diagonals) * normal[grid[:-1, :-1]]).sum() < 0:  # triangles wound against the normals
        grid = grid.T

    def score(turn: int) -> float:
        steps = np.diff(position[np.rot90(grid, turn)], axis=1)
        length = np.linalg.norm(steps, axis=2).mean() or 1.0
        return _preference(steps.mean(axis=(0, 1)) / length)  # zero for a grid that goes all the way round

    return np.rot90(grid, max(range(4), key=score))


def _preference(direction: np.ndarray) -> float:
    """Rank directions: along +x first, and of equals along +y, then +z."""
    return float(direction @ (1.0, 1e-3, 1e-6))


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors of length one; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


# --- texture maps


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
    mean = _unit(area.sum(axis=0))
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
    room = 2 * _GUTTER + 2
    scale = min(max(scale, (_LEAST_SIDE - room) / extent.max()), (_MOST_SIDE - room) / extent.max())
    width, height = (int(side) for side in np.ceil(extent * scale - 1e-9) + room)
    uv = (plane * scale + _GUTTER + 1) / (width, height)
    layout = UVLayout(triangles, uv[triangles], height, width)
    try:
        layout._pixels  # noqa: B018 computed once and kept
    except _OverlapError:
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
        axis = _unit(body - (body @ mean) * mean)
    return axis if _preference(axis) >= _preference(-axis) else -axis


def _atlas(position: np.ndarray, triangles: np.ndarray) -> UVLayout:
    """Give each triangle half a square cell, its longest edge along the cell's diagonal."""
    cells = (len(triangles) + 1) // 2
    across = int(np.ceil(cells**0.5))
    legs = int(np.clip(_MOST_SIDE // across - 2 * _GUTTER - 4, _LEAST_LEGS, _LEGS))
    side = legs + 2 * _GUTTER + 4  # corners at the centres of pixels, six pixels between the two diagonals
    down = -(-cells // across)
    cell = np.arange(len(triangles)) // 2
    origin = np.column_stack([cell % across, cell // across]) * side
    lower = np.array([[0, 0], [legs, 0], [0, legs]]) + _GUTTER
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


class _OverlapError(Exception):
    """Two triangles cover the same pixel."""


def _rasterise(corners: np.ndarray, height: int, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Find for every pixel on or near the triangles the nearest one and the weights of its corners there.

    Parameters
    ----------
    corners : (m, 3, 2) float
        Pixel coordinates x, y, anticlockwise; whole numbers are the centres of pixels.

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
    _OverlapError
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
            raise _OverlapError
    inside = owner < nobody

    distance = np.where(inside, 0.0, np.inf)
    for index, pixel, point in _pairs(corners, _rim_triangles(corners), _GUTTER + 0.5, height, width):
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


def _rasterise_cells(corners: np.ndarray, side: int, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Do the same as :func:`_rasterise` for an atlas, whose cells are all alike but for the order of the corners."""
    origin = np.floor(corners.min(axis=1) / side).astype(int) * side
    local = np.round(corners - origin[:, None, :])
    model = local[:2]
    pixel, triangle, weights, inside = _rasterise(model, side, side)
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
