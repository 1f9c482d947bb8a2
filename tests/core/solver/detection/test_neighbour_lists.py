# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known to be near a segment answers like the tree, bit by bit, for all segments that it is said to hold for."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from solver_scenes import grid_mesh, shape

from palpate.core.geometry.bvh import Segment, build_tree, segment_entry
from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.solver.detection import neighbour_lists

REACH = 0.25


def rough(seed: int) -> TriangleMesh:
    """A ball whose every corner is moved, so that it has ridges, overhangs and slivers."""
    ball = shape(trimesh.creation.icosphere(4))
    return replace(ball, vertices=ball.vertices * (1 + 0.02 * np.random.default_rng(seed).normal(size=(len(ball.vertices), 1))))


def together(*meshes: TriangleMesh) -> TriangleMesh:
    """Several meshes in one, which may run through each other."""
    start = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    triangles = [mesh.triangles + first for mesh, first in zip(meshes, start, strict=False)]
    return TriangleMesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(triangles))


def moved(mesh: TriangleMesh, *by: float) -> TriangleMesh:
    return replace(mesh, vertices=mesh.vertices + np.array(by))


BALL = shape(trimesh.creation.icosphere(4))
SURFACES = {
    "ball": BALL,
    "torus": shape(trimesh.creation.torus(1.0, 0.4, 48, 24)),
    "cube": shape(trimesh.creation.box((1.5, 1.5, 1.5)).subdivide().subdivide()),
    "rough": rough(1),
    "open sheet": grid_mesh(30, 30, 0.07),
    "balls in each other": together(BALL, moved(BALL, 0.0, 0.0, 0.05), moved(BALL, 0.1, 0.0, 0.0)),
    "shells": together(BALL, replace(BALL, vertices=0.93 * BALL.vertices, triangles=BALL.triangles[:, ::-1])),
    "two sheets": together(grid_mesh(30, 30, 0.07), moved(grid_mesh(30, 30, 0.07), 0.01, 0.02, 0.02)),
}


def segments(mesh: TriangleMesh, number: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Bases and tips of segments that run against the surface from anywhere near it, one in eight through a corner."""
    rng = np.random.default_rng(seed)
    triangle = mesh.triangles[rng.integers(0, len(mesh.triangles), number)]
    corners = mesh.vertices[triangle]
    aims = np.einsum("ni,nij->nj", rng.dirichlet(np.ones(3), number), corners)
    aims[::8] = corners[::8, 0]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    vectors = -normals / np.linalg.norm(normals, axis=1)[:, None]
    vectors += rng.normal(size=(number, 3)) * rng.choice([0.02, 0.3, 1.0], (number, 1))
    vectors *= REACH / np.linalg.norm(vectors, axis=1)[:, None]
    bases = aims - rng.uniform(-0.3, 1.3, (number, 1)) * vectors
    return bases, bases + vectors


@pytest.mark.parametrize("name", SURFACES)
def test_what_is_near_answers_like_the_tree(name):
    """Each end of a segment is moved about within what its knowledge is good for, to its rim above all."""
    mesh, number = SURFACES[name], 400
    tree, known = build_tree([mesh]), neighbour_lists.neighbour_lists_for(number, 1)
    bases, tips = segments(mesh, number, 5)
    rng, kinds, hits = np.random.default_rng(6), [], 0
    for slot in range(number):
        base, vector = bases[slot], tips[slot] - bases[slot]
        radius = REACH * rng.choice([0.25, 0.05, 0.01, 1e-4])
        empty = bool(slot % 2)
        lengths = (radius, 0.02, 0.01 * radius)
        neighbour_lists.rebuild_list(slot, Segment(*base, *vector), 0, lengths, (empty, True), known, tree)
        until = known.valid_distance[slot]
        assert until > 0.0
        kinds.append(known.length[slot])
        hint = -1
        for _ in range(12):
            ends = rng.normal(size=(2, 3))
            ends *= until * np.minimum(rng.uniform(0, 3, (2, 1)), 1.0) / np.linalg.norm(ends, axis=1)[:, None]
            start = base + ends[0]
            direction = tips[slot] + ends[1] - start
            t, triangle, leaving = neighbour_lists.find_entry(Segment(*start, *direction), slot, 0, hint, known, tree)
            expected = segment_entry(Segment(*start, *direction), 0, -1, tree)
            assert triangle == expected[1]
            if triangle >= 0:
                assert t == expected[0]
                hits += 1
            else:
                assert (leaving <= 1.0) == (expected[2] <= 1.0)
            hint = triangle
    assert hits > 500
    kinds = np.array(kinds)
    sheets = (kinds == neighbour_lists.ONE_SHEET).mean()
    if name in ("ball", "torus"):
        assert sheets > 0.2  # the walk is what is tested


def test_a_target_that_deforms_has_no_sheets():
    """Its normals are not those that the tree knows."""
    tree, known = build_tree([BALL]), neighbour_lists.neighbour_lists_for(1, 1)
    segment, lengths = Segment(0.01, 0.02, 1.1, 0.0, 0.0, -0.2), (0.05, 0.02, 0.0)
    neighbour_lists.rebuild_list(0, segment, 0, lengths, (False, False), known, tree)
    assert known.length[0] >= 0 or known.length[0] == neighbour_lists.ASK_TREE
    neighbour_lists.rebuild_list(0, segment, 0, lengths, (False, True), known, tree)
    assert known.length[0] == neighbour_lists.ONE_SHEET
