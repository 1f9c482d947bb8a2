# SPDX-License-Identifier: GPL-3.0-or-later
"""Segment queries against a plain loop over all triangles, and against trimesh's rays."""

import numpy as np
import pytest
import trimesh
from solver_scenes import grid_mesh, shape

from palpate.core.geometry import bvh
from palpate.core.geometry.mesh import face_normals

NONE = 2.0


def entries(mesh, origins, vectors, hints=None):
    tree = bvh.build_tree([mesh])
    hints = np.full(len(origins), -1) if hints is None else hints
    found = [bvh.segment_entry(bvh.Segment(*o, *d), 0, hint, tree) for o, d, hint in zip(origins, vectors, hints, strict=True)]
    t = np.array([t for t, _, _ in found])
    triangle = np.array([triangle for _, triangle, _ in found])
    return t, np.where(triangle >= 0, tree.source[triangle], -1)


def brute_force(mesh, origins, vectors):
    """Möller–Trumbore on every triangle, written without looking at the kernel: nearest entry from outside."""
    a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
    normals = face_normals(mesh)
    nearest = np.full(len(origins), NONE)
    for i, (o, d) in enumerate(zip(origins, vectors, strict=True)):
        p = np.cross(d, c - a)
        det = np.einsum("ij,ij->i", b - a, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = o - a
            u = np.einsum("ij,ij->i", s, p) / det
            q = np.cross(s, b - a)
            v = q @ d / det
            t = np.einsum("ij,ij->i", c - a, q) / det
        good = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1) & (normals @ d < 0)
        if good.any():
            nearest[i] = t[good].min()
    return nearest


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


def test_random_segments_agree_with_a_plain_loop():
    mesh = shape(trimesh.creation.torus(1.0, 0.4, 24, 12))
    rng = np.random.default_rng(2)
    origins = rng.normal(size=(2500, 3)) * [1.2, 1.2, 0.5]
    vectors = rng.normal(size=(2500, 3))
    t, _ = entries(mesh, origins, vectors)
    expected = brute_force(mesh, origins, vectors)
    assert (expected < NONE).sum() > 200
    np.testing.assert_allclose(t, expected, atol=1e-12)


def test_random_segments_agree_with_an_independent_ray_library():
    mesh = shape(trimesh.creation.icosphere(3))
    rays = trimesh.ray.ray_triangle.RayMeshIntersector(trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False))
    rng = np.random.default_rng(3)
    origins = rng.normal(size=(1500, 3)) * 1.5
    outside = np.linalg.norm(origins, axis=1) > 1.0
    origins, vectors = origins[outside], -4 * origins[outside] + rng.normal(size=(outside.sum(), 3)) * 0.8
    points, ray, _ = rays.intersects_location(origins, vectors, multiple_hits=True)
    reached = np.einsum("ij,ij->i", points - origins[ray], vectors[ray]) / np.einsum("ij,ij->i", vectors[ray], vectors[ray])
    expected = np.full(len(origins), NONE)
    np.minimum.at(expected, ray, np.where(reached <= 1, reached, NONE))
    t, _ = entries(mesh, origins, vectors)
    np.testing.assert_allclose(t, expected, atol=1e-8)  # the library works to about 1e-9


def test_segments_through_edges_and_vertices_never_leak():
    """Aimed exactly at vertices, edge midpoints and random points of edges of a closed solid, from outside to its inside."""
    mesh = shape(trimesh.creation.icosphere(2))
    rng = np.random.default_rng(4)
    edges = np.sort(mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    share = rng.random((len(edges), 1))
    on_edges = mesh.vertices[edges[:, 0]] * share + mesh.vertices[edges[:, 1]] * (1 - share)
    aims = np.vstack([mesh.vertices, mesh.vertices[edges].mean(axis=1), on_edges])
    for _ in range(5):
        origins = rng.normal(size=aims.shape)
        origins = aims * 1.5 + 0.4 * np.cross(aims, origins)
        vectors = 1.3 * (aims - origins)
        t, _ = entries(mesh, origins, vectors)
        assert (t < NONE).all()
        np.testing.assert_allclose(t, 1 / 1.3, atol=0.02)


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


def test_degenerate_triangles_never_answer():
    """Put into the tree on purpose, past the check that would leave them out."""
    mesh = grid_mesh(2, 2, 1.0)
    sliver = np.array([[0.0, 0, 0.5], [1, 0, 0.5], [0.5, 0, 0.5]])
    bad = type(mesh)(np.vstack([mesh.vertices, sliver]), np.vstack([mesh.triangles, [[4, 5, 6], [4, 4, 5], [4, 4, 4]]]))
    origins = np.array([[0.25, 0, 1.0], [0.1, 0.0, 1.0], [0, 0, 1.0]])
    t, triangle = entries(bad, origins, np.tile([0, 0, -2.0], (3, 1)))
    np.testing.assert_allclose(t, 0.5)
    assert (triangle < 2).all()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_several_meshes_share_one_tree(count):
    meshes = [shape(trimesh.creation.icosphere(k)) for k in range(count)]
    tree = bvh.build_tree(meshes)
    assert len(tree.roots) == count + 1
    for i, mesh in enumerate(meshes):
        nodes = slice(tree.roots[i], tree.roots[i + 1])
        assert tree.number[nodes].sum() == len(mesh.triangles)
        assert (tree.skip[nodes] <= tree.roots[i + 1]).all()
