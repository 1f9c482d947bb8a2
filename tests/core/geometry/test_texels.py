# SPDX-License-Identifier: GPL-3.0-or-later
"""Texels of a region: the paper's construction, and what a region may not be."""

import numpy as np
import pytest
import trimesh
from solver_scenes import grid_mesh, pad, shape

from palpate.core.errors import SensorError
from palpate.core.geometry.grid_layout import GridLayout
from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.geometry.texels import texels_from_region
from palpate.core.geometry.texture_maps import UVLayout


def test_the_paper_s_example_of_eight_rows_and_six_columns():
    """Section 3.1: a 7 × 5 grid of faces has 8 × 6 vertices, the centres of the tactile cells."""
    texels = pad(8, 6, 0.0034)
    assert len(texels) == 48
    assert isinstance(texels.layout, GridLayout)
    assert texels.layout.shape == (8, 6)
    np.testing.assert_array_equal(texels.normal, np.tile([0, 0, 1.0], (48, 1)))
    np.testing.assert_allclose(texels.tangent, np.tile([1.0, 0, 0], (48, 1)), atol=1e-15)
    np.testing.assert_allclose(texels.bitangent, np.tile([0, 1.0, 0], (48, 1)), atol=1e-15)
    assert texels.area.sum() == pytest.approx(7 * 5 * 0.0034**2, rel=1e-12)
    inner = texels.area.max()
    assert inner == pytest.approx(0.0034**2, rel=1e-12)


def test_frames_of_texels_on_a_sphere_are_right_handed_and_unit():
    mesh = shape(trimesh.creation.icosphere(3, 0.01))
    texels = texels_from_region(mesh, mesh.vertices[:, 2] > 0.003)
    for axes in (texels.normal, texels.tangent, texels.bitangent):
        np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(np.einsum("ij,ij->i", texels.normal, texels.tangent), 0, atol=1e-12)
    np.testing.assert_allclose(np.cross(texels.tangent, texels.bitangent), texels.normal, atol=1e-12)
    assert (np.einsum("ij,ij->i", texels.normal, texels.position) > 0.0099).all()
    assert isinstance(texels.layout, UVLayout)


def test_normals_come_from_all_adjoining_triangles_and_areas_from_the_region_alone():
    mesh = shape(trimesh.creation.box((1, 1, 1)))
    top = mesh.vertices[:, 2] > 0
    texels = texels_from_region(mesh, top)
    assert len(texels) == 4
    assert texels.area.sum() == pytest.approx(1.0, rel=1e-12)
    assert (np.abs(texels.normal[:, :2]) > 0.3).all()  # the sides lean into the corners' normals


@pytest.mark.parametrize(
    ("vertices", "words"), [([], "region of sensor 'tip' is empty"), ([0, 30, 60], "3 vertices of sensor 'tip' span no face")]
)
def test_a_region_without_texels_is_refused(vertices, words):
    mesh = grid_mesh()
    region = np.zeros(len(mesh.vertices), bool)
    region[vertices] = True
    with pytest.raises(SensorError, match=words):
        texels_from_region(mesh, region, "tip")


def test_stray_vertices_are_no_texels():
    mesh = grid_mesh(5, 4)
    loose = TriangleMesh(np.vstack([mesh.vertices, [[1.0, 1, 1]]]), mesh.triangles, mesh.quads)
    assert len(texels_from_region(loose, np.ones(21, bool))) == 20


def test_normals_that_cancel_are_pointed_at():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    mesh = TriangleMesh(vertices, np.array([[0, 1, 2], [0, 2, 1]]))
    with pytest.raises(SensorError, match="Vertex 0 of sensor 'leaf' has no normal"):
        texels_from_region(mesh, np.ones(3, bool), "leaf")
