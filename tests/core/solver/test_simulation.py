# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver against closed forms and scipy's ODE solvers; loads, energy and symmetry are those of ``test_exact_*.py``."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from oracles import contact_laws
from scipy.integrate import solve_ivp
from solver_scenes import GRAVITY, LEVEL, about, box, cube_on_pad, pad, pressed, shape

from palpate.core.errors import PalpateError
from palpate.core.geometry.rotations import rotation_matrices
from palpate.core.jobs import run_job
from palpate.core.model.body import Body, Motion
from palpate.core.model.scenario import Target
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.model.shared_results import SharedResults
from palpate.core.solver.simulation import Simulation, run, solve

STIFF_FRICTION = {"sigma0": 1e3, "sigma1": 10.0, "x0": 0.01}


# ---- loads ----
@pytest.mark.parametrize("dt", [1e-4, 1e-3, 4e-3])
def test_what_rests_does_not_depend_on_the_step(dt):
    recording = run(cube_on_pad(1.0, dt=dt))
    assert recording.sensors["pad"].normal_force[-1].sum() == pytest.approx(GRAVITY, rel=1e-9)
    depth = recording.sensors["pad"].depth[-1]
    np.testing.assert_allclose(depth, GRAVITY / 84 / 1000, rtol=1e-9)


# ---- friction ----
def plate_on_slope(mass, degrees, frames, fps, dt, **values):
    """A thin plate that cannot rock, starting where its weight and the springs balance; and the direction down the slope."""
    values = {"k": 1000.0, "cn": 10.0, **values}
    turn, texels = about((1, 0, 0), degrees), pad(14, 14, 0.0034)
    rotation, mesh = rotation_matrices(turn), box(0.06, 0.06, 0.001)
    sunk = mass * GRAVITY * np.cos(np.radians(degrees)) / (len(texels) * values["k"])
    scenario = cube_on_pad(mass, tilt=degrees, texels=texels, frames=frames, fps=fps, dt=dt, **values)
    start = Motion.at_rest(rotation @ [0, 0, 0.0005 - sunk], turn)
    plate = replace(scenario.bodies[1], inertia=np.eye(3) * 1e3, motion=start)
    return replace(scenario, bodies=(scenario.bodies[0], plate), targets=(Target("plate", 1, mesh),)), -rotation[:, 1]


def test_steeper_than_friction_holds_slides_with_the_right_acceleration():
    """At 30° with mus = mud = 0.3 it accelerates with g (sin - mu cos) once its bristles are bent."""
    values = {**STIFF_FRICTION, "sigma0": 1e4, "mus": 0.3, "mud": 0.3, "ct": 0.0}
    scenario, down = plate_on_slope(1.0, 30.0, 9, 100.0, 1e-4, **values)
    speed = run(scenario).velocities[:, 1, :3] @ down
    expected = GRAVITY * (np.sin(np.radians(30)) - 0.3 * np.cos(np.radians(30)))
    assert (speed[-1] - speed[-2]) * 100.0 == pytest.approx(expected, rel=1e-6)


def test_shear_follows_the_stiff_ode_of_scipy_through_stick_slip_and_reversal():
    """A plate pressed to constant depth and dragged to and fro: LuGre per texel against Radau on the same velocities."""
    p = SensorParameters(k=100.0, cn=0.0, sigma0=400.0, sigma1=0.5, ct=0.05, x0=0.02)
    fps, depth = 50.0, 1e-3
    phase = np.linspace(0, 4 * np.pi, 101)
    x = 3e-3 * np.sin(phase) * np.linspace(0.05, 1, 101)
    path = np.stack([x, np.zeros_like(x), np.full_like(x, 0.01 - depth)], axis=1)
    keys = ("k", "cn", "ct", "sigma0", "sigma1", "x0", "mus", "mud")
    values = {key: getattr(p, key) for key in keys}
    recording = run(pressed(box(0.08, 0.08, 0.02), path, fps=fps, dt=1e-3, **values))
    fn = p.k * depth

    z, expected = 0.0, [0.0]
    for before, after in zip(x[:-1], x[1:], strict=True):
        v = (after - before) * fps
        span = solve_ivp(
            lambda _, y, v=v: [contact_laws.bristle_rate(p, fn, y[0], v)],
            (0, 1 / fps),
            [z],
            method="Radau",
            rtol=1e-10,
            atol=1e-14,
        )
        z = span.y[0, -1]
        expected.append(contact_laws.friction_force(p, fn, z, v))
    shear = recording.sensors["pad"].shear
    assert np.ptp(shear[:, :, 0], axis=1).max() < 1e-12  # every texel the same
    assert np.abs(shear[:, :, 1]).max() < 1e-12
    np.testing.assert_allclose(shear[:, 0, 0], expected, atol=1e-8 * np.abs(expected).max())
    assert np.abs(expected).max() > 0.9 * p.mus * fn  # it did break away


