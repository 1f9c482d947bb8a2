# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays and even patterns on surfaces, against what geometry says they must be."""

import math

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from solver_scenes import shape

from palpate.core.errors import SensorError
from palpate.core.geometry.mesh import TriangleMesh, checked_mesh, edge_defects, triangle_areas
from palpate.core.geometry.scattered_points import even_points, refined, scatter
from palpate.core.geometry.texel_arrays import (
    GeodesicTracer,
    filled_region,
    nearest_point,
    pad_array,
    region_middle,
    wrapped_array,
)
from palpate.core.geometry.texels import texels_from_region

PITCH = (0.0034, 0.0034)


def sheet(width=0.05, height=0.05, n=7, skew=0.0):
    """A flat sheet of uneven triangles in z = 0."""
    rng = np.random.default_rng(3)
    y, x = np.mgrid[0 : n + 1, 0 : n + 1] / n - 0.5
    inner = (np.abs(x) < 0.49) & (np.abs(y) < 0.49)
    x, y = x + inner * rng.uniform(-0.3, 0.3, x.shape) / n, y + inner * rng.uniform(-0.3, 0.3, x.shape) / n
    vertices = np.stack([x * width + skew * y, y * height, 0 * x], axis=-1).reshape(-1, 3)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = corner, corner + 1, corner + n + 2, corner + n + 1
    return checked_mesh(vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), "sheet")[0]


def tube(radius=0.01, length=0.06, sides=720):
    """The side of a cylinder about y."""
    angle = np.arange(sides) * 2 * np.pi / sides
    ring = np.stack([radius * np.sin(angle), 0 * angle, radius * np.cos(angle)], axis=1)
    vertices = np.concatenate([ring - [0, length / 2, 0], ring + [0, length / 2, 0]])
    i = np.arange(sides)
    j = (i + 1) % sides
    return checked_mesh(
        vertices, np.concatenate([np.stack([i, j, j + sides], 1), np.stack([i, j + sides, i + sides], 1)]), "t"
    )[0]


def dome(radius=0.01, cut=0.3, subdivisions=4):
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    keep = ball.triangles_center[:, 2] > cut * radius
    return checked_mesh(ball.vertices, ball.faces[keep], "dome")[0]


def as_mesh(skin):
    triangles = [t for f in skin.faces for t in ([f] if len(f) == 3 else [(f[0], f[1], f[2]), (f[0], f[2], f[3])])]
    quads = np.array([f for f in skin.faces if len(f) == 4], dtype=int).reshape(-1, 4)
    return checked_mesh(skin.vertices, np.array(triangles), "skin", quads)[0]


def texels(skin):
    return texels_from_region(as_mesh(skin), np.ones(len(skin.vertices), bool), "skin")


# --- walking


def test_a_walk_on_a_plane_is_straight_whatever_its_triangles():
    surface = GeodesicTracer(sheet())
    for degrees in range(0, 360, 15):
        heading = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0])
        end = surface.trace(surface.nearest_pose(np.array([0.001, 0.002, 0.0]), heading), 0.02)
        assert end.point == pytest.approx([0.001, 0.002, 0.0] + 0.02 * heading, abs=1e-12)
        assert end.heading == pytest.approx(heading, abs=1e-9)


def test_a_walk_on_a_cylinder_is_a_helix():
    radius = 0.01
    surface = GeodesicTracer(tube(radius))
    start = surface.nearest_pose(np.array([0.0, -0.02, radius]), np.array([1.0, 0.5, 0.0]))
    length = 0.08
    end = surface.trace(start, length)
    around, along = length * 2 / math.sqrt(5), length / math.sqrt(5)
    angle = around / radius  # once around and more
    expected = [radius * math.sin(angle), -0.02 + along, radius * math.cos(angle)]
    assert end.point == pytest.approx(expected, abs=2e-5 * angle)  # 720 sides: the polygon's perimeter is 3 ppm short


def test_a_walk_through_corners_does_not_get_lost():
    mesh = shape(trimesh.creation.icosphere(subdivisions=3, radius=1.0))
    surface = GeodesicTracer(mesh)
    for vertex in range(0, 60, 7):  # a great circle leads back to where it began, from a corner and through corners
        point = mesh.vertices[vertex]
        end = surface.trace(surface.nearest_pose(point, np.cross(point, [0.3, 0.2, 1.0])), 2 * math.pi)
        assert np.linalg.norm(end.point - point) < 0.15  # an edge: the polyhedron is not quite round


