# SPDX-License-Identifier: GPL-3.0-or-later
"""Spheres, boxes, capsules and planes on a pad: closed forms, the same as meshes, and the same bits one by one and together."""

from __future__ import annotations

import numpy as np
import pytest
from exported_sensors import pad
from pressed_poses import DT, LEVEL, SIZE, assert_environments_are_singles, pose, random_poses
from scipy.spatial.transform import Rotation
from solver_scenes import box

from palpate.core.geometry import shapes
from palpate.core.simulators.pressed_sensor import PressedSensor
from palpate.core.simulators.pressed_sensors import PressedSensors

SHAPES = {
    "sphere": (shapes.sphere(SIZE / 2), SIZE / 2),
    "box": (shapes.box((SIZE, SIZE, SIZE)), SIZE / 2),
    "capsule": (shapes.capsule(SIZE / 2, SIZE / 2), 0.75 * SIZE),
    "plane": (shapes.plane(), 0.0),
}
K = 1000.0
DEPTH = 5e-4


def turned(name, quaternion):
    """Turn a plane's frame half about its x axis, so that the plane faces the pad."""
    return quaternion[..., [1, 0, 3, 2]] * [-1.0, 1.0, 1.0, -1.0] if name == "plane" else quaternion


def at_rest(shape, where, turn=(0.0, 0.0, 0.0)):
    """What a pad measures when a shape has stood at a height for two steps, and the texels' places."""
    item, quaternion = pad(9, 7), np.roll(Rotation.from_rotvec(turn).as_quat(), 1)
    pressed = PressedSensor(item, shape, DT, pose(LEVEL), (where, quaternion))
    pressed.step(pose(LEVEL), (where, quaternion))
    return pressed.step(pose(LEVEL), (where, quaternion)), item.sensor.texels.position, pressed


def test_a_sphere_presses_by_its_depth_along_its_normals():
    """Each texel under a sphere is pressed by the cap's height there, which counts along the sphere's normal."""
    radius = 0.03
    contact, texels, _ = at_rest(shapes.sphere(radius), [0.0, 0.0, radius - DEPTH])
    square = radius**2 - texels[:, 0] ** 2 - texels[:, 1] ** 2
    height = np.sqrt(square) - (radius - DEPTH)
    expected = np.where(height > 0.0, K * height * np.sqrt(square) / radius, 0.0)
    assert contact.texels.normal_force == pytest.approx(expected, abs=1e-11)
    assert (expected > 0.0).sum() > 5
    slopes = K * height * np.sqrt(square) / radius * np.sqrt(square) / radius
    assert contact.force_on_target[2] == pytest.approx(slopes[height > 0.0].sum(), abs=1e-11)


def test_a_capsule_that_lies_presses_as_a_cylinder():
    """Along the whole pad, which is shorter than the capsule's axis."""
    radius = 0.01
    contact, texels, _ = at_rest(shapes.capsule(radius, 0.2), [0.0, 0.0, radius - DEPTH], [np.pi / 2, 0.0, 0.0])
    square = radius**2 - texels[:, 0] ** 2
    height = np.sqrt(np.maximum(square, 0.0)) - (radius - DEPTH)
    expected = np.where(height > 0.0, K * height * np.sqrt(np.maximum(square, 0.0)) / radius, 0.0)
    assert contact.texels.normal_force == pytest.approx(expected, abs=1e-11)
    assert (expected > 0.0).sum() == 9


def test_a_leaning_plane_presses_by_its_depth():
    """The plane's normal leads down to the pad and leans by 1°, so that one end of the pad is not pressed."""
    lean = np.radians(1.0)
    contact, texels, _ = at_rest(shapes.plane(), [0.0, 0.0, -5e-5], [np.pi + lean, 0.0, 0.0])
    depth = 5e-5 - np.tan(lean) * texels[:, 1]
    assert contact.texels.normal_force == pytest.approx(np.where(depth > 0.0, K * depth * np.cos(lean), 0.0), abs=1e-11)
    assert 0 < (depth > 0.0).sum() < len(depth)