def test_presliding_of_a_free_body_follows_scipy():
    """A plate on a slope while it sticks: m ẍ = m g sin - n (sigma0 z + sigma1 ż + ct ẋ), the stiff ODE of the whole body."""
    values = {"sigma0": 200.0, "sigma1": 2.0, "ct": 0.1, "x0": 0.05}
    mass, tilt, fps = 0.5, np.radians(8), 200.0
    scenario, down = plate_on_slope(mass, 8.0, 80, fps, 2.5e-5, **values)
    recording = run(scenario)
    n, fn = 196, mass * GRAVITY * np.cos(tilt) / 196

    def derivative(_, y):
        x, v, z = y
        g = fn * 0.23 + fn * (0.435 - 0.23) * np.exp(-((v / values["x0"]) ** 2))
        bristle = v - values["sigma0"] * abs(v) / g * z
        force = values["sigma0"] * z + values["sigma1"] * bristle + values["ct"] * v
        return [v, GRAVITY * np.sin(tilt) - n * force / mass, bristle]

    exact = solve_ivp(derivative, (0, 79 / fps), [0, 0, 0], method="Radau", t_eval=recording.times, rtol=1e-9, atol=1e-12)
    travel = (recording.poses[:, 1, :3] - recording.poses[0, 1, :3]) @ down
    # First order in the step: 25 µs against a slowest time of about 10 ms.
    np.testing.assert_allclose(travel, exact.y[0], atol=5e-3 * exact.y[0].max())
    held = np.linalg.norm(recording.sensors["pad"].shear[-1], axis=1).sum()
    assert held == pytest.approx(GRAVITY * mass * np.sin(tilt), rel=0.01)


def test_friction_goes_when_the_load_goes():
    """Slide, then lift straight up: shear never exceeds what the normal force holds, and ends with the contact."""
    path = [[0, 0, 0.009], [0.002, 0, 0.009], [0.004, 0, 0.009], *([0.004, 0, 0.009 + 1e-4 * i] for i in range(1, 13))]
    recording = run(pressed(box(0.08, 0.08, 0.02), path, k=100.0, sigma0=400.0, sigma1=0.0, ct=0.0, cn=0.0))
    sensor = recording.sensors["pad"]
    shear = np.linalg.norm(sensor.shear, axis=2)
    assert shear[2].max() > 0.03
    assert (shear <= 0.435 * sensor.normal_force + 1e-12).all()
    assert (shear[-1] == 0).all()
    assert not sensor.contact[-1].any()


# ---- shapes ----
def test_depth_is_perpendicular_to_a_sloped_surface():
    """Eq. 4 with the errata: a plane tilted by 20°, d = |s| cos 20°."""
    turn = about((0, 1, 0), 20.0)
    rotation = rotation_matrices(turn)
    mesh = box(0.2, 0.2, 0.02)
    # The bottom face passes 1 mm under the origin.
    center = np.array([0, 0, -0.001]) + rotation @ [0, 0, 0.01]
    texels = pad(3, 3, 1e-4)
    recording = run(pressed(mesh, [center], texels=texels, turns=[turn], k=1.0))
    expected = np.cos(np.radians(20)) * (0.001 + np.tan(np.radians(20)) * -texels.position[:, 0] * -1)
    np.testing.assert_allclose(recording.sensors["pad"].depth[0], expected, rtol=1e-9)
    into = recording.sensors["pad"].net_force[0] / recording.sensors["pad"].normal_force[0].sum()
    np.testing.assert_allclose(into, -rotation[:, 2], atol=1e-12)


