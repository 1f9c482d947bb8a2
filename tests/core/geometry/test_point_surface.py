# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles between points of a surface."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from palpate.core.errors import SensorError
from palpate.core.geometry.mesh import TriangleMesh, is_closed, triangle_areas
from palpate.core.geometry.point_surface import triangles_between


def test_the_points_of_a_ball_give_its_convex_hull():
    """The only surface through points of a sphere that has them all: the hull, which trimesh computes in another way."""
    points = np.array(trimesh.creation.icosphere(subdivisions=2, radius=0.02).vertices)
    triangles = triangles_between(points, points / 0.02)
    assert is_closed(triangles)
    volume = np.einsum("ij,ij->", points[triangles[:, 0]], np.cross(points[triangles[:, 1]], points[triangles[:, 2]])) / 6
    assert volume == pytest.approx(trimesh.convex.convex_hull(points).volume, rel=1e-9)  # above zero: turned outwards


@pytest.mark.parametrize(("jitter", "stretch"), [(0.0, 1.0), (0.3, 1.0), (0.0, 2.6), (0.1, 2.6), (0.0, 3.5)])
def test_a_patch_is_covered_once_and_no_point_is_left_out(jitter, stretch):
    rng = np.random.default_rng(5)
    grid = np.stack(np.meshgrid(np.arange(12.0), np.arange(9.0)), axis=-1).reshape(-1, 2)
    inner = ((grid > 0) & (grid < [11, 8])).all(axis=1)
    grid[inner] += rng.uniform(-jitter, jitter, (inner.sum(), 2))
    points = np.column_stack([grid * [1.0, stretch], 0.1 * np.sin(grid[:, 0])]) * 0.003
    triangles = triangles_between(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)))
    assert set(triangles.ravel()) == set(range(len(points)))
    flat = TriangleMesh(points * [1.0, 1.0, 0.0], triangles)
    assert triangle_areas(flat).sum() == pytest.approx(11 * 8 * stretch * 0.003**2, rel=0.02)


def test_two_fingers_are_not_joined():
    near = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0), [0.0]), axis=-1).reshape(-1, 3)
    points = np.concatenate([near, near + [8.0, 0.0, 0.0]]) * 0.002
    triangles = triangles_between(points, np.tile([0.0, 0.0, 1.0], (50, 1)))
    assert {tuple(sorted({corner // 25 for corner in triangle})) for triangle in triangles.tolist()} == {(0,), (1,)}


@pytest.mark.parametrize(
    ("points", "says"),
    [
        (np.zeros((2, 3)), "2 points span no surface"),
        (np.array([[0, 0, 0], [0, 0, 0], [1.0, 0, 0]]), "at the same place"),
        (np.array([[0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]), "on a line"),
    ],
)
def test_points_without_a_surface_are_refused(points, says):
    with pytest.raises(SensorError, match=says):
        triangles_between(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)))