def test_a_box_gives_the_numbers_of_its_mesh():
    """Also where it slides and leans; within 1e-9 of the largest force, for another order of the arithmetic."""
    item, lit = pad(9, 7), 0
    for seed in range(4):
        poses = random_poses(seed, 6, 1)[:, 0]
        both = [PressedSensor(item, one, DT, *map(pose, poses[0])) for one in (SHAPES["box"][0], box(SIZE, SIZE, SIZE))]
        for now in poses:
            shape, mesh = (one.step(*map(pose, now)) for one in both)
            for name in ("normal_force", "shear", "depth", "slip"):
                largest = max(np.abs(getattr(mesh.texels, name)).max(), 1e-3)
                assert getattr(shape.texels, name) == pytest.approx(getattr(mesh.texels, name), abs=1e-9 * largest), name
            assert np.array_equal(shape.texels.contact, mesh.texels.contact)
            lit += shape.texels.contact.sum()
    assert lit > 100


@pytest.mark.parametrize("shape", [shapes.box((0.1, 0.1, 1.0)), shapes.sphere(0.5)])
def test_a_pad_in_parts_has_the_same_bits_with_two_threads(shape):
    """A large pad is divided among threads; each part has blocks of its own, the last one not full."""
    item, where = pad(41, 37), np.array([1e-3, 0.0, 0.5 - DEPTH])
    one, two = (PressedSensor(item, shape, DT, pose(LEVEL), (where, LEVEL[3:]), threads) for threads in (1, 2))
    assert one._model._model.pairs.sensor.size > 1
    for step in range(1, 4):
        now = where + [2e-4 * step, 0.0, 0.0], LEVEL[3:]
        first, second = one.step(pose(LEVEL), now), two.step(pose(LEVEL), now)
        for field in ("normal_force", "shear", "depth", "slip", "contact"):
            assert np.array_equal(getattr(first.texels, field), getattr(second.texels, field)), field
        assert np.array_equal(first.force_on_target, second.force_on_target)
    assert first.texels.normal_force.sum() == pytest.approx(first.force_on_target[2], rel=0.05)
    assert 10 < first.texels.contact.sum() < len(first.texels.contact)


@pytest.mark.parametrize("name", SHAPES)
def test_environments_have_the_bits_of_single_sensors(name):
    shape, height = SHAPES[name]
    item, poses = pad(5, 4), random_poses(7, 5, 6, height=height - DEPTH)
    poses[:, :, 1, 0] *= 0.3
    poses[:, :, 1, 3:] = turned(name, poses[:, :, 1, 3:])
    singles = [PressedSensor(item, shape, DT, *map(pose, one)) for one in poses[0]]
    assert assert_environments_are_singles(PressedSensors(item, shape, DT, 6, 2), singles, poses) > 20


@pytest.mark.parametrize("name", [*SHAPES, "mesh"])
def test_contacts_that_are_known_have_the_bits_of_contacts_that_are_found(name):
    """A step begins with the contacts that the step before ended with; finding them again changes nothing."""
    shape, height = SHAPES.get(name, (box(SIZE, SIZE, SIZE), SIZE / 2))
    item, lit = pad(5, 4), 0
    poses = random_poses(9, 8, 1, height=height - DEPTH)[:, 0]
    poses[:, 1, 0] *= 0.3
    poses[:, 1, 3:] = turned(name, poses[:, 1, 3:])
    knows, finds = (PressedSensor(item, shape, DT, *map(pose, poses[0])) for _ in range(2))
    for now in poses:
        finds._environments[0].found[0] = False
        one, other = knows.step(*map(pose, now)), finds.step(*map(pose, now))
        for field in ("normal_force", "shear", "depth", "slip", "contact"):
            assert np.array_equal(getattr(one.texels, field), getattr(other.texels, field)), field
        assert np.array_equal(one.torque_on_target, other.torque_on_target)
        lit += one.texels.contact.sum()
    assert lit > 10


def test_points_that_begin_inside_are_too_deep():
    _, texels, pressed = at_rest(shapes.plane(), [0.0, 0.0, -7e-3], [np.pi, 0.0, 0.0])
    assert pressed.too_deep == len(texels)
    contact, _, pressed = at_rest(shapes.plane(), [0.0, 0.0, 1e-3], [np.pi, 0.0, 0.0])
    assert pressed.too_deep == 0
    assert not contact.texels.contact.any()
