# SPDX-License-Identifier: GPL-3.0-or-later
"""The hand of the sample scene: a closed skin without gaps to the fingers that feel, which it follows."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from blender_scenes import scenario_of

from palpate.core.solver import time_step_adviser
from palpate.core.solver.simulation import run
from palpate.sample_blends import hand


@pytest.mark.long("models a hand")
def test_the_skin_follows_the_fingers_and_stays_at_the_wrist(scene):
    index, thumb, _ = hand.bodies(scene)
    skin = scene.objects["Hand"]

    def shape() -> np.ndarray:
        found = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return np.array([v.co for v in found.data.vertices])

    before = shape()
    assert before == pytest.approx(np.array([v.co for v in skin.data.vertices]), abs=1e-4)  # nothing moves at first
    index.location.x -= 5.0
    bpy.context.view_layer.update()
    moved = before[:, 0] - shape()[:, 0]
    # where the finger's own mesh begins it moves as the finger does, so that no gap opens
    root = np.array([index.matrix_world @ v.co for v in index.data.vertices])[: 28 * 3] + (5.0, 0.0, 0.0)
    near = np.linalg.norm(before[:, None] - root, axis=2).min(axis=1) < 2.0
    assert near.sum() > 50 and moved[near].min() > 4.9
    assert np.abs(moved[before[:, 1] > 120.0]).max() < 1e-4
    assert np.abs(moved[np.linalg.norm(before - np.array(thumb.location), axis=1) < 60.0]).max() < 1e-4


@pytest.mark.long("steps of 0.02 to 0.04 ms")
def test_what_the_recommended_step_buys_is_as_the_panel_says(repository):
    bpy.ops.wm.open_mainfile(filepath=str(repository / "sample_blends" / "grasp_bottle.blend"))
    scenario = scenario_of(bpy.context.scene)
    advice = time_step_adviser.advise(scenario)
    assert 10.0 < scenario.dt / advice.dt < 25.0
    set_, fine = run(scenario), run(replace(scenario, dt=None))
    for sensor, expected in fine.sensors.items():
        force, found = expected.normal_force, set_.sensors[sensor].normal_force
        assert np.abs(found.sum(axis=1) - force.sum(axis=1)).max() < time_step_adviser.SUM_ERROR * force.sum(axis=1).max()
        assert np.abs(found - force).max() < time_step_adviser.TEXEL_ERROR * force.max()
    words = time_step_adviser.benefit(scenario.dt, advice)
    assert "sums of forces changed by 0.2%, texels by 2% at most" in words
    assert time_step_adviser.benefit(advice.dt, advice) == ""
