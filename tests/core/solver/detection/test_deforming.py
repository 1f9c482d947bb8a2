# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets and sensors that change their shape: against closed forms, and against rigid bodies whose motion they mimic."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from solver_scenes import about, box, cube_on_pad, grid_mesh, pad, pressed, shape

from palpate.core.errors import PalpateError
from palpate.core.geometry.rotations import rotation_matrices
from palpate.core.model.body import Body, Motion
from palpate.core.model.sensor import Deformation
from palpate.core.solver.simulation import Simulation, run

STIFF_FRICTION = {"k": 200.0, "cn": 2.0, "sigma0": 400.0, "sigma1": 0.5, "ct": 0.05, "x0": 0.02}
FRAMES, FPS, STEPS = 10, 100.0, 5


def wandering(frames=FRAMES):
    """A path that presses, slides, twists and lifts a little; every step of the solver has a sample of its own."""
    t = np.arange((frames - 1) * STEPS + 1) / STEPS
    path = np.stack([0.0012 * np.sin(0.5 * t), 0.0004 * t, 0.0088 - 0.0008 * np.sin(0.35 * t)], axis=1)
    turns = np.array([about((0.3 * np.sin(u), 0.2, 1.0), 3.0 * u) for u in t])
    return t / FPS, path, turns


def rigid(mesh, **more):
    times, path, turns = wandering()
    scenario = pressed(mesh, path, times=times, turns=turns, fps=FPS, dt=1.001 / FPS / STEPS, **{**STIFF_FRICTION, **more})
    return replace(scenario, frame_end=FRAMES)


def assert_same_forces(mine, theirs, mask=slice(None)):
    """Forces are equal to 1e-9 of the largest, on all frames but the first, which knows no motion yet."""
    a, b = mine.sensors["pad"], theirs.sensors["pad"]
    assert np.abs(b.shear[mask]).max() > 1e-3
    assert b.contact[mask].any(axis=1).all()
    for key in ("normal_force", "shear", "depth", "slip", "net_force", "net_torque", "centre_of_pressure"):
        expected = getattr(b, key)[mask]
        np.testing.assert_allclose(getattr(a, key)[mask], expected, atol=1e-9 * np.abs(expected).max(), err_msg=key)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_deformation_that_mimics_a_rigid_motion_gives_its_forces(smooth):
    """All of translation and rotation is in the vertices; the body rests."""
    ball = shape(trimesh.creation.icosphere(3, 0.012))
    ball = replace(ball, vertices=ball.vertices * [1, 1, 0.8])
    scenario = rigid(ball)
    scenario = replace(scenario, targets=(replace(scenario.targets[0], smooth=smooth),))
    times, path, turns = wandering()
    values = np.einsum("tij,vj->tvi", rotation_matrices(turns), ball.vertices) + path[:, None]
    target = replace(scenario.targets[0], mesh=replace(ball, vertices=values[0]), deformation=Deformation(times, values))
    still = replace(scenario, bodies=(scenario.bodies[0], Body("probe", Motion.at_rest())), targets=(target,))
    assert_same_forces(run(still), run(scenario))


def test_half_in_the_body_half_in_the_vertices():
    """The body turns and moves one way, its vertices another; together they are the rigid motion of the other scene."""
    ball = shape(trimesh.creation.icosphere(3, 0.012))
    scenario = rigid(ball)
    times, path, turns = wandering()
    half = np.array([about((1, 0.2, -0.4), 5.0 * u) for u in times * FPS])
    shift = np.outer(times * FPS, [0.001, -0.0005, 0.0007])
    world = np.einsum("tij,vj->tvi", rotation_matrices(turns), ball.vertices) + path[:, None]
    values = np.einsum("tji,tvj->tvi", rotation_matrices(half), world - shift[:, None])
    body = Body("probe", Motion(times, shift, half))
    target = replace(scenario.targets[0], mesh=replace(ball, vertices=values[0]), deformation=Deformation(times, values))
    assert_same_forces(run(replace(scenario, bodies=(scenario.bodies[0], body), targets=(target,))), run(scenario))


