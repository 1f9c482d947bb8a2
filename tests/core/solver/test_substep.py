# SPDX-License-Identifier: GPL-3.0-or-later
"""Many frames in one call give, bit for bit, what frame by frame gives: numbers, poses and warnings."""

from dataclasses import replace

import numpy as np
import pytest
from solver_scenes import box, cube_on_pad, gripper, pad, pressed

from palpate.core.effects.engine.registry import effect
from palpate.core.jobs import run_job
from palpate.core.model.body import Body, Motion
from palpate.core.model.recording import SENSOR_FIELDS
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver import simulation as simulation_module
from palpate.core.solver.simulation import Simulation, solve


def slipping_cube():
    """A free body, whose centre of mass is not its origin."""
    scenario = cube_on_pad(mass=0.3, tilt=0.1, frames=12, dt=1e-3, sigma0=5.0)
    cube = replace(scenario.bodies[1], center_of_mass=np.array([0.001, -0.002, 0.0005]))
    return replace(scenario, bodies=(scenario.bodies[0], cube))


def with_effects():
    """Memory in forces and in readings, delays and chance."""
    chosen = (
        effect("creep"),
        effect("hysteresis", "play"),
        effect("load-spreading"),
        effect("lag", "dead-time", time=0.07),
        effect("drift", "random-walk", seed=2),
        effect("noise", seed=3),
    )
    scenario = slipping_cube()
    return replace(scenario, sensors=tuple(replace(sensor, effects=chosen) for sensor in scenario.sensors))


def two_sensors_and_a_pad():
    """One sensor is not read out, and one moves; several contact points a texel."""
    scenario = pressed(box(0.03, 0.02, 0.02), [[0.0, 0.0, 0.0101 - 0.0002 * i] for i in range(9)])
    side = Body(
        "side", Motion(np.array([0.0, 0.3]), np.array([[0.0, 0.02, -0.02], [0.0, 0.0, 0.0]]), np.tile([1.0, 0, 0, 0], (2, 1)))
    )
    more = (
        Sensor("other", 2, pad(5, 4), SensorParameters(points_per_texel=4)),
        Sensor("cover", 2, pad(3, 3), SensorParameters(), readout=False),
    )
    return replace(scenario, bodies=(*scenario.bodies, side), sensors=(*scenario.sensors, *more))


def smooth_paths():
    """Poses between samples that are not those of frames."""
    return replace(two_sensors_and_a_pad(), interpolation="smooth", frame_end=9)


def one_step_a_frame():
    return replace(smooth_paths(), dt=1.0)


def drives_by_position():
    scenario = gripper(box(0.03, 0.03, 0.04), 0.1, 3.0, np.linspace(0.02, 0.05, 9))
    bodies = tuple(
        body if body.drive is None else replace(body, drive=replace(body.drive, control="position", sensor=0))
        for body in scenario.bodies
    )
    return replace(scenario, bodies=bodies)


def controllers():
    """They read their sensors between frames, so each frame is a call of its own."""
    return gripper(box(0.03, 0.03, 0.04), 0.1, 3.0, np.linspace(0.02, 0.05, 6))


def plate_that_is_too_fast():
    """It goes through the pad in frame 2, and again later: said once. It is too deep between frames, too."""
    path = np.zeros((8, 3))
    path[:, 2] = np.where(np.arange(8) % 2 == 0, 0.05, -0.05)
    return pressed(box(0.05, 0.05, 0.002), path, dt=0.01)


def pressed_too_deep():
    return pressed(box(0.08, 0.08, 0.02), [[0, 0, 0.009 - 0.002 * i] for i in range(8)], max_penetration=0.006)


@pytest.mark.parametrize(
    "make",
    [
        slipping_cube,
        with_effects,
        two_sensors_and_a_pad,
        smooth_paths,
        one_step_a_frame,
        drives_by_position,
        controllers,
        plate_that_is_too_fast,
        pressed_too_deep,
    ],
)
def test_all_frames_at_once_are_those_of_each_frame(monkeypatch, make):
    scenario = make()
    expected = run_job(solve(scenario, Simulation(scenario, threads=1)))
    for rows in (simulation_module.PATH_ROWS, 200):  # one block of poses, and several
        monkeypatch.setattr(simulation_module, "PATH_ROWS", rows)
        simulation = Simulation(scenario, threads=1)
        found = simulation.advance_all()
        assert simulation.frame == scenario.frame_end
        assert found.warnings == expected.warnings
        assert (found.digest, found.step_reason, found.dt) == (expected.digest, expected.step_reason, expected.dt)
        assert list(found.sensors) == list(expected.sensors)
        for name in ("frames", "times", "poses", "velocities"):
            assert getattr(found, name).dtype == getattr(expected, name).dtype
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        for sensor, arrays in expected.sensors.items():
            for name in SENSOR_FIELDS:
                values = getattr(found.sensors[sensor], name)
                assert values.dtype == getattr(arrays, name).dtype and values.flags.c_contiguous
                np.testing.assert_array_equal(values, getattr(arrays, name))
    assert any(arrays.contact.any() for arrays in expected.sensors.values()) or expected.warnings


def test_a_run_that_is_over_is_its_last_frame():
    simulation = Simulation(slipping_cube())
    while simulation.frame < simulation.scenario.frame_end:
        simulation.advance()
    assert simulation.advance_all().frames.tolist() == [simulation.scenario.frame_end]


def test_a_run_of_one_frame_is_its_first_observation():
    scenario = replace(slipping_cube(), frame_end=1)
    found = Simulation(scenario).advance_all()
    assert found.frames.tolist() == [1] and found.times.tolist() == [0.0]
