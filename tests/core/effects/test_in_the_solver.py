# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects in a run: what they do to bodies and readings, frame by frame as over the whole signal."""

from dataclasses import replace

import numpy as np
import pytest
from solver_scenes import box, pressed, shape
from trimesh.creation import icosphere

from palpate.core.effects.library import effect
from palpate.core.respond import respond
from palpate.core.solve import Simulation, run


def with_effects(scenario, *effects):
    return replace(scenario, sensors=(replace(scenario.sensors[0], effects=effects),))


def press(*effects, frames=40):
    """A box that goes 2 mm into the pad and out again."""
    depth = 0.002 * np.sin(np.linspace(0, np.pi, frames))
    path = np.stack([np.zeros(frames), np.zeros(frames), 0.01 - depth], axis=1)
    return with_effects(pressed(box(0.05, 0.06, 0.02), path, k=1000.0, cn=0.0), *effects)


def test_a_misaligned_sensor_feels_what_lies_beside_it():
    """A ball beside the middle presses on texels that are mounted as far beside it."""
    ball = shape(icosphere(subdivisions=3, radius=0.02))
    centred = pressed(ball, [[0.0, 0.0, 0.0185]] * 2)
    shifted = pressed(ball, [[0.002, -0.003, 0.0185]] * 2)
    moved = with_effects(shifted, effect("misalignment", "shift", x=0.002, y=-0.003))
    expected, found = (run(scenario).sensors["pad"] for scenario in (centred, moved))
    np.testing.assert_allclose(found.normal_force, expected.normal_force, atol=1e-15)
    assert found.centre_of_pressure[0] == pytest.approx(expected.centre_of_pressure[0] + [0.002, -0.003, 0.0], abs=1e-12)
    assert not np.allclose(run(shifted).sensors["pad"].normal_force, expected.normal_force)


def test_a_tilted_sensor_is_pressed_harder_at_one_side():
    """About +y the texels at +x sink by x sin(angle)."""
    tilted = with_effects(press(frames=9), effect("misalignment", "tilt", about_x=0.0, about_y=0.05))
    sensor = tilted.sensors[0]
    force = run(tilted).sensors["pad"].normal_force[4]
    expected = 1000.0 * np.maximum(0.002 - sensor.texels.position[:, 0] * np.sin(0.05), 0.0)
    np.testing.assert_allclose(force, expected, rtol=1e-9)
    np.testing.assert_allclose(sensor.mounted.position[:, 2], -sensor.texels.position[:, 0] * np.sin(0.05), atol=1e-15)


def test_readings_of_a_run_are_those_of_the_whole_signal():
    """Frames are read one by one in a run; all kinds of memory, chance and mixing are in this chain."""
    scenario = press(
        effect("load-spreading"),
        effect("hysteresis", "play"),
        effect("crosstalk", "lines"),
        effect("gain-mismatch", seed=1),
        effect("lag", "dead-time", time=0.07),
        effect("lag", "second-order", time=0.1),
        effect("drift", "random-walk", seed=2),
        effect("noise", seed=3),
        effect("quantization", step=1e-3),
    )
    recording = run(scenario)
    felt = recording.sensors["pad"]
    whole = respond(scenario.sensors[0], recording.times, felt.normal_force)
    np.testing.assert_allclose(felt.reading, whole, atol=1e-9)
    np.testing.assert_array_equal(felt.normal_force, run(with_effects(scenario)).sensors["pad"].normal_force)


def test_the_digest_tells_effects_apart():
    digests = {with_effects(press(), *stack).digest() for stack in ((), (effect("creep"),), (effect("creep", amount=0.3),))}
    assert len(digests) == 3
    creep = effect("creep", amount=0.3)
    turned = replace(creep, values=dict(reversed(creep.values.items())))
    assert with_effects(press(), creep).digest() == with_effects(press(), turned).digest()


def test_looking_twice_at_a_frame_changes_nothing():
    scenario = press(effect("lag"), effect("creep", "rising-exponential"))
    simulation = Simulation(scenario)
    for _ in range(5):
        once = simulation.advance()
    again = simulation.observe()
    np.testing.assert_array_equal(once.sensors["pad"].reading, again.sensors["pad"].reading)
