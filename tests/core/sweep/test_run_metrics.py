# SPDX-License-Identifier: GPL-3.0-or-later
"""Metrics of whole runs: what is held, what falls and how far, and the force of a press that asks for one."""

from dataclasses import replace

import numpy as np
import pytest
from solver_scenes import box, gripper, smooth_path
from study_scenes import tiny_scene

from palpate.core.solver.simulation import run
from palpate.core.study.presses import Press, place_of, with_press
from palpate.sweep.worker import metrics_of

GRAVITY = 9.81
FPS, LIFT = 24.0, 0.02


def grasp(force: float, mus: float):
    """Fingers that close on a cube of 50 g and lift it by 20 mm in a second."""
    heights = 0.0125 + smooth_path((0.2, 0.0), (0.6, LIFT), fps=FPS, end=0.8)
    return gripper(box(0.025, 0.025, 0.025), 0.05, force, heights, fps=FPS, opening=0.027, mus=mus, mud=0.8 * mus)


def test_a_lifted_object_is_held_and_has_not_fallen():
    scenario = grasp(force=3.0, mus=0.6)
    found = metrics_of(scenario, run(scenario))
    assert found["object.held"] == 1.0
    assert found["object.fall"] == pytest.approx(-LIFT, abs=2e-3)  # it creeps a little in the pads


def test_what_slips_out_of_the_fingers_is_not_held():
    scenario = grasp(force=0.3, mus=0.05)  # 2 × 0.05 × 0.3 N carry far less than 0.5 N
    found = metrics_of(scenario, run(scenario))
    assert found["object.fall"] == pytest.approx(0.0, abs=2e-3)  # the fingers have gone up without it


def test_free_fall():
    """From rest, half of g t² along gravity, whatever its direction; nothing is near it in the end."""
    scene = replace(tiny_scene(with_box=True), gravity=np.array([GRAVITY, 0.0, 0.0]), frame_end=11)
    bodies = [
        replace(body, motion=replace(body.motion, positions=body.motion.positions + [0, 0, 0.1])) for body in scene.bodies
    ]
    scene = replace(scene, bodies=(scene.bodies[0], *bodies[1:]))
    found = metrics_of(scene, run(scene))
    seconds = (scene.frame_end - scene.frame_start) / scene.fps
    assert found["Box.fall"] == pytest.approx(0.5 * GRAVITY * seconds**2, rel=0.01)  # the step's share of the last velocity
    assert found["Box.held"] == 0.0
    assert "Ball.fall" not in found, "it is no free body"


@pytest.mark.parametrize(("k", "force"), [(58.5, 0.05), (58.5, 0.4), (1000.0, 5.0), (10000.0, 0.05)])
@pytest.mark.parametrize("gravity", [0.0, GRAVITY])
def test_a_press_with_a_force_reaches_it(k, force, gravity):
    """The drive holds the sum of normal forces that was asked for, at the place that was asked for, on soft and stiff foam."""
    scene = replace(tiny_scene(), gravity=np.array([0.0, 0.0, -gravity]))
    pad = replace(scene.sensors[0], parameters=replace(scene.sensors[0].parameters, k=k, cn=0.01 * k))
    scene = replace(scene, sensors=(pad,))
    press = Press("Pad", "Ball", place=0.45, force=force, hold=0.2)
    scenario = with_press(scene, press)
    recording = run(scenario)
    measured = recording.sensors["Pad"].normal_force
    assert measured[-1].sum() == pytest.approx(force, rel=0.05)  # what the drive still swings after 0.5 s
    assert metrics_of(scenario, recording, press)["end_normal_force"] == measured[-1].sum()
    np.testing.assert_allclose(recording.poses[-1, 1, :2], place_of(scene, press)[:2], atol=1e-4)
