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
def add_own_block(matrix, at, rows, start, stop, arm, scale):
    """Add to a body's 6 × 6 block what its contacts resist of its own motion.

    With a contact's damping tensor ``C = ct 1 + (cn - ct) n nᵀ`` and ``v = V + ω × r`` the block is the sum of ``Jᵀ C J``.
    Only the lower triangle is written; `scale` is the step's length.
    """
    a00, a10, a11, a20, a21, a22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    b00, b01, b02, b10, b11, b12, b20, b21, b22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    c00, c10, c11, c20, c21, c22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for r in range(start, stop):
        t = rows[r, STIFF_T]
        e = rows[r, STIFF_N] - t
        if e == 0.0 and t == 0.0:
            continue
        nx, ny, nz = rows[r, 0], rows[r, 1], rows[r, 2]
        rx, ry, rz = rows[r, arm], rows[r, arm + 1], rows[r, arm + 2]
        mx, my, mz = ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx
        ex, ey, ez = e * nx, e * ny, e * nz
        fx, fy, fz = e * mx, e * my, e * mz
        tx, ty, tz = t * rx, t * ry, t * rz
        square = t * (rx * rx + ry * ry + rz * rz)
        a00 += t + ex * nx
        a10 += ey * nx
        a11 += t + ey * ny
        a20 += ez * nx
        a21 += ez * ny
        a22 += t + ez * nz
        # Lower-left block: [r]× C.
        b00 += fx * nx
        b01 += fx * ny - tz
        b02 += fx * nz + ty
        b10 += fy * nx + tz
        b11 += fy * ny
        b12 += fy * nz - tx
        b20 += fz * nx - ty
        b21 += fz * ny + tx
        b22 += fz * nz
        c00 += fx * mx + square - tx * rx
        c10 += fy * mx - ty * rx
        c11 += fy * my + square - ty * ry
        c20 += fz * mx - tz * rx
        c21 += fz * my - tz * ry
        c22 += fz * mz + square - tz * rz
    matrix[at, at] += scale * a00
    matrix[at + 1, at] += scale * a10
    matrix[at + 1, at + 1] += scale * a11
    matrix[at + 2, at] += scale * a20
    matrix[at + 2, at + 1] += scale * a21
    matrix[at + 2, at + 2] += scale * a22
    matrix[at + 3, at] += scale * b00
    matrix[at + 3, at + 1] += scale * b01
    matrix[at + 3, at + 2] += scale * b02
    matrix[at + 4, at] += scale * b10
    matrix[at + 4, at + 1] += scale * b11
    matrix[at + 4, at + 2] += scale * b12
    matrix[at + 5, at] += scale * b20
    matrix[at + 5, at + 1] += scale * b21
    matrix[at + 5, at + 2] += scale * b22
    matrix[at + 3, at + 3] += scale * c00
    matrix[at + 4, at + 3] += scale * c10
    matrix[at + 4, at + 4] += scale * c11
    matrix[at + 5, at + 3] += scale * c20
    matrix[at + 5, at + 4] += scale * c21
    matrix[at + 5, at + 5] += scale * c22


@kernel
def add_cross_block(matrix, at_low, at_high, rows, start, stop, arm_low, arm_high, scale):
    """Add the coupling of two free bodies through their contacts, the sum of ``-J_highᵀ C J_low``, below the diagonal."""
    for r in range(start, stop):
        t = scale * rows[r, STIFF_T]
        e = scale * rows[r, STIFF_N] - t
        hx, hy, hz = rows[r, arm_high], rows[r, arm_high + 1], rows[r, arm_high + 2]
        lx, ly, lz = rows[r, arm_low], rows[r, arm_low + 1], rows[r, arm_low + 2]
        nx, ny, nz = rows[r, 0], rows[r, 1], rows[r, 2]
        n = (nx, ny, nz, hy * nz - hz * ny, hz * nx - hx * nz, hx * ny - hy * nx)
        m = (nx, ny, nz, ly * nz - lz * ny, lz * nx - lx * nz, lx * ny - ly * nx)
        for i in range(6):
            for j in range(6):
                matrix[at_high + i, at_low + j] -= e * n[i] * m[j]
        for i in range(3):
            matrix[at_high + i, at_low + i] -= t
        # -[l]× above, [h]× on the left, and (h · l) 1 - l hᵀ below.
        matrix[at_high, at_low + 4] -= t * lz
        matrix[at_high, at_low + 5] += t * ly
        matrix[at_high + 1, at_low + 3] += t * lz
        matrix[at_high + 1, at_low + 5] -= t * lx
        matrix[at_high + 2, at_low + 3] -= t * ly
        matrix[at_high + 2, at_low + 4] += t * lx
        matrix[at_high + 3, at_low + 1] += t * hz
        matrix[at_high + 3, at_low + 2] -= t * hy
        matrix[at_high + 4, at_low] -= t * hz
        matrix[at_high + 4, at_low + 2] += t * hx
        matrix[at_high + 5, at_low] += t * hy
        matrix[at_high + 5, at_low + 1] -= t * hx
        dot = hx * lx + hy * ly + hz * lz
        h, low = (hx, hy, hz), (lx, ly, lz)
        for i in range(3):
            matrix[at_high + 3 + i, at_low + 3 + i] -= t * dot
            for j in range(3):
                matrix[at_high + 3 + i, at_low + 3 + j] += t * low[i] * h[j]


@kernel
def add_wrench(vector, at, fx, fy, fz, tx, ty, tz):
    """Add a force and a torque to a body's six entries."""
    vector[at] += fx
    vector[at + 1] += fy
    vector[at + 2] += fz
    vector[at + 3] += tx
    vector[at + 4] += ty
    vector[at + 5] += tz


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
