# SPDX-License-Identifier: GPL-3.0-or-later
"""The tree of triangles and what its queries promise; test_exact_rays.py compares them with ray libraries."""

import numpy as np
import pytest
import trimesh
from solver_scenes import grid_mesh, shape

from palpate.core.geometry import bvh

NONE = 2.0


def entries(mesh, origins, vectors, hints=None):
    tree = bvh.build_tree([mesh])
    hints = np.full(len(origins), -1) if hints is None else hints
    found = [bvh.segment_entry(bvh.Segment(*o, *d), 0, hint, tree) for o, d, hint in zip(origins, vectors, hints, strict=True)]
    t = np.array([t for t, _, _ in found])
    triangle = np.array([triangle for _, triangle, _ in found])
    return t, np.where(triangle >= 0, tree.source[triangle], -1)


def test_tree_holds_every_triangle_once_and_skips_are_consistent():
    rng = np.random.default_rng(1)
    for n in [*range(1, 40), 255, 256, 257, 1000]:
        corners = rng.normal(size=(n, 3, 3))
        for leaf in (1, 2, 4, 7):
            order, size = np.arange(n), 2 * n + 1
            bounds, skip = np.empty((size, 6)), np.empty(size, np.int64)
            first, number = np.zeros(size, np.int64), np.zeros(size, np.int64)
            nodes = bvh._build(corners, corners.mean(axis=1), order, leaf, bounds, skip, first, number)
            assert sorted(order) == list(range(n))
            assert skip[0] == nodes
            assert number[:nodes].sum() == n
            assert (skip[:nodes] > np.arange(nodes)).all()


def test_flat_sheet_is_hit_on_its_grid_lines():
    """The commonest case: texels exactly above the vertices and edges of a flat, axis-aligned mesh."""
    mesh = grid_mesh(5, 4, 0.25)
    origins = mesh.vertices + [0, 0, 0.1]
    t, _ = entries(mesh, origins, np.tile([0, 0, -0.2], (len(origins), 1)))
    np.testing.assert_allclose(t, 0.5, atol=1e-15)


def test_back_faces_do_not_answer():
    mesh = grid_mesh(5, 4, 0.25)
    origins = mesh.vertices - [0, 0, 0.1]
    t, triangle = entries(mesh, origins, np.tile([0, 0, 0.2], (len(origins), 1)))
    assert (t == NONE).all()
    assert (triangle == -1).all()


def test_hints_change_nothing():
    mesh = shape(trimesh.creation.torus(1.0, 0.4, 24, 12))
    rng = np.random.default_rng(5)
    origins, vectors = rng.normal(size=(500, 3)), rng.normal(size=(500, 3))
    plain = entries(mesh, origins, vectors)
    hinted = entries(mesh, origins, vectors, rng.integers(0, len(mesh.triangles), 500))
    assert np.array_equal(plain[0], hinted[0])
    assert np.array_equal(plain[1], hinted[1])


@pytest.mark.parametrize("count", [1, 2, 3])
def test_several_meshes_share_one_tree(count):
    meshes = [shape(trimesh.creation.icosphere(k)) for k in range(count)]
    tree = bvh.build_tree(meshes)
    assert len(tree.roots) == count + 1
    for i, mesh in enumerate(meshes):
        nodes = slice(tree.roots[i], tree.roots[i + 1])
        assert tree.number[nodes].sum() == len(mesh.triangles)
        assert (tree.skip[nodes] <= tree.roots[i + 1]).all()
