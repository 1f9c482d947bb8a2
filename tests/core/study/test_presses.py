# SPDX-License-Identifier: GPL-3.0-or-later
"""A press goes where it is told: place, depth, tilt, slide and twist."""

import math
from dataclasses import replace

import numpy as np
import pytest
from solver_scenes import about
from study_scenes import BALL_RADIUS, tiny_scene

from palpate.core.errors import PalpateError
from palpate.core.geometry.rotations import rotation_matrices
from palpate.core.model.body import Motion
from palpate.core.solver.simulation import poses_at
from palpate.core.study.presses import Press, place_of, with_press


def deepest_pose(press, scene=None):
    """Position and rotation of the ball when the press has arrived."""
    motion = with_press(scene or tiny_scene(), press).bodies[1].motion
    arrived = np.array([(press.depth + press.clearance) / press.speed])
    position, quaternion = poses_at(motion, arrived, "linear")
    return position[0], rotation_matrices(quaternion)[0]


@pytest.mark.parametrize("place", [0.0, 0.3, 0.999, 1.0])
def test_the_lowest_point_is_as_deep_as_asked(place):
    press = Press("Pad", "Ball", place=place, depth=1.5e-3, tilt=0.4, tilt_direction=2.0)
    position, rotation = deepest_pose(press)
    lowest = position - BALL_RADIUS * rotation[:, 2]
    np.testing.assert_allclose(place_of(tiny_scene(), press) - lowest, 1.5e-3 * rotation[:, 2], atol=1e-12)
    assert rotation[2, 2] == pytest.approx(math.cos(0.4))  # the pad's normal is z


def test_places_follow_the_area():
    scene, texels = tiny_scene(), tiny_scene().sensors[0].texels
    shares = (np.arange(2000) + 0.5) / 2000
    places = np.array([place_of(scene, Press("Pad", "Ball", place=share)) for share in shares])
    nearest = np.linalg.norm(places[:, None] - texels.position, axis=2).argmin(axis=1)
    found = np.bincount(nearest, minlength=len(texels)) / len(shares)
    np.testing.assert_allclose(found, texels.area / texels.area.sum(), atol=1e-3)


def test_a_turned_and_moved_sensor_is_pressed_in_its_own_frame():
    scene, press = tiny_scene(), Press("Pad", "Ball", place=0.2)
    pose = Motion.at_rest((0.1, 0.2, 0.3), about((1, 0, 0), 90))
    moved = replace(scene, bodies=(replace(scene.bodies[0], motion=pose), scene.bodies[1]))
    plain, turned = deepest_pose(press)[0], deepest_pose(press, moved)[0]
    expected = rotation_matrices(pose.quaternions)[0] @ plain + pose.positions[0]
    np.testing.assert_allclose(turned, expected, atol=1e-12)


def test_it_slides_and_twists_and_goes_back():
    press = Press("Pad", "Ball", slide=2e-3, slide_direction=math.pi / 2, twist=3.0)
    scene = with_press(tiny_scene(), press)
    motion = scene.bodies[1].motion
    np.testing.assert_allclose((motion.positions[-1] - motion.positions[0])[:2], [0.0, 2e-3], atol=1e-12)
    assert motion.positions[-1, 2] == pytest.approx(motion.positions[0, 2])
    first, last = rotation_matrices(motion.quaternions)[[0, -1]]
    assert math.acos((np.trace(first.T @ last) - 1) / 2) == pytest.approx(3.0)
    assert (scene.frame_end - scene.frame_start) / scene.fps >= motion.times[-1] - 1e-9


def test_what_cannot_press_is_refused():
    scene = tiny_scene()
    with pytest.raises(PalpateError, match="There is no sensor 'Pda'"):
        with_press(scene, Press("Pda", "Ball"))
    with pytest.raises(PalpateError, match="depth of the press is -1"):
        with_press(scene, Press("Pad", "Ball", depth=-1.0))
    moving = Motion(np.array([0.0, 1.0]), np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.tile([1.0, 0, 0, 0], (2, 1)))
    moved = replace(scene, bodies=(replace(scene.bodies[0], motion=moving), scene.bodies[1]))
    with pytest.raises(PalpateError, match="moves: a press needs a sensor that rests"):
        with_press(moved, Press("Pad", "Ball"))
