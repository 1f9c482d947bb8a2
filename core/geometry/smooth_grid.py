# SPDX-License-Identifier: GPL-3.0-or-later
"""A smooth surface of penetration through the texels of a grid.

The surface is the limit of Catmull and Clark's subdivision (1978), which on rows and columns is the bicubic B-spline, of values
that were corrected beforehand for what the subdivision takes from them. The indented surface in Blender is made in the same
way, of geometry nodes and with the numbers of this module, so that figures and scene show one surface. At the four corners of
a grid, which the subdivision rounds, the two differ. :mod:`.smooth_mesh` is the same surface on any faces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

SHARPENINGS = 4
"""How often the values at the texels are corrected for what the smoothing takes from them. After four corrections the lowest
point of the surface is at the depth of a wide contact within 3 %, and of a contact of a single texel within a quarter."""
NEIGHBOUR_WEIGHT = 0.25
"""Weight of a neighbour beside the texel's own in the correction: on a grid of quads the texel then counts a half, which is
near the 4/9 of the limit surface of Catmull and Clark."""


def sharpened(values: np.ndarray) -> np.ndarray:
    """Return the values of a grid, (r, c) float, sharpened by :func:`sharpened_by`; neighbours share a row or column."""
    values = np.asarray(values, float)
    number = np.arange(values.size).reshape(values.shape)
    along, up = (
        np.column_stack([one.ravel(), other.ravel()])
        for one, other in ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:]))
    )
    return sharpened_by(blur_matrix(np.concatenate([along, up]), values.size), values.ravel()).reshape(values.shape)


def sharpened_by(blur: csr_matrix, values: np.ndarray) -> np.ndarray:
    """Return values whose smoothed surface passes near the given ones: each time, what a blur takes away is added.

    Parameters
    ----------
    blur : (n, n) csr_matrix
        From :func:`blur_matrix`.
    values : (n,) float

    Returns
    -------
    (n,) float
    """
    made = values
    for _ in range(SHARPENINGS):
        made = made + (values - blur @ made)
    return made


def blur_matrix(ends: np.ndarray, count: int) -> csr_matrix:
    """Return the mean of each value, with weight one, and its neighbours, with :data:`NEIGHBOUR_WEIGHT`.

    Parameters
    ----------
    ends : (m, 2) int
        Pairs of neighbours, each pair once.
    count : int
        Number n of values.

    Returns
    -------
    (n, n) csr_matrix
    """
    from scipy.sparse import csr_matrix, identity

    first, second = np.asarray(ends, np.int64).reshape(-1, 2).T
    rows, columns = np.append(first, second), np.append(second, first)
    beside = csr_matrix((np.full(len(rows), NEIGHBOUR_WEIGHT), (rows, columns)), shape=(count, count))
    total = 1.0 + np.asarray(beside.sum(axis=1)).ravel()
    return (identity(count, format="csr") + beside).multiply(1.0 / total[:, None]).tocsr()


def spline_weights(count: int, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the weights of ``count`` values, one unit apart, in a uniform cubic B-spline and in its derivative.

    Beyond both ends the values go on in a straight line, which is the border of Catmull and Clark's surface.

    Parameters
    ----------
    count : int
        Two or more.
    places : (m,) float
        From 0 to ``count - 1``.

    Returns
    -------
    weights, slopes : (m, c) float, one column for each value
    """
    places = np.asarray(places, float)
    cell = np.clip(np.floor(places).astype(int), 0, count - 2)
    t = places - cell
    basis = np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=1) / 6.0
    slope = np.stack([-((1 - t) ** 2), 3 * t**2 - 4 * t, -3 * t**2 + 2 * t + 1, t**2], axis=1) / 2.0
    extended = np.zeros((2, len(places), count + 2))
    rows = np.arange(len(places))
    for k in range(4):
        extended[0, rows, cell + k] = basis[:, k]
        extended[1, rows, cell + k] = slope[:, k]
    inner = extended[:, :, 1:-1].copy()
    for beyond, first, second in ((0, 0, 1), (-1, -1, -2)):  # the value beyond an end is twice the last minus the one before
        inner[:, :, first] += 2.0 * extended[:, :, beyond]
        inner[:, :, second] -= extended[:, :, beyond]
    return inner[0], inner[1]


def smooth_depth(depth: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the smooth penetration on a lattice of places between the texels, and its slopes; it is nowhere negative.

    Parameters
    ----------
    depth : (r, c) float, metres
        At the texels, row 0 first. Negative values count as none.
    rows, columns : (h,) and (w,) float
        Places, in texels from the first row and the first column.

    Returns
    -------
    depth : (h, w) float, metres
    row_slope, column_slope : (h, w) float, metres per texel
        Zero where the surface is cut off at zero.
    """
    control = sharpened(np.maximum(depth, 0.0))
    (up, up_slope), (along, along_slope) = (spline_weights(*item) for item in zip(control.shape, (rows, columns), strict=True))
    surface = up @ control @ along.T
    inside = surface > 0.0
    slopes = (up_slope @ control @ along.T, up @ control @ along_slope.T)
    return np.where(inside, surface, 0.0), np.where(inside, slopes[0], 0.0), np.where(inside, slopes[1], 0.0)


def smooth_values(values: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the smooth surface of values of any sign at scattered places.

    Parameters
    ----------
    values : (r, c) float
    rows, columns : (m,) float
        Places, in texels from the first row and the first column.

    Returns
    -------
    (m,) float
    """
    up, _ = spline_weights(values.shape[0], rows)
    along, _ = spline_weights(values.shape[1], columns)
    return np.einsum("mr,rc,mc->m", up, sharpened(values), along, optimize=True)
