# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotation of a body that nothing touches: its angular momentum and its energy are both conserved (kernels).

A body with three different moments of inertia tumbles: its angular velocity changes although nothing acts. Rotating it by the
angular velocity at a step's beginning would add energy in every step, until it spins about its thinnest axis with twice as
much. The midpoint rule of Simo and Wong (1991, ALGO_C1) conserves both: a Cayley map rotates the body by the mean of the
angular velocities at the step's ends.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.rotations import rotate_quaternion, write_rotation
from ..solver_model import SolverModel, State
from ..workspace import Workspace

LARGEST_TURN = 0.25
"""Largest rotation of one midpoint step, radians: its iterations then converge after a few."""


@kernel
def matrix_times_vector(matrix: np.ndarray, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a (3, 3) matrix times a vector."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@kernel
def to_body_axes(rotation: np.ndarray, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a vector of the world in the axes of a body with the given rotation."""
    return (
        rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z,
        rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z,
        rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z,
    )


@kernel
def _inverse_cayley_rotation(vx: float, vy: float, vz: float, jx: float, jy: float, jz: float) -> tuple[float, float, float]:
    """Rotate `v` by the inverse Cayley map of 2 `j`: the length of `j` is the tangent of half the angle."""
    cx, cy, cz = vy * jz - vz * jy, vz * jx - vx * jz, vx * jy - vy * jx
    scale = 2.0 / (1.0 + jx * jx + jy * jy + jz * jz)
    return (
        vx + scale * (cx + cy * jz - cz * jy),
        vy + scale * (cy + cz * jx - cx * jz),
        vz + scale * (cz + cx * jy - cy * jx),
    )


@kernel
def _half_rotation(lx: float, ly: float, lz: float, dt: float, inverse: np.ndarray) -> tuple[float, float, float]:
    """Rotation over a short step, as the tangent of half the angle along its axis; `l` is the angular momentum. Body axes."""
    wx, wy, wz = matrix_times_vector(inverse, lx, ly, lz)
    jx, jy, jz = 0.5 * dt * wx, 0.5 * dt * wy, 0.5 * dt * wz
    for _ in range(40):
        ex, ey, ez = _inverse_cayley_rotation(lx, ly, lz, jx, jy, jz)
        wx, wy, wz = matrix_times_vector(inverse, lx + ex, ly + ey, lz + ez)
        x, y, z = 0.25 * dt * wx, 0.25 * dt * wy, 0.25 * dt * wz
        change = abs(x - jx) + abs(y - jy) + abs(z - jz)
        jx, jy, jz = x, y, z
        if change <= 1e-15 * (abs(x) + abs(y) + abs(z)):  # rounding alone may keep it from less
            break
    return jx, jy, jz


@kernel
def mean_angular_velocity(
    rotation: np.ndarray, inverse: np.ndarray, lx: float, ly: float, lz: float, dt: float
) -> tuple[float, float, float]:
    """Mean angular velocity of a body over a step in which nothing acts on it.

    Parameters
    ----------
    rotation : (3, 3) float
        At the step's beginning.
    inverse : (3, 3) float, 1/(kg·m²)
        Inverse of its inertia, body axes.
    lx, ly, lz : float, kg·m²/s
        Angular momentum, world axes.
    dt : float, seconds

    Returns
    -------
    x, y, z : float, rad/s
        World axes; the shorter way round.
    """
    lx, ly, lz = to_body_axes(rotation, lx, ly, lz)
    wx, wy, wz = matrix_times_vector(inverse, lx, ly, lz)
    parts = int(min(dt * math.sqrt(wx * wx + wy * wy + wz * wz) / LARGEST_TURN, 1000.0)) + 1
    qw, qx, qy, qz = 1.0, 0.0, 0.0, 0.0  # the turn so far
    for _ in range(parts):
        jx, jy, jz = _half_rotation(lx, ly, lz, dt / parts, inverse)
        lx, ly, lz = _inverse_cayley_rotation(lx, ly, lz, jx, jy, jz)
        qw, qx, qy, qz = (
            qw - qx * jx - qy * jy - qz * jz,
            qx + qw * jx + qy * jz - qz * jy,
            qy + qw * jy + qz * jx - qx * jz,
            qz + qw * jz + qx * jy - qy * jx,
        )
    if qw < 0.0:
        qw, qx, qy, qz = -qw, -qx, -qy, -qz
    sine = math.sqrt(qx * qx + qy * qy + qz * qz)
    pace = 2.0 / (qw * dt) if sine < 1e-8 * qw else 2.0 * math.atan2(sine, qw) / (sine * dt)
    return matrix_times_vector(rotation, pace * qx, pace * qy, pace * qz)


@kernel
def angular_velocity_of(
    rotation: np.ndarray, inverse: np.ndarray, lx: float, ly: float, lz: float
) -> tuple[float, float, float]:
    """Angular velocity (rad/s) of a body whose angular momentum is `l` (kg·m²/s), both in world axes."""
    bx, by, bz = to_body_axes(rotation, lx, ly, lz)
    wx, wy, wz = matrix_times_vector(inverse, bx, by, bz)
    return matrix_times_vector(rotation, wx, wy, wz)


@inlined
def write_rotation_at_end(body: int, dt: float, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write orientation and spin of a free body at the step's end, and by how much its energy differs from what was reckoned.

    A body that nothing touches keeps its angular momentum and its energy. Torques bring it momentum, but the spin that follows
    depends on how the body lies at the end: its energy grows by more or less than the torques' impulse times the mean of the
    spins at both ends, which is what the work of its contacts is reckoned with.
    """
    velocity, work = state.velocity[body], workspace.bodies
    quaternion, rotation, extra = work.end_quaternion[body], work.end_rotation[body], work.spin_correction[body]
    before, inertia = work.velocity_before[body], work.inertia[body]
    spin = velocity[3] - extra[0], velocity[4] - extra[1], velocity[5] - extra[2]
    lx, ly, lz = matrix_times_vector(inertia, spin[0], spin[1], spin[2])
    for i in range(4):
        quaternion[i] = state.quaternion[body, i]
    rotate_quaternion(quaternion, dt * velocity[3], dt * velocity[4], dt * velocity[5])
    write_rotation(quaternion, rotation)
    ex, ey, ez = angular_velocity_of(rotation, model.bodies.inverse_inertia[body], lx, ly, lz)
    work.end_spin[body, 0], work.end_spin[body, 1], work.end_spin[body, 2] = ex, ey, ez
    first = before[3] - extra[0], before[4] - extra[1], before[5] - extra[2]
    gx, gy, gz = matrix_times_vector(inertia, velocity[3] - before[3], velocity[4] - before[4], velocity[5] - before[5])
    kx, ky, kz = lx - gx, ly - gy, lz - gz  # angular momentum at the beginning
    grown = lx * ex + ly * ey + lz * ez - (kx * first[0] + ky * first[1] + kz * first[2])
    reckoned = gx * (before[3] + velocity[3]) + gy * (before[4] + velocity[4]) + gz * (before[5] + velocity[5])
    work.unbooked_energy[body] = 0.5 * (grown - reckoned)
