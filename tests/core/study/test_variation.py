# SPDX-License-Identifier: GPL-3.0-or-later
"""Varied numbers reach the scenario, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest
from study_scenes import tiny_scene

from palpate.core.effects.engine.registry import effect
from palpate.core.errors import PalpateError
from palpate.core.study.variation import owners_text, variables_of, varied_scenario


def test_no_values_change_nothing():
    scene = tiny_scene(with_box=True)
    assert varied_scenario(scene, {}).digest() == scene.digest()


def test_numbers_arrive_where_they_belong():
    scene = tiny_scene(with_box=True)
    changed = varied_scenario(
        scene,
        {"Pad.k": 99.0, "Box.mass": 0.1, "gravity.z": -1.6, "Box.velocity.x": 0.2, "Ball.shift.y": 0.01, "Ball.scale": 2.0},
    )
    assert changed.sensors[0].parameters == replace(scene.sensors[0].parameters, k=99.0)
    assert changed.bodies[2].mass == 0.1
    np.testing.assert_allclose(changed.bodies[2].inertia, 2.0 * scene.bodies[2].inertia)
    assert list(changed.gravity) == [0.0, 0.0, -1.6]
    assert list(changed.bodies[2].velocity) == [0.2, 0.0, 0.0]
    assert list(changed.bodies[1].motion.positions[0]) == [0.0, 0.01, 0.02]
    np.testing.assert_array_equal(changed.targets[0].mesh.vertices, 2.0 * scene.targets[0].mesh.vertices)


def test_a_turn_keeps_the_first_position_and_turns_the_rest():
    scene = tiny_scene()
    motion = replace(
        scene.bodies[1].motion,
        times=np.array([0.0, 1.0]),
        positions=np.array([[0.0, 0, 0], [1.0, 0, 0]]),
        quaternions=np.tile([1.0, 0, 0, 0], (2, 1)),
    )
    scene = replace(scene, bodies=(scene.bodies[0], replace(scene.bodies[1], motion=motion)))
    turned = varied_scenario(scene, {"Ball.turn.z": np.pi / 2}).bodies[1].motion
    np.testing.assert_allclose(turned.positions, [[0, 0, 0], [0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(turned.quaternions, np.tile([np.sqrt(0.5), 0, 0, np.sqrt(0.5)], (2, 1)))


def test_effects_come_and_go():
    scene = tiny_scene()
    sensor = replace(scene.sensors[0], effects=(effect("creep", amount=0.1), effect("noise")))
    scene = replace(scene, sensors=(sensor,))
    without = varied_scenario(scene, {"Pad.effect.creep": False, "Pad.effect.creep.amount": 0.3})
    assert [item.name for item in without.sensors[0].effects] == ["noise"]
    changed = varied_scenario(scene, {"Pad.effect.creep.amount": 0.3, "Pad.effect.lag": True})
    assert [item.name for item in changed.sensors[0].effects] == ["creep", "noise", "lag"]
    assert changed.sensors[0].effects[0].values == {**sensor.effects[0].values, "amount": 0.3}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"Pad.mus": 0.1}, "mud of sensor 'Pad'"),
        ({"Pad.effect.creep.amount": 1e9}, "amount of"),
        ({"Pad.k": -1.0}, "above zero"),
    ],
)
def test_values_that_make_no_run_are_refused(values, message):
    with pytest.raises(PalpateError, match=message):
        varied_scenario(tiny_scene(), values)


def test_every_number_that_is_listed_can_be_set_to_what_it_is():
    scene = tiny_scene(with_box=True)
    listed = owners_text(scene)
    for name, item in variables_of(scene).items():
        assert name in listed
        if name.startswith("Pad.") and len(item.words) == 1 and item.words[0] != "scale":
            value = getattr(scene.sensors[0].parameters, item.words[0])
            assert varied_scenario(scene, {name: value}).digest() == scene.digest()
