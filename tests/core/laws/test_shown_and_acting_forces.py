# SPDX-License-Identifier: GPL-3.0-or-later
"""The force that texels show and the force that moves bodies come from different functions of the law, and must be equal."""

import pytest
from solver_scenes import GRAVITY, cube_on_pad

from palpate.core.model.parameter import Parameter
from palpate.core.model.sensor_parameters import CONTACT, NORMAL_LAWS, SENSOR_PARAMETERS
from palpate.core.solver.simulation import run

MASS = 0.1
CHANGED = {
    name: 1.2 * item.default or 1e-3
    for name, item in SENSOR_PARAMETERS.items()
    if isinstance(item, Parameter) and item.group == CONTACT
}
"""A value of every number of the contact law that is not its default, so that a new parameter takes part."""


@pytest.mark.parametrize("law", [law.value for law in NORMAL_LAWS])
def test_the_texels_of_a_body_at_rest_show_its_weight(law):
    values = {**CHANGED, "k": 2e4, "cn": 20.0, "dissipation": 5.0}
    recording = run(cube_on_pad(MASS, normal_law=law, frames=48, dt=1e-3, **values))
    assert abs(recording.velocities[-1, 1]).max() < 1e-6
    assert recording.sensors["pad"].normal_force[-1].sum() == pytest.approx(MASS * GRAVITY, rel=1e-6)
