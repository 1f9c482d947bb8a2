# SPDX-License-Identifier: GPL-3.0-or-later
"""Several sensors and targets at once: sensor against sensor, targets that reach through a pad, holes and hollows."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from solver_scenes import GRAVITY, about, box, cube_on_pad, grid_mesh, pad, pressed, shape

from palpate.core.geometry.texels import texels_from_region
from palpate.core.model.body import Body, Motion
from palpate.core.model.scenario import Scenario, Target
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.detection.narrow_phase import count_too_deep
from palpate.core.solver.simulation import Simulation, run

DEPTH = 1e-3


def facing(ka, kb, upper, frames=1, **values):
    """Two pads of one grid, the second turned over and pressed DEPTH into the first; each is felt by the other."""
    law = {"cn": 0.01 * ka, "mus": 0.5, "mud": 0.5, "sigma0": 500.0, **values}
    sensors = tuple(
        Sensor(name, body, pad(), SensorParameters(**{**law, "k": k}))
        for body, (name, k) in enumerate([("low", ka), ("up", kb)])
    )
    larger = replace(grid_mesh(), vertices=1.1 * grid_mesh().vertices)  # so that no texel stands exactly on its rim
    targets = tuple(Target(sensor.name, sensor.body, larger, sensor=i) for i, sensor in enumerate(sensors))
    bodies = (Body("low", Motion.at_rest()), upper)
    return Scenario(bodies, sensors, targets, frame_end=frames, dt=1e-3, gravity=np.array([0, 0, -GRAVITY]))


@pytest.mark.parametrize(("ka", "kb"), [(100.0, 100.0), (100.0, 400.0), (30.0, 1000.0)])
def test_two_skins_are_springs_in_series(ka, kb):
    """Both read ka kb / (ka + kb) times the overlap, as springs in series do."""
    upper = Body("up", Motion.at_rest((0, 0, -DEPTH), about((1, 0, 0), 180.0)))
    recording = run(facing(ka, kb, upper))
    expected = ka * kb / (ka + kb) * DEPTH
    for name in ("low", "up"):
        sensor = recording.sensors[name]
        np.testing.assert_allclose(sensor.normal_force[0], expected, rtol=1e-9)
        np.testing.assert_allclose(sensor.net_force[0, 2], -84 * expected, rtol=1e-9)


def test_two_skins_of_hunt_and_crossley_are_springs_in_series():
    """k_a x_aᵖ = k_b x_bᵖ with x_a + x_b the overlap."""
    upper = Body("up", Motion.at_rest((0, 0, -DEPTH), about((1, 0, 0), 180.0)))
    recording = run(facing(1e4, 3e4, upper, normal_law="hunt-crossley", exponent=1.5))
    part = 3e4 ** (2 / 3) / (1e4 ** (2 / 3) + 3e4 ** (2 / 3))
    expected = 1e4 * (part * DEPTH) ** 1.5
    for name in ("low", "up"):
        np.testing.assert_allclose(recording.sensors[name].normal_force[0], expected, rtol=1e-9)


def test_a_free_pad_on_a_pad_weighs_what_it_weighs_on_both():
    """Each finding of the force moves the bodies by half: the weight is carried once and read by either."""
    upper = Body("up", Motion.at_rest((0, 0, -1e-4), about((1, 0, 0), 180.0)), True, 0.5, inertia=np.diag([1e-4, 1e-4, 1e-4]))
    recording = run(facing(200.0, 300.0, upper, frames=60))
    for name in ("low", "up"):
        assert recording.sensors[name].normal_force[-1].sum() == pytest.approx(0.5 * GRAVITY, rel=1e-8)
    assert -recording.poses[-1, 1, 2] == pytest.approx(0.5 * GRAVITY / 84 * (1 / 200 + 1 / 300), rel=1e-8)


def test_friction_between_two_skins_holds_and_slips_like_one():
    """Slid over each other without end both shears are mud fn, opposite in the world."""
    path = np.array([[0, 0.0002 * i, -DEPTH] for i in range(30)])
    turns = np.tile(about((1, 0, 0), 180.0), (30, 1))
    upper = Body("up", Motion(np.arange(30) / 24.0, path, turns))
    scenario = facing(400.0, 400.0, upper, frames=30, sigma0=1e4, ct=0.0, sigma1=0.0)
    recording = run(scenario)
    low, up = recording.sensors["low"], recording.sensors["up"]
    np.testing.assert_allclose(low.net_force[-1, 1], 0.5 * low.normal_force[-1].sum(), rtol=1e-6)
    np.testing.assert_allclose(up.net_force[-1, 1], 0.5 * up.normal_force[-1].sum(), rtol=1e-6)  # its y axis is turned over


def test_a_ball_between_two_pads_presses_both_and_a_third_not():
    ball = shape(trimesh.creation.icosphere(4, 0.01))
    pads = [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0185, 180.0), (0.1, 0.0, 0.0, 0.0)]
    bodies = [Body("ball", Motion.at_rest((0, 0, 0.00925)))]
    bodies += [Body(f"pad {i}", Motion.at_rest(p[:3], about((1, 0, 0), p[3]))) for i, p in enumerate(pads)]
    sensors = tuple(Sensor(f"pad {i}", i + 1, pad(11, 11, 0.002), SensorParameters(k=100.0)) for i in range(3))
    recording = run(Scenario(tuple(bodies), sensors, (Target("ball", 0, ball),), frame_end=1, dt=1e-3))
    below, above, aside = (recording.sensors[f"pad {i}"].normal_force[0] for i in range(3))
    assert below.sum() > 0.1
    assert above.sum() == pytest.approx(below.sum(), rel=1e-6)
    assert not aside.any()


def test_a_target_on_both_sides_presses_only_from_outside():
    """A plate over half of a pad that reaches through it and far out below: texels inside it sink, and it is said so; one that
    ends within the reach presses; nothing presses from behind."""
    texels, law = pad(6, 6, 0.005), {"k": 100.0, "cn": 0.0, "max_penetration": 0.004}
    through = pressed(box(0.02, 0.1, 0.2), [[0.011, 0, 0.0]], texels=texels, **law)
    recording = run(through)
    assert not recording.sensors["pad"].contact.any()
    assert "18 texels are pressed past" in recording.warnings[0]
    partly = pressed(box(0.02, 0.1, 0.1), [[0.011, 0, 0.048]], texels=texels, **law)
    sensor = run(partly).sensors["pad"]
    np.testing.assert_allclose(sensor.normal_force[0], np.where(texels.position[:, 0] > 0, 100.0 * 0.002, 0.0), atol=1e-9)
    behind = pressed(box(0.1, 0.1, 0.002), [[0, 0, -0.006]], texels=texels, **law)
    recording = run(behind)
    assert not recording.sensors["pad"].contact.any()
    assert not recording.warnings


def ring():
    """A flat ring with a hole of 12 mm radius, 2 mm thick."""
    return shape(trimesh.creation.annulus(r_min=0.012, r_max=0.05, height=0.002))


def test_texels_that_come_out_in_a_hole_are_no_longer_sunk():
    """The ring sinks past the texels' reach, then moves aside until its hole is over the pad: within its box, outside of it."""
    path = [[0.03, 0, 0.0005], [0.03, 0, -0.0025], [0.03, 0, -0.0035], [0.0, 0, -0.0035]]
    scenario = pressed(ring(), path, texels=pad(3, 3, 0.004), k=100.0, max_penetration=0.003, dt=1e-3)
    simulation = Simulation(scenario)
    simulation.observe()
    counts = []
    for _ in range(3):
        simulation.advance()
        counts.append(count_too_deep(0, *simulation.arrays))
    assert counts[1:] == [9, 0]
    assert not (simulation._state.triangle == -2).any()


