# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions of points over a step against rotation matrices."""

import numpy as np
import pytest

from palpate.core.geometry.rotations import (
    quaternions_from_vectors,
    rotation_matrices,
    write_backward_step_motion,
    write_step_motion,
)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 0.3, 2.0, 5.0])
def test_step_motions_are_the_chords_of_a_turn_seen_from_either_end(angle):
    """From the beginning an arm r moves by ``(R - 1) r``; the same motion seen from its end is ``(1 - Rᵀ) r``."""
    dt, axis = 0.01, np.array([2.0, -1.0, 2.0]) / 3.0
    velocity = np.array([1.0, 2.0, 3.0, *(angle / dt * axis)])
    turn = rotation_matrices(quaternions_from_vectors(angle * axis))
    begin, end = np.zeros(12), np.zeros(12)
    write_step_motion(velocity, dt, begin)
    write_backward_step_motion(velocity, dt, end)
    for motion, expected in ((begin, turn - np.eye(3)), (end, np.eye(3) - turn.T)):
        assert np.array_equal(motion[:3], velocity[:3])
        np.testing.assert_allclose(dt * motion[3:].reshape(3, 3), expected, rtol=0, atol=4e-16 + 1e-12 * angle)