def test_texels_past_their_reach_do_not_act_and_the_user_is_told_once():
    path = [[0, 0, 0.009 - 0.002 * i] for i in range(8)]
    recording = run(pressed(box(0.08, 0.08, 0.02), path, max_penetration=0.006))
    force = recording.sensors["pad"].normal_force.sum(axis=1)
    assert force[2] > 0
    assert (force[3:] == 0).all()
    assert len(recording.warnings) == 1
    assert "'probe' into 'pad'" in recording.warnings[0]
    assert "Frame 4: 84 texels" in recording.warnings[0]


@pytest.mark.parametrize("depth", [0.013, 0.05])
def test_starting_deeper_than_the_reach_is_said_at_once(depth):
    """Nothing is felt, and nothing would show why."""
    recording = run(pressed(box(0.08, 0.08, 0.2), [[0, 0, 0.1 - depth]]))
    assert (recording.sensors["pad"].normal_force == 0).all()
    assert recording.warnings[0].startswith(
        "Frame 1: 84 texels are pressed past their maximum penetration by 'probe' into 'pad'"
    )


def test_running_past_the_reach_within_one_step_is_said():
    """3 cm per step, from above the pad to 2 cm below it."""
    recording = run(pressed(box(0.08, 0.08, 0.2), [[0, 0, 0.11], [0, 0, 0.08]], fps=10.0, dt=0.1))
    assert any(warning.startswith("Frame 2: 84 texels") for warning in recording.warnings)


def test_who_was_too_deep_between_two_frames_is_named():
    """At the frames themselves nothing is touched."""
    scenario = pressed(box(0.08, 0.08, 0.2), [[0, 0, 0.11], [0, 0, 0.08], [0, 0, 0.11]], times=np.arange(3) / 20.0, fps=10.0)
    recording = run(replace(scenario, frame_end=2))
    assert (recording.sensors["pad"].normal_force == 0).all()
    (warning,) = (one for one in recording.warnings if "past their maximum penetration" in one)
    assert warning.startswith(
        "Frame 2: 84 texels are pressed past their maximum penetration by 'probe' into 'pad' and exert no force"
    )


def test_a_hole_is_not_inside():
    """Texels in the middle of a ring are within its box and yet free."""
    ring = shape(trimesh.creation.annulus(0.01, 0.06, 0.1))
    recording = run(pressed(ring, [[0, 0, 0.03]], texels=pad(4, 4, 0.002)))
    assert recording.warnings == ()
    assert not recording.sensors["pad"].contact.any()


# ---- free flight ----
def test_free_flight_is_exact():
    """Gravity alone: position to the first order of the symplectic step, angular momentum to rounding."""
    scenario = cube_on_pad(1.0, frames=40, fps=500.0, dt=1e-4)
    far = replace(
        scenario.bodies[1],
        motion=Motion.at_rest((1, 0, 0)),
        inertia=np.diag([1e-4, 2e-4, 3e-4]),
        velocity=np.array([0.05, 0, -0.3]),
        angular_velocity=np.array([3.0, 2.0, 1.0]),
    )
    recording = run(replace(scenario, bodies=(scenario.bodies[0], far)))
    t = recording.times
    fall = recording.poses[:, 1, :3] - [1, 0, 0]
    expected = far.velocity * t[:, None] + 0.5 * np.array([0, 0, -GRAVITY]) * t[:, None] ** 2
    np.testing.assert_allclose(fall, expected, atol=0.6 * GRAVITY * 1e-4 * t[-1])
    rotation = rotation_matrices(recording.poses[:, 1, 3:])
    spin = np.einsum("fij,jk,flk,fl->fi", rotation, far.inertia, rotation, recording.velocities[:, 1, 3:])
    np.testing.assert_allclose(spin, spin[:1].repeat(len(spin), axis=0), atol=1e-15)