def test_a_sensor_that_bends_as_if_it_moved_feels_as_if_it_moved():
    """The target rests, the pad moves under it: once as a body, once with each texel's position, normal and x axis."""
    times, path, turns = wandering()
    ball = shape(trimesh.creation.icosphere(3, 0.012))
    rotations = rotation_matrices(turns)
    shift = path * [1, 1, -1] + [0, 0, 0.0088]
    scenario = rigid(ball, points_per_texel=4)
    resting = Body("probe", Motion.at_rest((0, 0, 0.0114)))
    moving = replace(scenario, bodies=(Body("pad", Motion(times, shift, turns)), resting))
    sensor = scenario.sensors[0]
    frames = np.stack([sensor.texels.position, sensor.texels.normal, sensor.texels.tangent])
    turned = np.einsum("tij,qvj->tqvi", rotations, frames)
    turned[:, 0] += shift[:, None]
    values = np.concatenate([turned[:, 0], turned[:, 1], turned[:, 2]], axis=2)
    bent = replace(sensor, texels=sensor.texels.with_local_frames(values[0]), deformation=Deformation(times, values))
    found, expected = run(replace(moving, bodies=(Body("pad", Motion.at_rest()), resting), sensors=(bent,))), run(moving)
    a, b = found.sensors["pad"], expected.sensors["pad"]
    assert b.contact.any(axis=1).all()
    assert np.abs(b.shear).max() > 1e-3
    for key in ("normal_force", "shear", "depth", "slip"):
        np.testing.assert_allclose(getattr(a, key), getattr(b, key), atol=1e-9 * np.abs(getattr(b, key)).max(), err_msg=key)
    world = np.einsum("tij,tj->ti", rotations[::STEPS], b.net_force)
    np.testing.assert_allclose(a.net_force, world, atol=1e-9 * np.abs(world).max())


def test_a_growing_ball_presses_as_the_closed_form_says():
    """At the distance r from the axis of a ball of radius R whose centre is h above the pad the vertical overlap is
    s = √(R² - r²) - h, the depth d = s √(1 - r²/R²), and its rate that of the radius: fn = k d + cn dR/dt.

    With facets of 0.2 mm and smooth normals both are met to 1e-3 of the largest force.
    """
    ball = shape(trimesh.creation.icosphere(6, 1.0))
    radii, height = np.linspace(0.010, 0.014, 9), 0.0095
    values = radii[:, None, None] * ball.vertices
    texels = pad(9, 9, 0.0015)
    scenario = pressed(
        replace(ball, vertices=values[0]), [[0, 0, height]], texels=texels, fps=100.0, k=100.0, cn=1.0, mus=0, mud=0
    )
    target = replace(scenario.targets[0], deformation=Deformation(np.arange(9) / 100.0, values), smooth=True)
    sensor = run(replace(scenario, targets=(target,), frame_end=9)).sensors["pad"]
    r = np.linalg.norm(texels.position[:, :2], axis=1)
    for frame in range(1, 9):
        s = np.sqrt(np.maximum(radii[frame] ** 2 - r**2, 0)) - height
        expected = np.where(s > 0, 100.0 * s * np.sqrt(np.maximum(1 - (r / radii[frame]) ** 2, 0)) + 1.0 * 0.05, 0.0)
        clear = np.abs(s) > 2e-5
        largest = expected.max()
        np.testing.assert_allclose(sensor.normal_force[frame][clear], expected[clear], atol=1e-3 * largest)
    assert sensor.contact[-1].sum() > 40


def test_smooth_normals_come_nearer_to_the_ball_than_flat_ones():
    """On a coarse ball the direction of the force: flat facets are off by degrees, interpolated normals are not."""
    radius, depth = 0.012, 0.0006
    ball = shape(trimesh.creation.icosphere(3, radius))
    texels = pad(9, 9, 0.0008)
    errors = {}
    for smooth in (False, True):
        scenario = pressed(ball, [[0, 0, radius - depth]], texels=texels, k=100.0, cn=0.0, mus=0.0, mud=0.0)
        sensor = run(replace(scenario, targets=(replace(scenario.targets[0], smooth=smooth),))).sensors["pad"]
        r = np.linalg.norm(texels.position[:, :2], axis=1)
        s = np.maximum(np.sqrt(radius**2 - r**2) - (radius - depth), 0)
        expected = 100.0 * s * np.sqrt(1 - (r / radius) ** 2)
        errors[smooth] = np.abs(sensor.normal_force[0] - expected)[s > 1e-4].max() / expected.max()
    assert errors[True] < errors[False]
    torque = run(replace(scenario, targets=(replace(scenario.targets[0], smooth=True),))).sensors["pad"].net_torque[0]
    assert np.abs(torque).max() < 1e-12  # the ball is symmetric


def test_smooth_normals_of_a_flat_surface_are_its_own():
    """A sheet, and the top of a box away from its edges."""
    sheet = grid_mesh(8, 8, 0.01)
    sheet = replace(sheet, triangles=sheet.triangles[:, ::-1])
    scenario = pressed(sheet, [[0.0005 * i, 0, -0.001] for i in range(5)], **STIFF_FRICTION)
    smooth = replace(scenario, targets=(replace(scenario.targets[0], smooth=True),))
    assert_same_forces(run(smooth), run(scenario), slice(1, None))