def test_a_walk_ends_at_the_rim():
    surface = GeodesicTracer(sheet())
    assert surface.trace(surface.nearest_pose(np.zeros(3), np.array([1.0, 0, 0])), 0.0251) is None


def test_nearest_point_is_trimesh_s():
    ball = trimesh.creation.icosphere(subdivisions=2)
    mesh = shape(ball)
    points = np.random.default_rng(0).uniform(-2, 2, (50, 3))
    expected, distance, _ = trimesh.proximity.closest_point(ball, points)
    for point, there, far in zip(points, expected, distance, strict=True):
        found, triangle = nearest_point(mesh, point)
        assert np.linalg.norm(found - point) == pytest.approx(far, abs=1e-12)
        assert found == pytest.approx(there, abs=1e-9)


# --- pads


@pytest.mark.parametrize("radius", [0.0, 0.008, -0.02])
def test_a_pad_is_a_grid_whose_texels_are_a_pitch_apart(radius):
    skin = pad_array(14, 6, PITCH, radius)
    found = texels(skin)
    assert (found.layout.rows, found.layout.columns) == (14, 6)
    table = np.empty((14, 6, 3))
    table[found.layout.row, found.layout.column] = found.position
    chord = 2 * abs(radius) * math.sin(PITCH[0] / 2 / abs(radius)) if radius else PITCH[0]
    assert np.linalg.norm(np.diff(table, axis=1), axis=2) == pytest.approx(chord, rel=1e-9)
    assert np.linalg.norm(np.diff(table, axis=0), axis=2) == pytest.approx(PITCH[1], rel=1e-9)
    if radius:
        axis = np.array([0.0, 1.0, 0.0])
        outward = found.position - [0, 0, -radius]
        outward -= (outward @ axis)[:, None] * axis
        outward *= np.sign(radius) / np.linalg.norm(outward, axis=1)[:, None]
        row, column = found.layout.row, found.layout.column
        inner = (column > 0) & (column < 5) & (row > 0) & (row < 13)
        assert found.normal[inner] == pytest.approx(outward[inner], abs=2e-3)
    else:
        assert found.normal == pytest.approx(np.tile([0, 0, 1.0], (84, 1)))
        assert found.position.mean(axis=0) == pytest.approx([0, 0, 0], abs=1e-15)


@pytest.mark.parametrize(("arguments", "text"), [((1, 6, PITCH), "no face"), ((14, 6, PITCH, 0.002), "more than once around")])
def test_a_pad_that_is_none_says_why(arguments, text):
    with pytest.raises(SensorError, match=text):
        pad_array(*arguments)


# --- arrays wrapped onto surfaces


@pytest.mark.parametrize("degrees", [0, 30, -45])
def test_wrapped_onto_a_plane_it_is_the_flat_pad(degrees):
    angle = math.radians(degrees)
    skin = wrapped_array(sheet(), 8, 6, (0.003, 0.004), angle=angle)
    flat = pad_array(8, 6, (0.003, 0.004)).vertices
    middle = skin.vertices.mean(axis=0)
    heading = region_middle(sheet()).heading
    own = math.atan2(-heading[0], heading[1])  # the sheet's own direction is not quite +y
    assert skin.vertices - middle == pytest.approx(Rotation.from_euler("z", angle + own).apply(flat), abs=1e-9)


def test_wrapped_onto_a_cylinder_it_is_the_bent_pad():
    radius = 0.01
    mesh = tube(radius)
    upper = mesh.vertices[mesh.triangles].mean(axis=1)[:, 2] > 0
    skin = wrapped_array(TriangleMesh(mesh.vertices, mesh.triangles[upper]), 14, 6, PITCH)
    expected = pad_array(14, 6, PITCH, radius).vertices + [0, 0, radius]
    assert skin.vertices == pytest.approx(expected, abs=3e-7)  # 720 sides: the sagitta is 1e-7 m
    found = texels(skin)
    assert (found.layout.rows, found.layout.columns) == (14, 6)
    assert (found.normal[:, 2] > 0).all()


def test_wrapped_onto_a_dome_every_texel_is_on_it_and_none_overlap():
    skin = wrapped_array(dome(), 6, 6, (0.002, 0.002))
    assert np.linalg.norm(skin.vertices, axis=1) == pytest.approx(0.01, rel=2e-3)
    found = texels(skin)
    assert (found.layout.rows, found.layout.columns) == (6, 6)
    assert np.einsum("ij,ij->i", found.normal, skin.vertices).min() > 0
    apart = np.linalg.norm(skin.vertices[:, None] - skin.vertices, axis=2) + np.eye(36)
    assert apart.min() > 0.0015