# ---- several of everything ----
def test_two_sensors_and_two_targets_do_not_mix():
    one, two = cube_on_pad(1.0), cube_on_pad(2.0)
    aside = np.array([1.0, 0, 0])
    bodies = (
        *one.bodies,
        replace(two.bodies[0], name="pad 2", motion=Motion.at_rest(aside)),
        replace(two.bodies[1], name="cube 2", motion=Motion.at_rest(two.bodies[1].motion.positions[0] + aside)),
    )
    sensors = (one.sensors[0], replace(two.sensors[0], name="pad 2", body=2))
    targets = (one.targets[0], replace(two.targets[0], name="cube 2", body=3))
    recording = run(replace(one, bodies=bodies, sensors=sensors, targets=targets))
    assert recording.sensors["pad"].normal_force[-1].sum() == pytest.approx(GRAVITY, rel=1e-9)
    assert recording.sensors["pad 2"].normal_force[-1].sum() == pytest.approx(2 * GRAVITY, rel=1e-9)
    alone = run(one)
    assert np.array_equal(alone.sensors["pad"].normal_force, recording.sensors["pad"].normal_force)


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 0, 2), (2, 1, 0)])
def test_the_order_of_targets_on_one_texel_does_not_matter(order):
    """Three plates in one another: forces add up, depth and slip are those of the one that presses hardest."""
    depth, speed = np.array([1e-3, 6e-4, 1.5e-3]), np.array([1e-4, 2e-4, 3e-4])
    scenario, plate = pressed(box(0.08, 0.08, 0.02), [[0, 0, 0]], k=100.0), box(0.08, 0.08, 0.02)
    bodies, targets = [scenario.bodies[0]], []
    for i in order:
        path = np.array([[speed[i] * j, 0, 0.01 - depth[i]] for j in range(3)])
        bodies.append(Body(f"plate {i}", Motion(np.arange(3) / 24.0, path, np.tile(LEVEL, (3, 1)))))
        targets.append(Target(f"plate {i}", len(targets) + 1, plate))
    sensor = run(replace(scenario, bodies=tuple(bodies), targets=tuple(targets), frame_end=3)).sensors["pad"]
    np.testing.assert_allclose(sensor.normal_force[-1], 100.0 * depth.sum(), rtol=1e-9)
    np.testing.assert_allclose(sensor.depth[-1], depth[2], rtol=1e-9)
    np.testing.assert_allclose(sensor.slip[-1], speed[2] * 24.0, rtol=1e-9)


def test_pads_act_and_report_nothing():
    scenario = cube_on_pad(1.0)
    quiet = replace(scenario.sensors[0], name="table", readout=False)
    away = Sensor("elsewhere", 2, pad())
    scenario = replace(scenario, bodies=(*scenario.bodies, Body("far", Motion.at_rest((5, 0, 0)))), sensors=(quiet, away))
    recording = run(scenario)
    assert list(recording.sensors) == ["elsewhere"]
    assert recording.poses[-1, 1, 2] == pytest.approx(0.025 - GRAVITY / 84e3, abs=1e-9)


def test_reading_is_the_linear_conversion():
    scenario = cube_on_pad(1.0, gain=3.0, zero=7.0, unit="counts")
    sensor = run(scenario).sensors["pad"]
    np.testing.assert_allclose(sensor.reading, 7.0 + 3.0 * sensor.normal_force, rtol=1e-15)


# ---- determinism ----
def test_same_scenario_same_bits():
    first, second = run(cube_on_pad(1.0, tilt=5.0)), run(cube_on_pad(1.0, tilt=5.0))
    assert first.digest == second.digest
    assert np.array_equal(first.poses, second.poses)
    assert np.array_equal(first.sensors["pad"].shear, second.sensors["pad"].shear)


def test_learning_the_motion_frame_by_frame_gives_the_same_bits():
    """The timeline knows only the poses so far; a bake knows them all."""
    rng = np.random.default_rng(6)
    path = np.array([0, 0, 0.0093]) + rng.normal(size=(12, 3)) * 2e-4
    turns = np.array([about(rng.normal(size=3), 2.0) for _ in range(12)])
    scenario = pressed(box(0.03, 0.02, 0.02), path, turns=turns, **STIFF_FRICTION)
    known = run(scenario)
    start = replace(scenario.bodies[1], motion=Motion.at_rest(path[0], turns[0]))
    live = Simulation(replace(scenario, bodies=(scenario.bodies[0], start)))
    assert np.array_equal(live.observe().sensors["pad"].shear, known.sensors["pad"].shear[0])
    for i in range(1, 12):
        live.extend({1: (path[i], turns[i])})
        frame = live.advance()
        assert np.array_equal(frame.sensors["pad"].shear, known.sensors["pad"].shear[i])
        assert np.array_equal(frame.sensors["pad"].normal_force, known.sensors["pad"].normal_force[i])
        assert np.array_equal(frame.poses, known.poses[i])


