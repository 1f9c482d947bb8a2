# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene from a millionth to a thousand times its size gives the same dimensionless result: no length is built in.

The iterations of a step end at 1e-9 of a velocity in which metres and radians are added, so runs of different size may end one
iteration apart; contacts that slide add up a few of these. All other differences are rounding. The largest that was seen over
these sizes is 6e-9.
"""

import numpy as np
import pytest
import trimesh
from oracles.similarity import difference, rescaled
from solver_scenes import cube_on_pad, pressed, shape

from palpate.core.geometry.mesh import TriangleMesh, checked_mesh, mass_properties
from palpate.core.geometry.texels import texels_from_region
from palpate.core.model.sensor_parameters import HUNT_CROSSLEY
from palpate.core.solver.simulation import run

SIZES = tuple(10.0**power for power in (-6, -4, -2, -1, 1, 2, 3))
TOLERANCE = 1e-7


def rolled():
    """A ball that is pressed 4 mm deep and moved sideways."""
    path = np.zeros((12, 3))
    path[:, 0], path[:, 2] = np.linspace(0.0, 0.003, 12), 0.021 - np.linspace(0.0, 0.004, 12)
    return pressed(shape(trimesh.creation.icosphere(2, 0.02)), path, points_per_texel=4)


SCENES = {
    "falls": lambda: cube_on_pad(frames=8, dt=1e-3),
    "slides": lambda: cube_on_pad(frames=8, tilt=15.0, dt=1e-3, mus=0.2, mud=0.15, sigma0=1e3, sigma1=10.0),
    "hunt-crossley": lambda: cube_on_pad(
        frames=8, tilt=15.0, dt=1e-3, normal_law=HUNT_CROSSLEY, k=2e4, dissipation=0.2, gap=2e-3
    ),
    "pressed": rolled,
}


@pytest.mark.parametrize("name", SCENES)
def test_the_result_is_the_same_at_every_size(name):
    scene = SCENES[name]()
    expected = run(scene)
    assert max(sensor.normal_force.max() for sensor in expected.sensors.values()) > 0.01
    for size in SIZES:
        found = run(rescaled(scene, size))
        assert difference(expected, found, size) < TOLERANCE, size


@pytest.mark.parametrize(
    ("mass", "time"), [(3.0, 0.0), (3.0, 0.5), (3.0, 1.0)], ids=["heavy", "gravity kept", "stiffness kept"]
)
def test_masses_and_times_may_change_with_the_size(mass, time):
    """Volumes weigh the same, and times stay, or follow from the same gravity, or from the same speed of sound."""
    scene = SCENES["slides"]()
    expected = run(scene)
    for size in (1e-6, 1e-3, 1e3):
        found = run(rescaled(scene, size, size**mass, size**time))
        assert difference(expected, found, size, size**mass, size**time) < TOLERANCE, size


@pytest.mark.parametrize("size", SIZES)
def test_mass_properties_and_texels_have_no_built_in_length(size):
    solid = trimesh.creation.cone(0.02, 0.05, sections=12)
    mesh, _ = checked_mesh(solid.vertices, solid.faces, "cone")
    other, _ = checked_mesh(size * mesh.vertices, mesh.triangles, "cone")
    for expected, found, unit in zip(
        mass_properties(mesh, 0.3, "cone"), mass_properties(other, 0.3, "cone"), (1, 2, 0), strict=True
    ):
        if unit:
            assert np.abs(found / size**unit - expected).max() <= 1e-12 * np.abs(expected).max()
        else:
            assert found == expected
    region = mesh.vertices[:, 2] > -1.0
    texels, same = (
        texels_from_region(mesh, region, "cone"),
        texels_from_region(TriangleMesh(other.vertices, other.triangles), region, "cone"),
    )
    np.testing.assert_allclose(same.normal, texels.normal, rtol=0, atol=1e-12)
    np.testing.assert_allclose(same.tangent, texels.tangent, rtol=0, atol=1e-9)
    np.testing.assert_allclose(same.area / size**2, texels.area, rtol=1e-9)
