# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes of earlier versions stay valid: a scenario that did not change keeps its digest."""

import numpy as np

from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.geometry.texels import Texels
from palpate.core.model.body import Body, Drive, Motion, Signal
from palpate.core.model.scenario import Scenario, Target
from palpate.core.model.sensor import Deformation, Effect, Sensor
from palpate.core.model.sensor_parameters import Painted, SensorParameters

# What the first version of Palpate computed for the scenario below.
DIGEST = "ede2bd2bc351b7a9d618617ee0a397d3557b2972a6fa745e28394d5d31d99d88"


def test_a_scenario_keeps_its_digest():
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    mesh = TriangleMesh(corners, np.array([[0, 1, 2]]))
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    texels = Texels(np.arange(3), corners, up, np.tile([1.0, 0.0, 0.0], (3, 1)), np.full(3, 1e-5), None)
    carrier = Motion.at_rest()
    bodies = (
        Body("pad", carrier),
        Body("ball", Motion.at_rest((0.0, 0.0, 1.0)), free=True),
        Body("finger", carrier, drive=Drive("force", Signal.constant(2.0), sensor=0)),
    )
    parameters = SensorParameters(normal_law="hunt-crossley", points_per_texel=4, unit="V")
    effects = (Effect("creep", "exponential", {"amount": 0.2, "time": 1.5}), Effect("noise", "white", {}, 3))
    painted = Painted(k=np.array([1.0, 2.0, 0.5]))
    bent = Deformation(np.zeros(1), np.zeros((1, 3, 9)))
    sensors = (Sensor("pad", 0, texels, parameters, painted=painted, deformation=bent, effects=effects),)
    scenario = Scenario(bodies, sensors, (Target("ball", 1, mesh, smooth=True),), frame_end=9)
    assert scenario.digest() == DIGEST
