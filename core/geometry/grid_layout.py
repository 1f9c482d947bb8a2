# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows and columns: of texels, recognised by the topology of their triangles, and of a few places, as of magnetometers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

SAME_LINE = 1 / 3
"""Largest step between two places of one row or column, as a share of the distance between neighbours."""
MOST_EMPTY = 4
"""Most pixels for each place. A cross of five has nine, half of them empty; places that lie anyhow form no grid."""


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


def grid_layout(
    position: np.ndarray, normal: np.ndarray, triangles: np.ndarray, quads: np.ndarray | None = None
) -> tuple[GridLayout, np.ndarray] | tuple[None, None]:
    """Recognise a grid of rows and columns by its topology.

    The numbers of vertices, R·C, and of triangles, 2(R−1)(C−1), determine the size of the grid. The rim then holds the first
    row and the first column, from which cell after cell follows, whatever the direction of its diagonal. If there are several
    solutions, the one with the shortest edges (and the longest diagonals) is taken.

    Parameters
    ----------
    position, normal : (n, 3) float
        Texels; every one is a corner of a triangle.
    triangles : (m, 3) int
        Anticlockwise seen from outside.
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
    quads = np.zeros((0, 4), int) if quads is None or len(quads) == 0 else np.asarray(quads)
    grid = _find_grid(position, edges, sizes, quads[(quads >= 0).all(axis=1)])
    if grid is None:
        return None, None
    grid = _turned(grid, position, normal)
    along = np.empty((len(position), 3))
    along[grid] = np.gradient(position[grid], axis=1)
    rows, columns = grid.shape
    row, column = _places(grid)
    return GridLayout(rows, columns, row, column, np.asarray(triangles)), unit(along)


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
        if grid is not None and _quads_match_grid(grid, quads):
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


def _quads_match_grid(grid: np.ndarray, quads: np.ndarray) -> bool:
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
        return preference(steps.mean(axis=(0, 1)) / length)  # zero for a grid that goes all the way round

    return np.rot90(grid, max(range(4), key=score))


def grid_of_places(place: np.ndarray, along: np.ndarray, across: np.ndarray) -> GridLayout:
    """Return rows and columns for places that lie in such; others get one row, in their order.

    Parameters
    ----------
    place : (k, 3) float, m
    along, across : (3,) float
        Directions in which columns and rows are counted.
    """
    count = len(place)
    flat = place @ np.stack([along, across], axis=1)
    apart = np.linalg.norm(flat[:, None] - flat[None], axis=2) + np.where(np.eye(count) > 0, np.inf, 0.0)
    step = SAME_LINE * float(np.median(apart.min(axis=1))) if count > 1 else 1.0
    column, row = (_lines(values, step) for values in flat.T)
    rows, columns = int(row.max()) + 1, int(column.max()) + 1
    if len(np.unique(row * columns + column)) < count or rows * columns > MOST_EMPTY * count:
        return GridLayout(1, count, np.zeros(count, int), np.arange(count))
    return GridLayout(rows, columns, row, column)


def _lines(values: np.ndarray, step: float) -> np.ndarray:
    """Return for each value the number of its line: lines are further apart than a step."""
    order = np.argsort(values, kind="stable")
    line = np.empty(len(values), int)
    line[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > step)])
    return line


def preference(direction: np.ndarray) -> float:
    """Rank directions: along +x first, and of equals along +y, then +z."""
    return float(direction @ (1.0, 1e-3, 1e-6))


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors of length one; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


# A smooth surface of penetration through the texels of a grid, the one by which a baked sensor is indented.
#
# It is the surface of Catmull and Clark's subdivision (1978), which on rows and columns is the bicubic B-spline, of values that
# were corrected beforehand for what the subdivision takes from them. The indentation in Blender corrects them in the same way.

SHARPENINGS = 4
"""How often the values at the texels are corrected for what the smoothing takes from them. After four corrections the lowest
point of the surface is at the depth of a wide contact within 3 %, and of a contact of a single texel within a quarter."""
NEIGHBOUR_WEIGHT = 0.25
"""Weight of a neighbour beside the texel's own in the correction: on a grid of quads the texel then counts a half, which is
near the 4/9 of the limit surface of Catmull and Clark."""


def smooth_depth(depth: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the smooth penetration where rows cross columns; it is nowhere negative.

    Parameters
    ----------
    depth : (r, c) float, metres
        At the texels, row 0 first. Negative values count as none.
    rows, columns : (h,) and (w,) float
        Places, in texels from the first row and the first column.

    Returns
    -------
    (h, w) float, metres
    """
    from scipy import ndimage

    depth = np.maximum(depth, 0.0)
    beside = np.array([[0.0, NEIGHBOUR_WEIGHT, 0.0], [NEIGHBOUR_WEIGHT, 1.0, NEIGHBOUR_WEIGHT], [0.0, NEIGHBOUR_WEIGHT, 0.0]])
    total = ndimage.convolve(np.ones_like(depth), beside, mode="constant")
    control = depth
    for _ in range(SHARPENINGS):
        control = control + (depth - ndimage.convolve(control, beside, mode="constant") / total)
    # beyond its borders the surface goes on in a straight line
    control = np.pad(control, 1, mode="reflect", reflect_type="odd")
    places = np.meshgrid(np.asarray(rows) + 1.0, np.asarray(columns) + 1.0, indexing="ij")
    return np.maximum(ndimage.map_coordinates(control, places, order=3, mode="nearest", prefilter=False), 0.0)