def test_simulations_that_share_what_is_alike_give_the_same_bits():
    """Trees of the targets are built once; another stiffness, and another shape in between, are not mixed up."""
    base, shared = cube_on_pad(1.0, frames=3), SharedResults()
    softer = replace(base, sensors=(replace(base.sensors[0], parameters=replace(base.sensors[0].parameters, k=500.0)),))
    mesh = replace(base.targets[0].mesh, vertices=1.1 * base.targets[0].mesh.vertices)
    larger = replace(base, targets=(replace(base.targets[0], mesh=mesh),))
    trees = []
    for scenario in (base, softer, larger, base):
        simulation = Simulation(scenario, shared=shared)
        trees.append(simulation.arrays[1].tree)
        together, alone = run_job(solve(scenario, simulation)), run(scenario)
        for name in ("normal_force", "shear", "depth"):
            values, expected = (getattr(found.sensors["pad"], name) for found in (together, alone))
            np.testing.assert_array_equal(values, expected)
        np.testing.assert_array_equal(together.poses, alone.poses)
    assert trees[0] is trees[1] is trees[3] is not trees[2]


def test_a_simulation_begins_again_on_the_arrays_of_one_that_is_gone():
    """Bodies move otherwise in each of them, some on a softer sensor; one that is still there keeps its arrays."""
    base, shared = cube_on_pad(1.0, frames=4), SharedResults()

    def other(height: float, k: float = 2000.0):
        start = base.bodies[1].motion
        path = replace(start, positions=start.positions - np.array([0.0, 0.0, height]))
        sensor = replace(base.sensors[0], parameters=replace(base.sensors[0].parameters, k=k))
        return replace(base, bodies=(base.bodies[0], replace(base.bodies[1], motion=path)), sensors=(sensor,))

    used = []
    for scenario in (other(0.0), other(1e-4), other(2e-4), other(1e-4, 500.0), other(-1e-4), other(2e-4)):
        simulation = Simulation(scenario, shared=shared)
        used.append(simulation.arrays[3].bodies.rotation)
        together, alone = simulation.advance_all(), Simulation(scenario).advance_all()
        for name in ("normal_force", "shear", "depth", "slip"):
            values, expected = (getattr(found.sensors["pad"], name) for found in (together, alone))
            np.testing.assert_array_equal(values, expected)
        np.testing.assert_array_equal(together.poses, alone.poses)
        simulation = None
    assert used[1] is used[2] is used[3] is used[5] is not used[0]
    first, second = (Simulation(other(height), shared=shared) for height in (1e-4, 2e-4))
    assert first.arrays[3].bodies.rotation is used[1] is not second.arrays[3].bodies.rotation
    second.advance_all()
    frame, expected = first.advance(), Simulation(other(1e-4)).advance()
    np.testing.assert_array_equal(frame.sensors["pad"].normal_force, expected.sensors["pad"].normal_force)


def test_neighbour_lists_change_nothing():
    """A ball rolls and slides over a pad; with no list at all every query goes through the tree."""
    ball = shape(trimesh.creation.icosphere(3, 0.012))
    path = [[0.0008 * i - 0.006, 0.0004 * i, 0.0112 - 0.00005 * i] for i in range(16)]
    turns = [about((1, 2, 0), 7.0 * i) for i in range(16)]
    scenario = pressed(ball, path, turns=turns, dt=1e-3, **STIFF_FRICTION)
    simulation = Simulation(scenario)
    simulation._model.pairs.max_tube_radius[:] = 0.0  # any travel is too much: new lists at every step
    always = [simulation.observe()] + [simulation.advance() for _ in range(15)]
    recording = run(scenario)
    assert recording.sensors["pad"].contact[-1].sum() > 5
    for i, frame in enumerate(always):
        assert np.array_equal(frame.sensors["pad"].normal_force, recording.sensors["pad"].normal_force[i])
        assert np.array_equal(frame.sensors["pad"].shear, recording.sensors["pad"].shear[i])
    simulation = Simulation(scenario)
    lists = simulation._detection.neighbours
    without = lists._replace(triangles=np.zeros((len(lists.triangles), 0), np.int32))
    without.shortest_distance[:] = -1.0  # as if no list had been made
    simulation._detection = simulation._detection._replace(neighbours=without)
    for i in range(16):
        frame = simulation.advance() if i else simulation.observe()
        assert np.array_equal(frame.sensors["pad"].shear, recording.sensors["pad"].shear[i])


