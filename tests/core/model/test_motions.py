# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses between samples against scipy's rotations and polynomials."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from solver_scenes import about, box, pressed

from palpate.core.geometry.rotations import quaternion_product, rotation_vectors
from palpate.core.model.body import Motion
from palpate.core.solver.simulation import poses_at, run

TIMES = np.array([0.0, 0.1, 0.2, 0.35, 0.4, 0.5, 0.6])


def tumbling() -> Motion:
    rng = np.random.default_rng(3)
    turn, turns = Rotation.identity(), []
    for _ in TIMES:
        turn = Rotation.from_rotvec(rng.normal(size=3) * 0.4) * turn
        turns.append(np.roll(turn.as_quat(), 1))
    return Motion(TIMES, rng.normal(size=(len(TIMES), 3)), np.array(turns))


@pytest.mark.parametrize("interpolation", ["linear", "smooth"])
def test_samples_are_met_to_the_last_bit_and_the_ends_are_held(interpolation):
    motion = tumbling()
    positions, quaternions = poses_at(motion, np.concatenate([[-1.0], TIMES, [9.0]]), interpolation)
    assert np.array_equal(positions, motion.positions[[0, *range(7), 6]])
    assert np.array_equal(quaternions, motion.quaternions[[0, *range(7), 6]])


def test_linear_is_slerp():
    motion, times = tumbling(), np.linspace(0, 0.6, 200)
    _, quaternions = poses_at(motion, times)
    from scipy.spatial.transform import Slerp

    expected = np.roll(Slerp(TIMES, Rotation.from_quat(np.roll(motion.quaternions, -1, axis=1)))(times).as_quat(), 1, axis=1)
    np.testing.assert_allclose(np.abs(np.einsum("ij,ij->i", quaternions, expected)), 1.0, atol=1e-14)


def test_smooth_motion_has_no_jump_of_velocity():
    """Velocities a nanosecond before and after each inner sample agree; those of linear motion do not."""
    motion, h = tumbling(), 1e-9
    speeds = {}
    for interpolation in ("linear", "smooth"):
        sides = []
        for a, b in ((-h, 0.0), (0.0, h)):
            (p0, q0), (p1, q1) = (poses_at(motion, TIMES[1:-1] + shift, interpolation) for shift in (a, b))
            turn = rotation_vectors(quaternion_product(q1, q0 * [1, -1, -1, -1]))
            sides.append(np.hstack([p1 - p0, turn]) / h)
        speeds[interpolation] = np.abs(sides[1] - sides[0]).max()
    # Positions of order 1 have 1e-16, over 1e-9 s; the curvature adds 2 h |a| ≈ 1e-6.
    assert speeds["smooth"] < 1e-5
    assert speeds["linear"] > 1.0


def test_smooth_motion_is_exact_for_constant_acceleration_and_constant_spin():
    """From the third sample on: the parabola through the samples is the motion itself."""
    accelerated = np.outer(TIMES**2, [1.0, -2.0, 0.5]) + np.outer(TIMES, [0.3, 0, 1.0])
    spinning = np.array([about((1, 2, 2), 400.0 * t) for t in TIMES])
    times = np.linspace(TIMES[2], TIMES[-1], 57)
    positions, quaternions = poses_at(Motion(TIMES, accelerated, spinning), times, "smooth")
    np.testing.assert_allclose(positions, np.outer(times**2, [1.0, -2.0, 0.5]) + np.outer(times, [0.3, 0, 1.0]), atol=1e-14)
    expected = np.array([about((1, 2, 2), 400.0 * t) for t in times])
    np.testing.assert_allclose(np.abs(np.einsum("ij,ij->i", quaternions, expected)), 1.0, atol=1e-14)


@pytest.mark.parametrize("interpolation", ["linear", "smooth"])
def test_what_is_known_of_the_future_changes_nothing(interpolation):
    whole = tumbling()
    for known in range(2, len(TIMES)):
        part = Motion(TIMES[:known], whole.positions[:known], whole.quaternions[:known])
        times = np.linspace(TIMES[known - 2], TIMES[known - 1], 20)
        for one, other in zip(poses_at(part, times, interpolation), poses_at(whole, times, interpolation), strict=True):
            assert np.array_equal(one, other)


def test_smooth_motion_presses_without_jumps_of_the_damping_force():
    """A pad of pure damping shows ḋ: under an accelerated press it follows 2 a t between frames only when it is smooth."""
    from dataclasses import replace

    t = np.arange(12) / 24.0
    path = np.stack([0 * t, 0 * t, 0.0095 - 0.002 * t**2], axis=1)
    scenario = pressed(box(0.08, 0.08, 0.02), path, k=1e-6, cn=1.0, dt=1e-3)
    force = run(replace(scenario, interpolation="smooth")).sensors["pad"].normal_force[:, 0]
    rough = run(scenario).sensors["pad"].normal_force[:, 0]
    exact = 0.004 * (t - 0.5e-3)  # velocities are those of the step that ends at the frame
    np.testing.assert_allclose(force[3:], exact[3:], rtol=5e-3)
    assert np.abs(rough[3:] / exact[3:] - 1).min() > 0.02