def test_texels_that_slide_from_a_deep_touch_into_a_hole_were_never_sunk():
    """Pressed to 0.93 of the reach at the rim of the hole, then over the hole: nothing is sunk, and nothing is said."""
    path = [[0.03, 0, 0.001 - 0.00279], [0.0, 0, 0.001 - 0.00279]]
    scenario = pressed(ring(), path, texels=pad(3, 3, 0.004), k=100.0, max_penetration=0.003, dt=1e-3)
    recording = run(scenario)
    assert recording.sensors["pad"].contact[0].all()
    assert not recording.sensors["pad"].contact[1].any()
    assert not recording.warnings


def test_a_bowl_presses_from_its_inside():
    """A hollow target: a half shell turned over the dome of a sensor touches it from outside all over."""
    shell = trimesh.creation.icosphere(4, 0.02)
    shell.invert()  # its surface looks inwards, as that of a socket
    dome = shape(trimesh.creation.icosphere(3, 0.0205))
    texels = texels_from_region(dome, np.ones(len(dome.vertices), bool), "dome")
    scenario = pressed(shape(shell), [[0, 0, 0]], texels=texels, k=100.0, max_penetration=0.004)
    sensor = run(scenario).sensors["pad"]
    assert sensor.contact.all()
    np.testing.assert_allclose(sensor.normal_force[0], 100.0 * 0.0005, rtol=0.15)  # facets of the shell
    np.testing.assert_allclose(sensor.net_force[0], 0.0, atol=1e-3 * sensor.normal_force[0].sum())


def test_three_stacked_cubes_weigh_down_through_pads_that_press():
    """A cube on a pad, on its top a pad that is part of it, on that another cube: each level reads what is above it."""
    scenario = cube_on_pad(1.0, dt=1e-3, frames=72)
    size = 0.05
    second = replace(scenario.bodies[1], name="upper", motion=Motion.at_rest((0, 0, 1.5 * size + 2e-4)), mass=2.0)
    top = pad()
    top = replace(top, position=top.position + [0, 0, size / 2])
    middle = Sensor("top", 1, top, SensorParameters(k=1000.0, cn=10.0))
    scenario = replace(
        scenario,
        bodies=(*scenario.bodies, second),
        sensors=(*scenario.sensors, middle),
        targets=(*scenario.targets, Target("upper", 2, box(size, size, size))),
    )
    recording = run(scenario)
    assert recording.sensors["pad"].normal_force[-1].sum() == pytest.approx(3 * GRAVITY, rel=1e-7)
    assert recording.sensors["top"].normal_force[-1].sum() == pytest.approx(2 * GRAVITY, rel=1e-7)