def test_a_free_cube_rests_on_a_pad_that_heaves():
    """A pad whose texels rise by 2 mm within 0.5 s carries the cube up with them; then the weight is what it was."""
    scenario = cube_on_pad(1.0, dt=1e-3, frames=48)
    sensor = scenario.sensors[0]
    frames = np.tile(sensor.texels.local_frames, (3, 1, 1))
    frames[1:, :, 2] += 0.002
    bent = replace(sensor, deformation=Deformation(np.array([0.0, 0.5, 2.0]), frames))
    lifted, rested = run(replace(scenario, sensors=(bent,))), run(scenario)
    assert lifted.poses[-1, 1, 2] - rested.poses[-1, 1, 2] == pytest.approx(0.002, abs=1e-9)
    np.testing.assert_allclose(lifted.sensors["pad"].normal_force[-1].sum(), 9.81, rtol=1e-9)


def test_learning_shapes_frame_by_frame_gives_the_same_bits():
    ball = shape(trimesh.creation.icosphere(2, 0.012))
    rng = np.random.default_rng(3)
    values = ball.vertices * (1 + 0.02 * rng.normal(size=(8, len(ball.vertices), 1)))
    frames = np.tile(pad().local_frames, (8, 1, 1)) + 1e-4 * rng.normal(size=(8, 84, 9))
    times = np.arange(8) / 24.0
    scenario = pressed(replace(ball, vertices=values[0]), [[0, 0, 0.0112]], **STIFF_FRICTION)

    def known(n):
        target = replace(scenario.targets[0], deformation=Deformation(times[:n], values[:n]))
        texels = scenario.sensors[0].texels.with_local_frames(frames[0])
        sensor = replace(scenario.sensors[0], texels=texels, deformation=Deformation(times[:n], frames[:n]))
        return replace(scenario, targets=(target,), sensors=(sensor,), frame_end=8)

    expected = run(known(8)).sensors["pad"]
    live = Simulation(known(1))
    for i in range(1, 8):
        live.extend({}, vertices={0: values[i]}, texels={0: frames[i]})
        frame = live.advance()
        assert np.array_equal(frame.sensors["pad"].normal_force, expected.normal_force[i])
        assert np.array_equal(frame.sensors["pad"].shear, expected.shear[i])
    assert expected.contact.any(axis=1).all()


def test_neighbour_lists_change_nothing():
    """With no room in the lists every query goes through the refitted tree."""
    ball = shape(trimesh.creation.icosphere(3, 0.012))
    rng = np.random.default_rng(4)
    values = ball.vertices * (1 + 0.03 * rng.normal(size=(10, len(ball.vertices), 1)))
    scenario = pressed(replace(ball, vertices=values[0]), [[0.0005 * i, 0, 0.0112] for i in range(10)], **STIFF_FRICTION)
    target = replace(scenario.targets[0], deformation=Deformation(np.arange(10) / 24.0, values))
    scenario = replace(scenario, targets=(target,))
    expected = run(scenario).sensors["pad"]
    simulation = Simulation(scenario)
    lists = simulation._detection.neighbours
    without = lists._replace(triangles=np.zeros((len(lists.triangles), 0), np.int32))
    without.shortest_distance[:] = -1.0  # what was made already had room
    simulation._detection = simulation._detection._replace(neighbours=without)
    for i in range(10):
        frame = simulation.advance() if i else simulation.observe()
        assert np.array_equal(frame.sensors["pad"].normal_force, expected.normal_force[i])
        assert np.array_equal(frame.sensors["pad"].shear, expected.shear[i])


def test_between_frames_vertices_go_straight():
    """Half-way between two frames of a growing box the force is half-way between theirs."""
    mesh = box(0.08, 0.08, 0.02)
    values = np.stack([mesh.vertices, mesh.vertices * [1, 1, 1.2]])
    forces = {}
    for fps in (10.0, 20.0):
        scenario = pressed(mesh, [[0, 0, 0.0095]], fps=fps, k=100.0, cn=0.0)
        target = replace(scenario.targets[0], deformation=Deformation(np.array([0.0, 0.1]), values))
        forces[fps] = run(replace(scenario, targets=(target,), frame_end=int(fps / 10) + 1)).sensors["pad"].normal_force
    np.testing.assert_allclose(forces[20.0][::2], forces[10.0], atol=1e-12)
    np.testing.assert_allclose(forces[20.0][1], forces[10.0].mean(axis=0), rtol=1e-9)
    np.testing.assert_allclose(forces[10.0][1], 100.0 * 0.0025, rtol=1e-9)


def test_shapes_that_do_not_fit_are_refused():
    scenario = pressed(box(0.08, 0.08, 0.02), [[0, 0, 0.0095]])
    target = scenario.targets[0]
    short = replace(target, deformation=Deformation(np.zeros(1), target.mesh.vertices[None, 1:]))
    with pytest.raises(PalpateError, match="'probe' deforms with 7 vertices and has 8"):
        run(replace(scenario, targets=(short,)))
    values = np.tile(target.mesh.vertices, (2, 1, 1))
    values[1, 3, 1] = np.nan
    with pytest.raises(PalpateError, match=r"vertex of 'probe' is NaN or infinite 0\.5 s after"):
        run(replace(scenario, targets=(replace(target, deformation=Deformation(np.array([0, 0.5]), values)),)))
