# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sample scene gains from the recommended step is what the panel says of it."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from blender_scenes import scenario_of

from palpate.core.solver import time_step_adviser
from palpate.core.solver.simulation import run


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
