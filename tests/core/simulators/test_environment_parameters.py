# SPDX-License-Identifier: GPL-3.0-or-later
"""Environments whose sensors differ in parameters and effects: the bits of single sensors with these, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exported_sensors import pad
from pressed_poses import DT, SIZE, assert_environments_are_singles, pose, random_poses

from palpate.core.effects.engine.registry import effect
from palpate.core.errors import PalpateError, ParameterError
from palpate.core.geometry import shapes
from palpate.core.simulators.environment_parameters import sensors_of
from palpate.core.simulators.pressed_sensor import PressedSensor
from palpate.core.simulators.pressed_sensors import PressedSensors

COUNT = 5
BOX = shapes.box((SIZE, SIZE, SIZE))


def columns(seed=1):
    draw = np.random.default_rng(seed)
    return {
        "k": 500.0 + 1000.0 * draw.random(COUNT),
        "cn": 1.0 + 10.0 * draw.random(COUNT),
        "mus": 0.5 + draw.random(COUNT),
        "sigma0": 10.0 + 1000.0 * draw.random(COUNT),
        "zero": draw.random(COUNT),
        "gain": 1.0 + draw.random(COUNT),
    }


EFFECTS = {
    "plain": ((), {}),
    "forces": (
        (effect("creep", amount=0.2, time=0.02), effect("viscous-friction")),
        {"effect.creep.amount": np.linspace(0.0, 0.5, COUNT), "effect.creep.time": np.linspace(0.02, 0.1, COUNT)},
    ),
    "readings": (
        (effect("noise", seed=3), effect("lag")),
        {"effect.noise.seed": np.arange(COUNT), "effect.lag.time": np.linspace(0.01, 0.1, COUNT)},
    ),
}


@pytest.mark.parametrize("kind", EFFECTS)
@pytest.mark.parametrize("threads", [1, 2])
def test_each_environment_has_the_bits_of_a_sensor_with_its_parameters(kind, threads):
    effects, own = EFFECTS[kind]
    item = pad(5, 4)
    item = replace(item, sensor=replace(item.sensor, effects=effects))
    chosen = columns() | own
    many = PressedSensors(item, BOX, DT, COUNT, threads, chosen)
    poses = random_poses(11, 6, COUNT)
    sensors = sensors_of(item.sensor, chosen, COUNT)
    assert [sensor.parameters.k for sensor in sensors] == list(chosen["k"])
    singles = [
        PressedSensor(replace(item, sensor=sensor), BOX, DT, *map(pose, one))
        for sensor, one in zip(sensors, poses[0], strict=True)
    ]
    assert assert_environments_are_singles(many, singles, poses) > 50


def test_a_given_load_is_carried_by_each_stiffness():
    k = np.linspace(300.0, 3000.0, COUNT)
    many = PressedSensors(pad(5, 4), BOX, DT, COUNT, 1, {"k": k, "cn": 1e-3 * k})  # at rest within milliseconds
    poses = np.tile([0.0, 0.0, SIZE / 2, 1.0, 0.0, 0.0, 0.0], (COUNT, 1))
    still = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    for _ in range(30):
        many.step(still, poses, wrench=np.tile([0.0, 0.0, 1.0], (COUNT, 1)))
    assert np.abs(many.residual).max() < 1e-6
    depth = -many.displacement[:, 2]
    assert depth * k == pytest.approx(depth[0] * k[0], rel=1e-6)


BAD = [
    ({"kk": np.ones(COUNT)}, "There is no parameter 'kk' that may differ between environments: did you mean"),
    ({"max_penetration": np.ones(COUNT)}, "There is no parameter 'max_penetration' that may differ"),
    ({"effect.creep.amount": np.ones(COUNT)}, "There is no parameter 'effect.creep.amount'"),
    ({"effect.misalignment.x": np.ones(COUNT)}, "no parameter 'effect.misalignment.x' that may differ"),  # texels stay in place
    ({"k": np.ones(3)}, r"'k' is float64 of shape \(3,\): give a number for each environment, \(5,\)"),
    ({"k": ["soft"] * COUNT}, "'k' is <U4 of shape"),
    ({"k": [1.0, 1.0, np.nan, 1.0, 1.0]}, "Pad in environment 2"),
    ({"mus": [0.5, 0.5, 0.5, 0.5, -1.0]}, "Pad in environment 4"),
]


@pytest.mark.parametrize(("wrong", "sentence"), BAD)
def test_what_makes_no_column_is_refused(wrong, sentence):
    with pytest.raises((ParameterError, PalpateError), match=sentence):
        item = pad(5, 4)
        PressedSensors(replace(item, sensor=replace(item.sensor, effects=(effect("misalignment"),))), BOX, DT, COUNT, 1, wrong)
