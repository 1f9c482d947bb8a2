# SPDX-License-Identifier: GPL-3.0-or-later
"""A target that goes through a skin within a step is named with its frame; slower ones, and those that miss, are not."""

from dataclasses import replace

import numpy as np
import pytest
from solver_scenes import LEVEL, box, cube_on_pad, pressed

from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.geometry.rotations import quaternion_product, rotation_vectors
from palpate.core.model.body import Body, Motion
from palpate.core.solver.fast_crossings import CrossingLimits, _entering, _travel, path_of_moved_bodies
from palpate.core.solver.simulation import Simulation, run


def fall(mesh, speed, max_penetration, start=0.05, frames=6, fps=24.0, aside=0.0):
    """The warnings of a run in which a keyframed object falls through a pad."""
    heights = start - speed * np.arange(frames) / fps
    path = np.stack([np.full(frames, aside), np.zeros(frames), heights], axis=1)
    scenario = pressed(mesh, path, dt=None, fps=fps, max_penetration=max_penetration)
    return [warning for warning in run(scenario).warnings if "within one time step" in warning]


@pytest.mark.parametrize(
    ("mesh", "speed", "skin"),
    [
        (box(0.1, 0.1, 0.0002), 1.0, 0.0005),
        (box(0.1, 0.1, 0.01), 1.0, 0.0005),
        (box(0.02, 0.02, 0.02), 10.0, 0.012),
        (TriangleMesh(np.array([[-1.0, -1, 0], [1, -1, 0], [0, 2, 0]]), np.array([[0, 2, 1]])), 1.0, 0.0005),
    ],
    ids=["thin plate", "plate", "cube", "sheet"],
)
def test_what_is_too_fast_is_named_with_its_frame(mesh, speed, skin):
    (warning,) = fall(mesh, speed, skin)
    lowest = mesh.vertices[:, 2].min()
    frame = 1 + int(np.ceil((0.05 + lowest) / speed * 24.0))
    assert warning.startswith(f"Frame {frame}: 'probe' goes ") and "into 'pad'" in warning and warning.endswith(".")


def test_what_is_slow_or_misses_is_not_named():
    assert fall(box(0.1, 0.1, 0.01), 0.2, 0.0005) == []
    assert fall(box(0.02, 0.02, 0.02), 1.0, 0.012) == []
    assert fall(box(0.02, 0.02, 0.02), 10.0, 0.012, aside=0.1) == []
    assert fall(box(0.02, 0.02, 0.02), -10.0, 0.012) == []
    assert fall(box(0.02, 0.02, 0.02), 10.0, 0.012, start=-0.02) == []


def test_the_advised_step_is_short_enough():
    heights = 0.05 - np.arange(4) / 24.0
    path = np.stack([0 * heights, 0 * heights, heights], axis=1)
    scenario = pressed(box(0.1, 0.1, 0.01), path, dt=None, max_penetration=0.0005)
    (warning,) = [text for text in run(scenario).warnings if "within one" in text]
    advised = float(warning.split("time step of ")[2].split(" ms")[0]) * 1e-3
    assert not [text for text in run(replace(scenario, dt=advised)).warnings if "within one" in text]


def test_a_free_body_and_a_fast_sensor_are_named():
    scenario = cube_on_pad(frames=3, gap=0.03, dt=1e-3, max_penetration=0.004, k=1e-3, cn=0.0)
    thrown = replace(scenario.bodies[1], velocity=np.array([0.0, 0.0, -5.0]))
    warnings = run(replace(scenario, bodies=(scenario.bodies[0], thrown))).warnings
    assert [text for text in warnings if "'cube' goes 5" in text]
    times = np.array([0.0, 2 / 24.0])
    raised = Motion(times, np.array([[0.0, 0, 0], [0, 0, 0.4]]), np.tile(LEVEL, (2, 1)))
    still = Body("cube", Motion.at_rest((0.0, 0.0, 0.06)))
    warnings = run(replace(scenario, bodies=(Body("pad", raised), still))).warnings
    assert [text for text in warnings if "'cube' goes 4." in text]


def test_pairs_that_are_slow_in_a_frame_are_not_searched(monkeypatch):
    path = np.tile([0.0, 0.0, 0.02], (2, 1))
    found = Simulation(pressed(box(0.01, 0.01, 0.01), path))._fast_crossings
    monkeypatch.setattr(found, "_deepest_entry", lambda *_: pytest.fail("it was searched"))
    bodies = len(found.limits.radius)
    assert found.warnings(1, np.zeros((3, bodies, 3)), np.tile([1.0, 0, 0, 0], (3, bodies, 1)), 1e-3) == []


def test_segments_enter_from_outside_only():
    corners = box(2.0, 2.0, 2.0)
    corners = corners.vertices[corners.triangles]
    start = np.array([[0.1, 0.2, 3.0], [0.1, 0.2, 0.0], [0.1, 0.2, 3.0], [3.0, 3.0, 3.0], [0.1, 0.2, 3.0]])
    move = np.array([[0.0, 0, -3], [0, 0, 3], [0, 0, -1], [0, 0, -9], [0, 0, -9]])
    assert _entering(start, move, corners).tolist() == [True, False, False, False, True]


def test_paths_take_the_shorter_turn():
    before = np.zeros((1, 3)), np.array([LEVEL])
    after = np.ones((1, 3)), -np.array([LEVEL])
    positions, quaternions = path_of_moved_bodies(before, after, 4)
    np.testing.assert_allclose(positions[2], 0.5)
    np.testing.assert_allclose(quaternions, np.tile(LEVEL, (5, 1, 1)))


def test_the_quick_bound_is_never_below_the_fastest_step():
    """Random motions, of bodies with and without forces: the bound that every frame asks for, against the path itself."""
    random = np.random.default_rng(5)
    steps, dt, radius = 7, 1e-3, np.array([0.3])
    for moved in (False, True) * 40:
        turns = random.normal(size=(steps + 1, 1, 4)) if not moved else random.normal(size=(2, 1, 4))
        turns /= np.linalg.norm(turns, axis=2, keepdims=True)
        places = random.normal(size=(len(turns), 1, 3))
        velocities = np.zeros((steps, 1, 6))
        if moved:
            places, turns = path_of_moved_bodies((places[0], turns[0]), (places[1], turns[1]), steps)
        else:
            relative = quaternion_product(turns[1:], turns[:-1] * np.array([1.0, -1, -1, -1]))
            velocities = np.concatenate([np.diff(places, axis=0), rotation_vectors(relative)], axis=2) / dt
        limits = CrossingLimits(np.zeros((0, 2), np.int64), np.zeros(0), np.array([moved]), radius)
        cosines = np.abs((turns[1:] * turns[:-1]).sum(axis=2))
        farthest = (np.linalg.norm(np.diff(places, axis=0), axis=2) + 2 * np.arccos(np.minimum(cosines, 1)) * radius).max()
        bound = _travel(0, limits, dt, velocities, (places[0], turns[0]), (places[-1], turns[-1]))
        assert farthest * (1 - 1e-9) <= bound <= 2 * farthest * (1 + 1e-9)
