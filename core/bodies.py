# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigid bodies: poses over time, rotations, and the blocks of the linear system that moves the free ones."""

from __future__ import annotations

import math

import numpy as np

from .contact import STIFF_N, STIFF_T
from .jit import kernel
from .scenario import Motion


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """(…, 4) unit quaternions (w, x, y, z) to (…, 3, 3) rotation matrices."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions, float), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def quaternion_product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of (…, 4) quaternions: first rotate by `b`, then by `a`."""
    aw, ax, ay, az = np.moveaxis(np.asarray(a, float), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b, float), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def rotation_vectors(quaternions: np.ndarray) -> np.ndarray:
    """Logarithm of (…, 4) unit quaternions: the shorter way round, (…, 3) radians."""
    q = np.asarray(quaternions, float)
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    factor = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 1e-12)
    return q[..., 1:] * factor


def quaternions_from_vectors(vectors: np.ndarray) -> np.ndarray:
    """Exponential of (…, 3) rotation vectors (radians), (…, 4)."""
    vectors = np.asarray(vectors, float)
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * vectors], axis=-1)


def poses_at(motion: Motion, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate a motion: linear in position, constant angular velocity; held before its first and after its last sample.

    Parameters
    ----------
    motion : Motion
    times : (n,) float, seconds

    Returns
    -------
    positions : (n, 3) float, metres
    quaternions : (n, 4) float
    """
    if len(motion.times) == 1:
        n = len(times)
        return np.repeat(motion.positions, n, axis=0), np.repeat(motion.quaternions, n, axis=0)
    times = np.clip(times, motion.times[0], motion.times[-1])
    right = np.clip(np.searchsorted(motion.times, times, side="left"), 1, len(motion.times) - 1)
    left = right - 1
    share = ((times - motion.times[left]) / (motion.times[right] - motion.times[left]))[:, None]
    start, end = motion.positions[left], motion.positions[right]
    positions = np.where(share == 1.0, end, start + share * (end - start))  # a sample is met exactly, without rounding
    from_quaternion, to_quaternion = motion.quaternions[left], motion.quaternions[right]
    conjugate = from_quaternion * np.array([1.0, -1.0, -1.0, -1.0])
    turn = rotation_vectors(quaternion_product(to_quaternion, conjugate))
    turned = quaternion_product(quaternions_from_vectors(share * turn), from_quaternion)
    quaternions = np.where(share == 1.0, to_quaternion, np.where(share == 0.0, from_quaternion, turned))
    return positions, quaternions


@kernel
def rotate(quaternion, vx, vy, vz):
    """Turn a vector by a unit quaternion."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx


@kernel
def write_rotation(quaternion, rotation):
    """Write the rotation matrix of a unit quaternion into `rotation` (3, 3)."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@kernel
def turn_quaternion(quaternion, wx, wy, wz):
    """Turn `quaternion` in place by the rotation vector `w` (radians, world axes) and keep it of unit length."""
    angle = math.sqrt(wx * wx + wy * wy + wz * wz)
    c = math.cos(0.5 * angle)
    s = 0.5 if angle < 1e-8 else math.sin(0.5 * angle) / angle
    x, y, z = s * wx, s * wy, s * wz
    qw, qx, qy, qz = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    rw, rx = c * qw - x * qx - y * qy - z * qz, c * qx + x * qw + y * qz - z * qy
    ry, rz = c * qy - x * qz + y * qw + z * qx, c * qz + x * qy - y * qx + z * qw
    scale = 1.0 / math.sqrt(rw * rw + rx * rx + ry * ry + rz * rz)
    quaternion[0], quaternion[1], quaternion[2], quaternion[3] = rw * scale, rx * scale, ry * scale, rz * scale


@kernel
def write_twist(velocity, dt, twist):
    """How the points of a body move over a step that turns it by the angle ``|ω| dt``.

    The point at arm r, seen from the step's beginning, moves by ``dt (V + W r)`` with ``W = (exp([ω dt]×) - 1) / dt``: the
    chord of its arc, to rounding. With ``ω × r`` in its place two bodies turning as one would drift apart by the square of the
    angle, and their bristles with them.

    Parameters
    ----------
    velocity : (6,) float
        Velocity of the reference point and angular velocity.
    dt : float, seconds
    twist : (12,) float
        Written: V, then W row by row.
    """
    wx, wy, wz = velocity[3], velocity[4], velocity[5]
    square = wx * wx + wy * wy + wz * wz
    half = 0.5 * math.sqrt(square) * dt
    sine = 1.0 if half < 1e-6 else math.sin(half) / half
    s, c = sine * math.cos(half), 0.5 * dt * sine * sine
    twist[0], twist[1], twist[2] = velocity[0], velocity[1], velocity[2]
    twist[3], twist[4], twist[5] = c * (wx * wx - square), c * wx * wy - s * wz, c * wx * wz + s * wy
    twist[6], twist[7], twist[8] = c * wx * wy + s * wz, c * (wy * wy - square), c * wy * wz - s * wx
    twist[9], twist[10], twist[11] = c * wx * wz - s * wy, c * wy * wz + s * wx, c * (wz * wz - square)


@kernel
def look_back(velocity, dt, twist):
    """Write the twist of the step that has just ended, as seen from its end: ``W = (1 - exp(-[ω dt]×)) / dt``."""
    write_twist(velocity, -dt, twist)


@kernel
def write_world_inertia(rotation, inertia, out):
    """R I Rᵀ into `out` (3, 3)."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += rotation[i, a] * inertia[a, b] * rotation[j, b]
            out[i, j] = total


@kernel
def add_own_block(matrix, at, rows, r, arm, scale):
    """Add to a body's 6 × 6 block what one contact resists of its own motion.

    With the contact's damping tensor ``C = ct 1 + (cn - ct) n nᵀ`` and ``v = V + ω × r`` the block is ``Jᵀ C J``.
    Only the lower triangle is written; `scale` is the step's length.
    """
    nx, ny, nz = rows[r, 0], rows[r, 1], rows[r, 2]
    rx, ry, rz = rows[r, arm], rows[r, arm + 1], rows[r, arm + 2]
    mx, my, mz = ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx
    t = scale * rows[r, STIFF_T]
    e = scale * (rows[r, STIFF_N] - rows[r, STIFF_T])
    matrix[at, at] += t + e * nx * nx
    matrix[at + 1, at] += e * ny * nx
    matrix[at + 1, at + 1] += t + e * ny * ny
    matrix[at + 2, at] += e * nz * nx
    matrix[at + 2, at + 1] += e * nz * ny
    matrix[at + 2, at + 2] += t + e * nz * nz
    # Lower-left block: [r]× C.
    matrix[at + 3, at] += e * mx * nx
    matrix[at + 3, at + 1] += e * mx * ny - t * rz
    matrix[at + 3, at + 2] += e * mx * nz + t * ry
    matrix[at + 4, at] += e * my * nx + t * rz
    matrix[at + 4, at + 1] += e * my * ny
    matrix[at + 4, at + 2] += e * my * nz - t * rx
    matrix[at + 5, at] += e * mz * nx - t * ry
    matrix[at + 5, at + 1] += e * mz * ny + t * rx
    matrix[at + 5, at + 2] += e * mz * nz
    square = rx * rx + ry * ry + rz * rz
    matrix[at + 3, at + 3] += e * mx * mx + t * (square - rx * rx)
    matrix[at + 4, at + 3] += e * my * mx - t * ry * rx
    matrix[at + 4, at + 4] += e * my * my + t * (square - ry * ry)
    matrix[at + 5, at + 3] += e * mz * mx - t * rz * rx
    matrix[at + 5, at + 4] += e * mz * my - t * rz * ry
    matrix[at + 5, at + 5] += e * mz * mz + t * (square - rz * rz)


@kernel
def add_cross_block(matrix, at_low, at_high, rows, r, arm_low, arm_high, scale):
    """Add the coupling of two free bodies through one contact, ``-J_highᵀ C J_low``, below the diagonal."""
    t = scale * rows[r, STIFF_T]
    e = scale * (rows[r, STIFF_N] - rows[r, STIFF_T])
    high, low = np.zeros((3, 6)), np.zeros((3, 6))  # J of both bodies: velocity of the contact point from (V, ω)
    for i in range(3):
        high[i, i] = 1.0
        low[i, i] = 1.0
    high[0, 4], high[0, 5], high[1, 5] = rows[r, arm_high + 2], -rows[r, arm_high + 1], rows[r, arm_high]
    high[1, 3], high[2, 3], high[2, 4] = -rows[r, arm_high + 2], rows[r, arm_high + 1], -rows[r, arm_high]
    low[0, 4], low[0, 5], low[1, 5] = rows[r, arm_low + 2], -rows[r, arm_low + 1], rows[r, arm_low]
    low[1, 3], low[2, 3], low[2, 4] = -rows[r, arm_low + 2], rows[r, arm_low + 1], -rows[r, arm_low]
    for i in range(6):
        for j in range(6):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    c = e * rows[r, a] * rows[r, b] + (t if a == b else 0.0)
                    total += high[a, i] * c * low[b, j]
            matrix[at_high + i, at_low + j] -= total


@kernel
def add_force(vector, at, fx, fy, fz, rows, r, arm, scale):
    """Add a force at a contact point to a body's six entries."""
    rx, ry, rz = rows[r, arm], rows[r, arm + 1], rows[r, arm + 2]
    vector[at] += scale * fx
    vector[at + 1] += scale * fy
    vector[at + 2] += scale * fz
    vector[at + 3] += scale * (ry * fz - rz * fy)
    vector[at + 4] += scale * (rz * fx - rx * fz)
    vector[at + 5] += scale * (rx * fy - ry * fx)


@kernel
def solve_positive(matrix, vector, n):
    """Solve the symmetric positive definite system in place (Cholesky; the lower triangle is read and overwritten)."""
    for j in range(n):
        total = matrix[j, j]
        for k in range(j):
            total -= matrix[j, k] * matrix[j, k]
        pivot = math.sqrt(total)
        matrix[j, j] = pivot
        for i in range(j + 1, n):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / pivot
    for i in range(n):
        total = vector[i]
        for k in range(i):
            total -= matrix[i, k] * vector[k]
        vector[i] = total / matrix[i, i]
    for i in range(n - 1, -1, -1):
        total = vector[i]
        for k in range(i + 1, n):
            total -= matrix[k, i] * vector[k]
        vector[i] = total / matrix[i, i]