# ---- driving ----
def test_progress_counts_and_closing_stops():
    generator = solve(cube_on_pad(1.0, frames=10))
    steps = [next(generator) for _ in range(3)]
    assert [(step.frame, step.done, step.total) for step in steps] == [(1, 1, 10), (2, 2, 10), (3, 3, 10)]
    generator.close()
    with pytest.raises(StopIteration):
        next(generator)


@pytest.mark.parametrize("k", [1.0, 1e6])
@pytest.mark.parametrize("mass", [1e-3, 100.0])
@pytest.mark.parametrize("dt", [1e-5, 1e-2])
def test_corners_of_the_parameter_space_stay_finite_and_come_to_rest(k, mass, dt):
    """A penalty method with explicit steps would explode in half of these."""
    scenario = cube_on_pad(mass, k=k, cn=0.01 * k, sigma0=k, sigma1=0.01 * k, dt=dt, frames=12, gap=1e-5)
    recording = run(scenario)
    for sensor in recording.sensors.values():
        assert np.isfinite(sensor.normal_force).all()
        assert np.isfinite(sensor.shear).all()
    speed = np.linalg.norm(recording.velocities[:, 1, :3], axis=1)
    assert (speed <= GRAVITY * recording.times + 1e-9).all()  # never faster than free fall


def test_far_too_long_steps_ignore_no_contact():
    """A gram on springs that would allow 16 µs, at 9 ms: it sinks no deeper than one step's fall and is not thrown up.

    Contact on, thrown off by friction, contact off, contact on: the rounds of a step must not end where nothing touches.
    """
    fps = 1 / 0.0088
    values = {"k": 22700.0, "cn": 0.0, "ct": 0.43, "sigma0": 1.23, "sigma1": 0.0, "x0": 0.0016, "mus": 0.75, "mud": 0.25}
    scenario = cube_on_pad(1.2e-3, texels=pad(16, 16), size=0.04, gap=4e-3, frames=60, fps=fps, dt=1 / fps, **values)
    cube = replace(scenario.bodies[1], angular_velocity=np.array([2.9, 1.9, 0.8]))
    recording = run(replace(scenario, bodies=(scenario.bodies[0], cube)))
    fall = np.sqrt(2 * GRAVITY * 4e-3) + GRAVITY / fps + 0.03 * 3.5
    assert recording.sensors["pad"].contact.any()
    assert recording.sensors["pad"].depth.max() < fall / fps
    assert recording.poses[:, 1, 2].max() < 0.0241


@pytest.mark.parametrize("dt", [2e-3, 5e-3])
def test_a_light_body_on_a_stiff_pad_comes_to_rest_at_far_too_long_steps(dt):
    """Ten grams on 8.4 MN/m, steps a hundred times the explicit limit: contacts that come and go must not keep it hopping."""
    recording = run(cube_on_pad(0.01, k=1e5, cn=1e3, dt=dt, frames=100, fps=200.0))
    assert recording.sensors["pad"].normal_force[-1].sum() == pytest.approx(0.01 * GRAVITY, rel=1e-9)


def test_a_scenario_that_makes_no_run_is_refused():
    scenario = cube_on_pad(1.0)
    with pytest.raises(PalpateError, match="runs backwards"):
        run(replace(scenario, frame_start=10, frame_end=1))
    with pytest.raises(PalpateError, match="no sensor"):
        run(replace(scenario, sensors=()))
    with pytest.raises(PalpateError, match="Nothing in 'scene' can touch"):
        run(replace(scenario, targets=()))
    with pytest.raises(PalpateError, match="k of sensor 'pad' is 0"):
        run(replace(scenario, sensors=(replace(scenario.sensors[0], parameters=SensorParameters(k=0.0)),)))
    with pytest.raises(PalpateError, match="mass of free body 'cube'"):
        run(replace(scenario, bodies=(scenario.bodies[0], replace(scenario.bodies[1], mass=0.0))))
    with pytest.raises(PalpateError, match="time step"):
        run(replace(scenario, dt=-1.0))
    bad = Motion(np.zeros(1), np.array([[np.nan, 0, 0]]), np.array([LEVEL]))
    with pytest.raises(PalpateError, match="motion of 'pad'"):
        run(replace(scenario, bodies=(replace(scenario.bodies[0], motion=bad), scenario.bodies[1])))
