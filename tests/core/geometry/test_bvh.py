# SPDX-License-Identifier: GPL-3.0-or-later
"""The tree of triangles: segments against a search of all triangles, those through edges and vertices, and slivers."""

import numpy as np
import pytest
import trimesh
from solver_scenes import grid_mesh, shape

from palpate.core.compiled.kernels import kernel
from palpate.core.geometry import bvh
from palpate.core.geometry.mesh import TriangleMesh, face_normals

NONE = 2.0


@kernel
def _entries(origins, vectors, hints, tree, t, triangle):
    for i in range(len(origins)):
        o, d = origins[i], vectors[i]
        t[i], triangle[i], _ = bvh.segment_entry(bvh.Segment(o[0], o[1], o[2], d[0], d[1], d[2]), 0, hints[i], tree)


def entries(mesh, origins, vectors, hints=None):
    """Position of each segment's first entry (2 where there is none), and its triangle (-1)."""
    hints = np.full(len(origins), -1) if hints is None else hints
    tree = bvh.build_tree([mesh])
    t, triangle = np.empty(len(origins)), np.empty(len(origins), np.int64)
    _entries(np.ascontiguousarray(origins), np.ascontiguousarray(vectors), hints, tree, t, triangle)
    return t, np.where(triangle >= 0, tree.source[triangle], -1)


def solids():
    """Round, hollow, sharp, uneven, long and thin."""
    made = {
        "ball": trimesh.creation.icosphere(4),
        "torus": trimesh.creation.torus(1.0, 0.4, 96, 48),
        "cone": trimesh.creation.cone(0.8, 1.6, sections=200),
        "ring": trimesh.creation.annulus(0.4, 1.0, 0.8, sections=128),
        "needle": trimesh.creation.cylinder(0.02, 2.4, sections=64),
    }
    bumpy = trimesh.creation.icosphere(4)
    bumpy.vertices *= 1.0 + 0.2 * np.sin(7 * bumpy.vertices[:, :1]) * np.cos(5 * bumpy.vertices[:, 1:2])
    made["bumpy"] = bumpy
    return {name: shape(solid, name) for name, solid in made.items()}


def random_segments(rng, mesh, n):
    """Segments from anywhere around or inside a solid to anywhere near its surface, and on."""
    center, size = mesh.vertices.mean(axis=0), np.ptp(mesh.vertices, axis=0)
    origins = center + rng.uniform(-0.75, 0.75, (n, 3)) * (size + 0.1 * size.max())
    corners = mesh.vertices[mesh.triangles[rng.integers(0, len(mesh.triangles), n)]]
    aims = np.einsum("nc,ncx->nx", rng.dirichlet(np.ones(3), n), corners)
    aims += rng.normal(size=(n, 3)) * 0.02 * size
    return origins, (aims - origins) * rng.uniform(0.5, 2.0, (n, 1))


def first_entries(mesh, origins, vectors):
    """What `entries` has to find, by Möller and Trumbore's formula for each segment and each triangle."""
    t, triangle = np.full(len(origins), NONE), np.full(len(origins), -1)
    corner, (u, v) = mesh.vertices[mesh.triangles[:, 0]], mesh.vertices[mesh.triangles[:, 1:]].swapaxes(0, 1)
    u, v = u - corner, v - corner
    for i, (origin, vector) in enumerate(zip(origins, vectors, strict=True)):
        across, from_corner = np.cross(vector, v), origin - corner
        volume = np.einsum("ij,ij->i", u, across)
        with np.errstate(divide="ignore", invalid="ignore"):
            first = np.einsum("ij,ij->i", from_corner, across) / volume
            along = np.cross(from_corner, u)
            second, at = along @ vector / volume, np.einsum("ij,ij->i", v, along) / volume
        met = (volume > 0.0) & (first >= 0.0) & (second >= 0.0) & (first + second <= 1.0) & (at >= 0.0) & (at <= 1.0)
        if met.any():
            triangle[i] = np.flatnonzero(met)[at[met].argmin()]
            t[i] = at[triangle[i]]
    return t, triangle


def leaks(mesh, scale, place, seed):
    """Count the segments that get through a closed solid's skin at a vertex or an edge, and all that were tried.

    Each starts outside, goes exactly through a vertex, an edge's middle or a random point of an edge, and ends inside. It
    is turned, scaled and moved first, so that every coordinate is rounded again.
    """
    rng = np.random.default_rng(seed)
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    moved = TriangleMesh(scale * (mesh.vertices @ turn.T + place), mesh.triangles)
    normals = np.zeros_like(moved.vertices)
    np.add.at(normals, moved.triangles.T, face_normals(moved)[None])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    edges = np.unique(np.sort(moved.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    ends, share = moved.vertices[edges], rng.random((len(edges), 1))
    aims = np.vstack([moved.vertices, ends.mean(axis=1), ends[:, 0] * share + ends[:, 1] * (1 - share)])
    along = normals[edges].mean(axis=1)
    out = np.vstack([normals, along, along])
    short = 0.02 * np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).min()
    out = out / np.linalg.norm(out, axis=1, keepdims=True) + 0.1 * rng.uniform(-1, 1, out.shape)
    t, _ = entries(moved, aims + short * out, -2.0 * short * out)
    return int((t == NONE).sum()), len(t)


SOLIDS = solids()


@pytest.mark.parametrize("name", SOLIDS)
def test_random_segments_meet_what_a_search_of_all_triangles_finds(name):
    """The same triangle at the same place, to rounding; none of them passes so near an edge that rounding could decide."""
    origins, vectors = random_segments(np.random.default_rng(11), SOLIDS[name], 1000)
    t, triangle = entries(SOLIDS[name], origins, vectors)
    expected, nearest = first_entries(SOLIDS[name], origins, vectors)
    np.testing.assert_array_equal(triangle, nearest)
    np.testing.assert_allclose(t, expected, rtol=0, atol=1e-12)
    assert (triangle >= 0).sum() > 250


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("name", SOLIDS)
def test_segments_through_edges_and_vertices_never_leak(name, scale):
    """At any size, turned, and moved by some times its size, so that shared corners are anything but round numbers."""
    for seed in range(4):
        through, tried = leaks(SOLIDS[name], scale, np.array([0.3, -7.0, 2.1]) * seed, seed)
        assert tried > 200
        assert through == 0


def test_slivers_never_answer_even_when_aimed_at():
    """Put into the tree past the check that leaves them out (a mesh may fold up while it deforms): corners on one line up to
    rounding, corners that coincide, and all three the same."""
    rng = np.random.default_rng(3)
    ball, n = SOLIDS["ball"], 2000
    a, b = rng.normal(size=(2, n, 3))
    c = a + rng.random((n, 1)) * (b - a)
    one, two, three = len(ball.vertices) + np.arange(3 * n).reshape(3, n)
    slivers = np.vstack([np.stack(corners, axis=1) for corners in ((one, two, three), (one, two, two), (three, three, three))])
    bad = TriangleMesh(np.vstack([ball.vertices, a, b, c]), np.vstack([ball.triangles, slivers]))
    aims = np.vstack([a + rng.random((n, 1)) * (b - a), c])
    vectors = rng.normal(size=aims.shape)
    plain, triangle = entries(bad, aims - vectors, 2 * vectors)
    clean, _ = entries(ball, aims - vectors, 2 * vectors)
    assert (clean < NONE).sum() > 500
    assert (triangle < len(ball.triangles)).all()
    assert np.array_equal(plain, clean)


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
