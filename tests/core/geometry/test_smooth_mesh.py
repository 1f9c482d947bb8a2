# SPDX-License-Identifier: GPL-3.0-or-later
"""The smooth surface on any mesh: on a grid it is the one of rows and columns; elsewhere it keeps what subdivisions keep."""

import numpy as np
import pytest

from palpate.core.geometry.smooth_grid import smooth_depth
from palpate.core.geometry.smooth_mesh import smooth_mesh

CUBE = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])


def faces_of(table):
    return np.concatenate([[0], np.cumsum([len(face) for face in table])[:-1]]), np.concatenate(table)


def grid_faces(rows, columns):
    number = np.arange(rows * columns).reshape(rows, columns)
    return np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_on_a_grid_it_is_the_surface_of_rows_and_columns(levels):
    """To rounding, except in the cells at the four corners, which the subdivision rounds."""
    rows, columns = 7, 9
    depth = np.random.default_rng(levels).random((rows, columns))
    mesh = smooth_mesh(*faces_of(grid_faces(rows, columns)), rows * columns, levels)
    assert len(mesh.quads) == (rows - 1) * (columns - 1) * 4**levels
    place = np.column_stack(np.divmod(np.arange(rows * columns), columns)).astype(float)
    row, column = (mesh.even @ place).T  # where each finer vertex is, in texels
    lattice, *_ = smooth_depth(depth, np.arange(0, rows - 1 + 1e-9, 0.5**levels), np.arange(0, columns - 1 + 1e-9, 0.5**levels))
    expected = lattice[(row * 2**levels).round().astype(int), (column * 2**levels).round().astype(int)]
    away = np.hypot(np.minimum(row, rows - 1 - row), np.minimum(column, columns - 1 - column)) > 2.0**0.5
    found = mesh.smooth(depth.ravel())
    assert away.sum() > 0.8 * len(found)
    np.testing.assert_allclose(found[away], expected[away], atol=1e-12)


@pytest.mark.parametrize("table", [CUBE, [[0, 1, 2], [0, 2, 3, 4, 5]], [[0, 1, 2], [0, 1, 3], [1, 0, 4]]])
def test_an_even_value_stays_and_a_plane_stays_a_plane(table):
    """Also around corners of valence three, at triangles and faces of five, on borders, and where three faces share an edge."""
    starts, corners = faces_of(table)
    count = int(corners.max()) + 1
    mesh = smooth_mesh(starts, corners, count, 2)
    assert mesh.smooth(np.full(count, 2e-3)) == pytest.approx(np.full(mesh.even.shape[0], 2e-3), rel=1e-12)
    assert mesh.even.sum(axis=1) == pytest.approx(1.0) and mesh.limit.sum(axis=1) == pytest.approx(1.0)
    sizes = np.diff(np.append(starts, len(corners)))
    assert np.bincount(mesh.face) == pytest.approx(sizes * 4)
    flat = np.random.default_rng(0).random((count, 2))
    area = [_area((mesh.even @ flat)[mesh.quads[mesh.face == number]]) for number in range(len(starts))]
    whole = [abs(_area(flat[list(face)][None])) for face in table]
    assert np.abs(area) == pytest.approx(whole, rel=1e-9)  # the finer faces of a face cover it


def _area(polygons):
    x, y = polygons[..., 0], polygons[..., 1]
    return 0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum()


def test_the_limit_of_a_cube_is_that_of_finer_and_finer_meshes():
    """The limit after two levels and after five are the same places, and lie where Catmull and Clark's own steps tend to."""
    corner = np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float)
    starts, corners = faces_of(CUBE)
    coarse, fine = (smooth_mesh(starts, corners, 8, levels) for levels in (2, 5))
    old = coarse.limit.shape[0]
    np.testing.assert_allclose((fine.limit @ corner)[:8], (coarse.limit @ corner)[:8], atol=1e-14)
    # the limit of a corner of a cube: (9 corner + 4 · 3 neighbours + 3 opposite corners of faces) / 24
    expected = (9 * corner[0] + 4 * (corner[1] + corner[3] + corner[4]) + corner[2] + corner[5] + corner[7]) / 24
    np.testing.assert_allclose((coarse.limit @ corner)[0], expected, atol=1e-14)
    assert old == 8 + 12 + 6 + 48 + 24  # vertices of a cube subdivided twice
