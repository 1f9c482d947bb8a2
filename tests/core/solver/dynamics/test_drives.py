# SPDX-License-Identifier: GPL-3.0-or-later
"""Driven bodies: the servo against closed forms and scipy, the force-controlled gripper against Coulomb."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from solver_scenes import GRAVITY, about, box, gripper, pad, smooth_path

from palpate.core.errors import PalpateError
from palpate.core.model.body import Body, Drive, Motion, Signal
from palpate.core.model.scenario import Scenario, Target
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.dynamics.actuators import GripControl, TactileData
from palpate.core.solver.simulation import Simulation, run


def slider(drive, frames=25, fps=100.0, dt=1e-4, motion=None, mass=0.5, gravity=0.0, height=10.0, **parameters) -> Scenario:
    """A driven box above a pad; unless told, so far away that nothing touches."""
    motion = Motion.at_rest((0, 0, height)) if motion is None else motion
    mesh = box(0.06, 0.06, 0.02)
    return Scenario(
        bodies=(Body("pad", Motion.at_rest()), Body("slider", motion, mass=mass, drive=drive)),
        sensors=(Sensor("pad", 0, pad(), SensorParameters(**parameters)),),
        targets=(Target("slider", 1, mesh),),
        frame_end=frames,
        fps=fps,
        gravity=np.array([0.0, 0.0, -gravity]),
        dt=dt,
    )


# ---- the servo alone ----
def test_a_limited_force_accelerates_with_force_over_mass():
    """Exact for the recursion: after n steps v = n dt F / m and x = dt² n (n + 1) / 2 · F / m."""
    drive = Drive("velocity", Signal.constant(100.0), np.array([1.0, 0, 0]), max_force=2.0, max_speed=1e3)
    recording = run(slider(drive))
    n = np.round(recording.times / 1e-4)
    np.testing.assert_allclose(recording.velocities[:, 1, 0], n * 1e-4 * 2.0 / 0.5, rtol=1e-12)
    np.testing.assert_allclose(recording.poses[:, 1, 0], 1e-8 * n * (n + 1) / 2 * 4.0, rtol=1e-11)
    assert np.abs(recording.poses[:, 1, 1:3] - [0, 10.0]).max() == 0.0


def test_a_position_servo_follows_the_ode_of_scipy_through_saturation():
    """m ẍ = clamp(k (x* - x) + c (v* - v)), with a target that jumps away faster than the force can follow, then waves."""
    k, c, m, limit = 400.0, 20.0, 0.5, 3.0
    times = np.linspace(0, 0.6, 61)
    target = np.where(times < 0.3, np.minimum(times / 0.02, 1.0) * 0.05, 0.05 + 0.01 * np.sin(20 * (times - 0.3)))
    signal = Signal(times, target)
    drive = Drive("position", signal, np.array([0, 1.0, 0]), False, k, c, limit, max_speed=1e3)
    recording = run(slider(drive, frames=61, dt=2e-5))

    def derivative(t, y):
        speed = (signal.at(t + 1e-7) - signal.at(t - 1e-7)) / 2e-7
        return [y[1], np.clip(k * (signal.at(t) - y[0]) + c * (speed - y[1]), -limit, limit) / m]

    exact = solve_ivp(derivative, (0, 0.6), [0, 0], t_eval=times, max_step=1e-3, rtol=1e-9, atol=1e-12)
    # First order in the step: 20 µs against k / c = 20 / s and sqrt(k / m) = 28 / s.
    np.testing.assert_allclose(recording.poses[:, 1, 1], exact.y[0], atol=2e-3 * target.max())


def test_a_body_is_driven_at_its_centre_of_mass_and_stays_where_its_carrier_has_it():
    """Its origin is elsewhere; nothing asks the drive to move."""
    drive = Drive("velocity", Signal.constant(0.0), np.array([1.0, 0, 0]), max_force=10.0)
    scenario = slider(drive, frames=3)
    body = replace(scenario.bodies[1], center_of_mass=np.array([0.01, -0.02, 0.03]))
    recording = run(replace(scenario, bodies=(scenario.bodies[0], body)))
    np.testing.assert_allclose(recording.poses[:, 1, :3], np.tile([0, 0, 10.0], (3, 1)), atol=1e-14)


@pytest.mark.parametrize("dt", [1e-5, 1e-3, 1e-2])
def test_no_gain_asks_for_a_small_step(dt):
    """Gains whose time constants are a thousandth of a step, and less: no overshoot, no swinging, the target in the end."""
    drive = Drive("position", Signal.constant(0.02), np.array([1.0, 0, 0]), False, 1e9, 1e6, 1e6, max_speed=1e3)
    way = run(slider(drive, frames=10, dt=dt)).poses[:, 1, 0]
    assert np.all(np.diff(way) > -1e-12)
    assert way.max() <= 0.02 * (1 + 1e-9)
    assert way[-1] == pytest.approx(0.02, rel=1e-9)


def test_a_strong_servo_is_not_displaced_by_weight_or_carrier_and_a_weak_one_falls():
    """The drive feeds both forward; what its force lacks, Newton has: ẍ = F / m - g along a vertical axis."""
    up = np.array([0.0, 0, 1])
    shaken = Motion(np.arange(25) / 100.0, np.stack([np.zeros(25), np.zeros(25), 10 + 0.01 * np.sin(np.arange(25))], 1),
                    np.tile(about((1, 0, 0), 0.0), (25, 1)))  # fmt: skip
    strong = run(slider(Drive(axis=up, max_force=1e6), gravity=GRAVITY, motion=shaken))
    np.testing.assert_allclose(strong.poses[:, 1, 2], shaken.positions[:, 2], atol=1e-14)
    weak = run(slider(Drive(axis=up, max_force=2.0), gravity=GRAVITY))
    np.testing.assert_allclose(weak.velocities[:, 1, 2], (2.0 / 0.5 - GRAVITY) * weak.times, rtol=1e-9, atol=1e-12)


def test_a_free_slider_on_a_turning_carrier_is_thrown_outwards():
    """Without a force r̈ = ω² r along the turning axis: r = r0 cosh ωt, from the centrifugal force alone."""
    omega, r0, fps = 10.0, 0.1, 100.0
    times = np.arange(31) / fps
    turns = np.array([about((0, 0, 1), np.degrees(omega * t)) for t in times])
    out = np.stack([np.cos(omega * times), np.sin(omega * times), np.zeros(31)], 1)
    above = np.tile([0, 0, 10.0], (31, 1))
    # The body's frame is on the axis of rotation, its centre of mass at r0.
    scenario = slider(Drive(axis=np.array([1.0, 0, 0]), max_force=0.0), 31, fps, 1e-5, Motion(times, above, turns))
    slid = replace(scenario.bodies[1], center_of_mass=np.array([r0, 0, 0]))
    recording = run(replace(scenario, bodies=(scenario.bodies[0], slid)))
    radius = r0 + np.einsum("fi,fi->f", recording.poses[:, 1, :3], out)
    # A body that is at rest before time zero has to be set turning, which starts it with no radial speed.
    np.testing.assert_allclose(radius, r0 * np.cosh(omega * times), rtol=1e-3)  # first order: ω dt = 1e-4 over 3 / ω
    assert radius[-1] > 9 * r0


def test_an_axis_in_the_world_stays_and_one_of_the_body_turns_along():
    times = np.array([0.0, 0.24])
    turning = Motion(times, np.array([[0, 0, 10.0], [0, 0, 10.0]]), np.array([about((0, 0, 1), 0), about((0, 0, 1), 90)]))
    drive = Drive("position", Signal(times, np.array([0, 0.05])), np.array([1.0, 0, 0]), max_force=1e6, max_speed=10.0)
    turned = run(slider(drive, motion=turning)).poses[-1, 1, :3]
    fixed = run(slider(replace(drive, axis_in_world=True), motion=turning)).poses[-1, 1, :3]
    np.testing.assert_allclose(turned, [0, 0.05, 10], atol=1e-4)
    np.testing.assert_allclose(fixed, [0.05, 0, 10], atol=1e-4)


def test_what_a_servo_presses_with_is_its_largest_force():
    """Against a pad that stops it, the sum of the texels is the limit: nothing else pushes."""
    down = Drive("velocity", Signal.constant(0.05), np.array([0, 0, -1.0]), max_force=3.0)
    recording = run(slider(down, frames=60, height=0.0105, k=1000.0, cn=10.0))
    assert recording.sensors["pad"].normal_force[-1].sum() == pytest.approx(3.0, rel=1e-9)
    assert recording.velocities[-1, 1, 2] == pytest.approx(0.0, abs=1e-9)


def test_a_leader_s_partner_goes_the_same_way_along_its_own_axis():
    drive = Drive("velocity", Signal.constant(0.05), np.array([1.0, 0, 0]), max_force=2.0, max_speed=1.0)
    scenario = slider(drive, gravity=GRAVITY)
    partner = Body("partner", Motion.at_rest((1, 0, 10)), mass=0.7, drive=Drive(axis=np.array([-1.0, 0, 0]), leader=1))
    recording = run(replace(scenario, bodies=(*scenario.bodies, partner)))
    assert np.array_equal(recording.poses[:, 1, 0], recording.poses[:, 1, 0])
    np.testing.assert_allclose(recording.poses[:, 2, 0], 1 - recording.poses[:, 1, 0], atol=1e-15)
    # 2 N each, 1.2 kg together.
    assert recording.velocities[1, 1, 0] == pytest.approx(min(0.05, 4.0 / 1.2 * 0.01), rel=1e-9)


# ---- force control ----
def test_the_controller_needs_no_simulation():
    """A finger of a drive without inertia against a spring that squeezes sideways as well, written here in five lines."""
    control, stiffness, damping, way = GripControl(0.05, 50.0, 0.05), 2000.0, 100.0, -0.01
    phases, totals = [], []
    for step in range(4000):
        total = 1.3 * stiffness * max(way, 0.0)  # the texels' sum is more than the force along the axis
        command = control.update(TactileData(3, 2, np.full(6, total / 6)), 5.0 if step < 3000 else 0.0, 1e-3)
        drag = damping * command.velocity + command.push - stiffness * max(way, 0.0)
        way += 1e-3 * (drag / damping if not command.homing else -0.05)
        phases.append((control.touching, command.homing))
        totals.append(total)
    assert phases[0] == (False, False) and phases[-1] == (False, True)
    assert totals[2999] == pytest.approx(5.0, rel=1e-6)
    assert max(totals) < 1.5 * 5.0
    assert totals[-1] == 0.0


@pytest.mark.slow("a gripper through its whole cycle")
@pytest.mark.parametrize("coupled", [True, False])
def test_a_gripper_reaches_its_force_lifts_holds_and_sets_down(coupled):
    """The work cycle of the paper's Fig. 12 in small: 10 N to 1e-6, no drift in the hand, the box where it was."""
    fps = 24.0
    heights = smooth_path((1.5, 0.025), (2.5, 0.055), (3.5, 0.055), (4.5, 0.025), fps=fps, end=6.0)
    force = np.where(np.arange(len(heights)) / fps < 5.0, 10.0, 0.0)
    recording = run(gripper(box(0.05, 0.05, 0.05), 0.3, force, heights, coupled=coupled))
    total = {name: sensor.normal_force.sum(axis=1) for name, sensor in recording.sensors.items()}
    held = np.searchsorted(recording.times, 1.5)
    for name in ("left", "right"):
        assert total[name][held] == pytest.approx(10.0, rel=1e-5)
        assert total[name][np.searchsorted(recording.times, 3.4)] == pytest.approx(10.0, rel=1e-6)
        assert total[name][-1] == 0.0
    place = recording.poses[:, 2, :3]
    top = np.searchsorted(recording.times, [2.6, 3.5])
    assert place[top[0], 2] - place[0, 2] == pytest.approx(0.03, abs=5e-5)
    assert np.abs(place[top[1]] - place[top[0]]).max() < 1e-9
    np.testing.assert_allclose(place[-1], place[0], atol=1e-6)
    opened = recording.poses[-1, :2, 0]
    np.testing.assert_allclose(opened, [-0.03, 0.03], atol=1e-6)


