# SPDX-License-Identifier: GPL-3.0-or-later
"""Several contact points per texel: where they lie, and that forces come nearer to the closed forms."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from solver_scenes import GRAVITY, about, box, cube_on_pad, grid_mesh, pad, pressed, shape

from palpate.core.errors import ParameterError
from palpate.core.geometry.contact_points import contact_points
from palpate.core.geometry.grid_layout import GridLayout
from palpate.core.geometry.texels import texels_from_region
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.simulation import run


@pytest.mark.parametrize("across", [2, 3, 5])
def test_in_a_grid_they_form_a_finer_grid(across):
    texels = pad(4, 3, 0.01)
    points = contact_points(texels, across**2)
    found = points.positions(texels.position)
    y, x = np.meshgrid(
        (np.arange(4 * across) + 0.5) / across * 0.01 - 0.02, (np.arange(3 * across) + 0.5) / across * 0.01 - 0.015
    )
    expected = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    order, wanted = np.lexsort(found.T.round(9)), np.lexsort(expected.T.round(9))
    np.testing.assert_allclose(found[order], expected[wanted], atol=1e-15)
    mean = found.reshape(len(texels), -1, 3).mean(axis=1)
    np.testing.assert_allclose(mean, texels.position, atol=1e-15)


def hexagons(rings=6):
    """A region of equilateral triangles that is no grid, with one texel in the middle."""
    i, j = np.mgrid[-rings : rings + 1, -rings : rings + 1]
    inside = np.abs(i + j) <= rings
    i, j = i[inside], j[inside]
    vertices = 0.01 * np.stack([i + 0.5 * j, np.sqrt(0.75) * j, 0 * i], axis=1)
    number = {place: k for k, place in enumerate(zip(i.tolist(), j.tolist(), strict=True))}
    triangles = []
    for a, b in number:
        for corners in ([(a, b), (a + 1, b), (a, b + 1)], [(a + 1, b), (a + 1, b + 1), (a, b + 1)]):
            if all(corner in number for corner in corners):
                triangles.append([number[corner] for corner in corners])
    mesh = replace(grid_mesh(), vertices=vertices, triangles=np.array(triangles), quads=None)
    return texels_from_region(mesh, np.ones(len(vertices), bool), "honeycomb")


@pytest.mark.parametrize("across", [2, 3, 4, 6])
def test_elsewhere_they_fill_the_barycentric_cell(across):
    """In the middle of a hexagon their centre is the vertex; their second moment tends to that of the cell.

    The cell is a hexagon of the side s = pitch / √3, turned by 30°, of second moment 5 √3/16 s⁴ over its area 3 √3/2 s².
    """
    texels = hexagons()
    assert not isinstance(texels.layout, GridLayout)
    points = contact_points(texels, across**2)
    assert points.weight.sum(axis=1) == pytest.approx(1.0)
    assert (points.weight >= 0).all()
    middle = int(np.linalg.norm(texels.position, axis=1).argmin())
    own = points.positions(texels.position)[points.texel == middle]
    assert len(own) == across**2
    if 6 % across == 0 or across == 4:
        np.testing.assert_allclose(own.mean(axis=0), 0.0, atol=1e-3 * 0.01)
    expected = 5 / 24 * (0.01 / np.sqrt(3)) ** 2
    assert (own**2).sum(axis=1).mean() / 2 == pytest.approx(expected, rel=0.1)


def test_on_a_sphere_they_lie_on_its_triangles_and_look_outwards():
    mesh = shape(trimesh.creation.icosphere(2, 0.02))
    texels = texels_from_region(mesh, mesh.vertices[:, 2] > 0.0, "dome")
    points = contact_points(texels, 9)
    position, normal = points.positions(texels.position), points.normals(texels.normal)
    _, distance, _ = trimesh.proximity.closest_point(trimesh.Trimesh(mesh.vertices, mesh.triangles), position)
    assert distance.max() < 1e-12
    outward = position / np.linalg.norm(position, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", outward, normal).min() > 0.98
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize("count", [1, 4, 9])
def test_the_weight_stays_the_weight(count):
    sensor = run(cube_on_pad(1.0, points_per_texel=count, dt=1e-3)).sensors["pad"]
    assert sensor.normal_force[-1].sum() == pytest.approx(GRAVITY, rel=1e-9)
    np.testing.assert_allclose(sensor.depth[-1], GRAVITY / 84e3, rtol=1e-9)
    assert sensor.contact[-1].all()


def test_the_force_of_a_ball_comes_nearer_to_the_elastic_foundation():
    """A ball on springs of stiffness K per area, with the depth of Eq. 4, which is perpendicular to the ball.

    With s the vertical depth and c the cosine of the slope, a texel gives k s c along the slope's normal, s c² k vertically:
    F = K ∫ s c² dA, integrated numerically. Means over 20 places of the ball; the error falls with the number of points.
    """
    radius, depth, pitch, k = 0.02, 1e-3, 0.0034, 50.0
    ball = shape(trimesh.creation.icosphere(6, radius))
    r = np.linspace(0, radius, 200001)
    s = np.maximum(np.sqrt(radius**2 - r**2) - (radius - depth), 0.0)
    expected = k / pitch**2 * np.sum(s * (1 - (r / radius) ** 2) * 2 * np.pi * r) * r[1]
    rng = np.random.default_rng(1)
    places = np.column_stack([rng.uniform(-0.5, 0.5, (20, 2)) * pitch, np.full(20, radius - depth)])
    errors = []
    for count in (1, 4, 9):
        values = {"points_per_texel": count, "k": k, "cn": 0.0, "mus": 0.0, "mud": 0.0}
        sensor = run(pressed(ball, places, texels=pad(7, 7, pitch), **values)).sensors["pad"]
        errors.append(np.abs(-sensor.net_force[:, 2] / expected - 1).mean())
    assert errors[1] < 0.4 * errors[0]
    assert errors[2] < 0.5 * errors[1]
    assert errors[2] < 0.01


def test_one_texel_of_many_points_holds_against_twisting():
    """A plate that turns on it slides with the torque µ F times the mean distance of a square from its middle, 0.3826 a."""
    values = {"k": 100.0, "mus": 0.5, "mud": 0.5, "sigma0": 1e5, "sigma1": 0.0, "ct": 0.0, "cn": 0.0}
    turns = [about((0, 0, 1), 4.0 * i) for i in range(6)]
    pitch, torque = 0.01, {}
    for count in (1, 100):
        scenario = pressed(
            box(0.1, 0.1, 0.02), [[0, 0, 0.009]] * 6, texels=pad(2, 2, pitch), turns=turns, **values, points_per_texel=count
        )
        # The pad is 2 × 2 texels, so a square of twice the pitch.
        torque[count] = abs(run(scenario).sensors["pad"].net_torque[-1, 2])
    load = 4 * 100.0 * 1e-3
    assert torque[100] == pytest.approx(0.5 * load * 0.382598 * 2 * pitch, rel=1e-3)
    assert torque[1] == pytest.approx(0.5 * load * np.sqrt(0.5) * pitch, rel=1e-6)  # four points at the texels' middles


@pytest.mark.parametrize("count", [0, 2, 8, 10000])
def test_other_numbers_are_refused(count):
    with pytest.raises(ParameterError, match="points_per_texel of sensor 'pad'"):
        SensorParameters(points_per_texel=count).check("pad")
