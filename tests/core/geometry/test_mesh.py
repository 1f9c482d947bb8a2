# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes: what is refused, what is repaired, and mass properties against closed forms."""

import numpy as np
import pytest
import trimesh
from solver_scenes import box, grid_mesh, shape

from palpate.core.errors import MeshError, ParameterError
from palpate.core.geometry.mesh import (
    checked_mesh,
    edge_defects,
    face_normals,
    is_closed,
    mass_properties,
    outward_faces,
    triangle_areas,
    unique_edges,
    vertex_areas,
    vertex_normals,
)

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


def test_nan_vertex_is_named():
    vertices = TRIANGLE.copy()
    vertices[1, 2] = np.nan
    with pytest.raises(MeshError, match=r"Vertex 1 of 'ball' has a NaN"):
        checked_mesh(vertices, [[0, 1, 2]], "ball")


def test_zero_area_everywhere_is_refused_and_somewhere_is_repaired():
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    with pytest.raises(MeshError, match="zero area"):
        checked_mesh(line, [[0, 1, 2]], "ball")
    mesh, warnings = checked_mesh(line, [[0, 1, 2], [0, 1, 3]], "ball")
    assert len(mesh.triangles) == 1
    assert warnings == ["1 faces of 'ball' have zero area and were left out."]


def test_non_manifold_is_used_with_a_warning():
    vertices = np.vstack([TRIANGLE, [[0.0, 0, 1], [0, -1, 0]]])
    mesh, warnings = checked_mesh(vertices, [[0, 1, 2], [1, 0, 3], [0, 1, 4]], "fin")
    assert len(mesh.triangles) == 3
    assert any("non-manifold" in warning for warning in warnings)


def test_flipped_face_is_noticed():
    solid = trimesh.creation.box()
    faces = solid.faces.copy()
    assert is_closed(faces)
    faces[0] = faces[0, ::-1]
    assert edge_defects(faces)[2] > 0
    assert any("opposite sides" in warning for warning in checked_mesh(solid.vertices, faces, "box")[1])


def test_edges_are_those_of_trimesh():
    """Also where faces are degenerate, repeated or turned, and where edges are open or branch."""
    solid = np.array(trimesh.creation.icosphere(2).faces)
    soup = np.random.default_rng(1).integers(0, 30, (200, 3))
    for faces in (solid, solid[:100], np.vstack([solid, solid[:50, ::-1]]), soup, soup + 2_000_000_000):
        every = trimesh.geometry.faces_to_edges(faces)
        first, same = trimesh.grouping.unique_rows(np.sort(every, axis=1))
        edges, which, count = unique_edges(faces)
        np.testing.assert_array_equal(edges[which].reshape(-1, 2), np.sort(every, axis=1))
        np.testing.assert_array_equal(count[which].ravel(), np.bincount(same)[same])
        assert len(edges) == len(first)
        assert edges.tolist() == sorted(edges.tolist())


def test_normals_point_outwards_and_vertex_normals_are_the_paper_s_sum():
    mesh = shape(trimesh.creation.icosphere(3))
    centers = mesh.vertices[mesh.triangles].mean(axis=1)
    assert (np.einsum("ij,ij->i", face_normals(mesh), centers) > 0.9).all()
    expected = np.zeros((len(mesh.vertices), 3))
    for triangle, normal in zip(mesh.triangles, face_normals(mesh), strict=True):  # as section 3.1 says it, face by face
        for vertex in triangle:
            expected[vertex] += normal
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(vertex_normals(mesh), expected, atol=1e-14)


def test_areas_are_shared_out_completely():
    mesh = grid_mesh(9, 5, 0.002)
    everything = vertex_areas(mesh, np.ones(len(mesh.triangles), bool))
    assert everything.sum() == pytest.approx(8 * 4 * 0.002**2, rel=1e-12)
    assert triangle_areas(mesh).sum() == pytest.approx(everything.sum(), rel=1e-12)


@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_mass_properties_of_a_box(offset):
    """Closed form m/12 (b² + c²); a box 100 m away loses no digit that its coordinates still have."""
    a, b, c = 0.02, 0.03, 0.05
    mesh = box(a, b, c)
    moved, _ = checked_mesh(mesh.vertices + offset, mesh.triangles, "box")
    center, inertia, warnings = mass_properties(moved, 2.0, "box")
    assert not warnings
    np.testing.assert_allclose(center, offset, atol=1e-12)
    closed = 2.0 / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    np.testing.assert_allclose(inertia, closed, atol=1e-12 * closed.max() if offset == 0 else 1e-9 * closed.max())


@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_a_solid_with_faces_that_point_inwards_is_turned(offset):
    mesh = box(0.02, 0.03, 0.05)
    moved, _ = checked_mesh(mesh.vertices + offset, mesh.triangles, "box")
    assert outward_faces(moved, "box") == (moved, [])
    inverted, _ = checked_mesh(moved.vertices, moved.triangles[:, ::-1], "box")
    turned, warnings = outward_faces(inverted, "box")
    np.testing.assert_allclose(face_normals(turned), face_normals(moved))
    assert "'box' point inwards" in warnings[0]
    sheet = grid_mesh()
    assert outward_faces(sheet, "sheet") == (sheet, [])


def test_mass_of_an_open_sheet_is_that_of_a_box_with_a_warning():
    center, inertia, warnings = mass_properties(grid_mesh(), 1.0, "sheet")
    assert "not a closed solid" in warnings[0]
    assert np.linalg.eigvalsh(inertia).min() > 0
    np.testing.assert_allclose(center, 0, atol=1e-15)


@pytest.mark.parametrize("mass", [0.0, -1.0, np.nan])
def test_mass_must_be_above_zero(mass):
    with pytest.raises(ParameterError, match="mass of free body 'cube'"):
        mass_properties(box(1, 1, 1), mass, "cube")