@pytest.mark.parametrize(("load", "slips"), [(0.97, False), (1.03, True)])
def test_a_held_object_slips_when_coulomb_says_so(load, slips):
    """Two fingers with 10 N and mus = 0.6 hold 12 N. Below, the hand drifts less than 1e-6 m in its last second."""
    fps, mass = 24.0, load * 2 * 0.6 * 10.0 / GRAVITY
    heights = smooth_path((1.5, 0.025), (2.0, 0.035), fps=fps, end=4.0)
    recording = run(gripper(box(0.05, 0.05, 0.05), mass, 10.0, heights))
    height = recording.poses[:, 2, 2]
    if slips:
        assert height[-1] < height[0] + 0.005
    else:
        assert height[-1] > height[0] + 0.009
        assert abs(height[-1] - height[-25]) < 1e-6


def test_targets_learnt_frame_by_frame_give_the_same_numbers():
    """The timeline knows poses and targets only as it comes to them."""
    fps = 24.0
    heights = smooth_path((0.2, 0.025), (0.4, 0.03), fps=fps, end=0.5)
    force = np.linspace(5.0, 10.0, len(heights))
    whole = gripper(box(0.05, 0.05, 0.05), 0.3, force, heights)
    expected = run(whole)
    bodies = [
        replace(b, motion=Motion(b.motion.times[:1], b.motion.positions[:1], b.motion.quaternions[:1])) for b in whole.bodies
    ]
    bodies[0] = replace(bodies[0], drive=replace(whole.bodies[0].drive, target=Signal(np.zeros(1), force[:1])))
    simulation = Simulation(replace(whole, bodies=tuple(bodies)))
    for i in range(1, len(heights)):
        fingers = {b: (whole.bodies[b].motion.positions[i], whole.bodies[b].motion.quaternions[i]) for b in (0, 1)}
        simulation.extend(fingers, {0: force[i]})
        frame = simulation.advance()
        assert np.array_equal(frame.poses, expected.poses[i])


@pytest.mark.parametrize(
    ("drive", "says"),
    [
        (Drive("speed"), "The control of 'slider' is 'speed'"),
        (Drive(damping=0.0), "damping of driven body 'slider' is 0"),
        (Drive(max_force=-1.0), "max_force of driven body 'slider' is -1"),
        (Drive(axis=np.zeros(3)), "axis of driven body 'slider'"),
        (Drive("force"), "'slider' has no sensor for its force control"),
        (Drive(leader=0), "'slider' follows a body that has no drive"),
        (Drive(target=Signal.constant(np.nan)), "target of driven body 'slider' is NaN"),
    ],
)
def test_a_drive_that_means_nothing_is_refused_in_one_sentence(drive, says):
    with pytest.raises(PalpateError, match=says):
        run(slider(drive))