def test_an_array_beyond_its_region_says_what_to_do():
    with pytest.raises(SensorError, match="beyond the region: use fewer texels"):
        wrapped_array(sheet(), 20, 6, PITCH)


# --- even spacing


@pytest.mark.parametrize("surface", ["sheet", "dome", "tube"])
def test_rows_at_a_spacing_cover_the_region(surface):
    mesh, spacing = {"sheet": sheet, "dome": dome, "tube": tube}[surface](), 0.0015
    skin = filled_region(mesh, spacing)
    patch = as_mesh(skin)
    assert edge_defects(patch.triangles)[1:] == (0, 0)
    covered = triangle_areas(patch).sum() / triangle_areas(mesh).sum()
    assert (0.85 if surface != "dome" else 0.75) < covered <= 1.0
    apart = np.linalg.norm(skin.vertices[:, None] - skin.vertices, axis=2) + np.eye(len(skin.vertices))
    assert apart.min() > 0.49 * spacing
    assert np.median(apart.min(axis=1)) == pytest.approx(spacing, rel=0.2)


@pytest.mark.slow("statistics of hundreds of texels")
@pytest.mark.parametrize(("surface", "spacing"), [("sheet", 0.003), ("dome", 0.0015), ("dome", 0.003)])
def test_scattered_texels_are_even_in_distance_and_in_area(surface, spacing):
    mesh = {"sheet": sheet, "dome": dome}[surface]()
    skin = scatter(mesh, spacing)
    patch = as_mesh(skin)
    assert edge_defects(patch.triangles)[1:] == (0, 0)
    nearest = (np.linalg.norm(skin.vertices[:, None] - skin.vertices, axis=2) + np.eye(len(skin.vertices))).min(axis=1)
    assert nearest.mean() == pytest.approx(spacing, rel=0.12)
    assert nearest.min() > 0.6 * spacing  # independent random points come arbitrarily near
    count = triangle_areas(mesh).sum() / (0.87 * spacing**2)
    assert len(skin.vertices) == pytest.approx(count, rel=0.15)
    assert triangle_areas(patch).sum() > 0.7 * triangle_areas(mesh).sum()
    if surface == "dome":
        assert np.linalg.norm(skin.vertices, axis=1) == pytest.approx(0.01, rel=2e-3)
        assert (texels(skin).normal * skin.vertices).sum(axis=1).min() > 0  # wound like the surface


def test_a_seed_is_a_pattern_and_the_mesh_s_own_triangles_do_not_show():
    one, two, other = scatter(sheet(), 0.006, 1), scatter(sheet(), 0.006, 1), scatter(sheet(), 0.006, 2)
    assert np.array_equal(one.vertices, two.vertices)
    assert one.faces == two.faces
    assert len(one.vertices) != len(other.vertices) or np.abs(one.vertices - other.vertices).max() > 1e-4


def test_points_on_a_box_are_spread_evenly():
    """Six rounds of Lloyd's algorithm leave two points at 0.56 of the mean spacing, twenty at 0.68."""
    solid = trimesh.creation.box((0.03, 0.02, 0.01)).subdivide().subdivide().subdivide()
    points = even_points(shape(solid), 300).position
    spacing = cKDTree(points).query(points, 2)[0][:, 1]
    assert spacing.min() > 0.65 * spacing.mean()


def test_refining_keeps_the_surface():
    fine = refined(dome(subdivisions=2), 0.0005)
    corners = fine.vertices[fine.triangles]
    assert max(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).ravel()) <= 0.0005
    assert triangle_areas(fine).sum() == pytest.approx(triangle_areas(dome(subdivisions=2)).sum(), rel=1e-12)
    assert edge_defects(fine.triangles)[1:] == (0, 0)
    assert edge_defects(fine.triangles)[0] > edge_defects(dome(subdivisions=2).triangles)[0]


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: scatter(sheet(), 0.2), "use a smaller spacing"),
        (lambda: filled_region(sheet(), 0.2), "use a smaller spacing"),
        (lambda: scatter(sheet(), 0.00001), "give a larger one"),
        (lambda: scatter(sheet(), 0.0), "above zero"),
        (lambda: filled_region(sheet(), -1.0), "above zero"),
    ],
)
def test_spacings_that_cannot_be_say_what_to_do(call, text):
    with pytest.raises(SensorError, match=text):
        call()
