# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations and velocities of rigid bodies, and the small linear algebra of their dynamics."""

from __future__ import annotations

import math

import numpy as np

from ..compiled.kernels import kernel, plain


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """Return the (…, 3, 3) rotation matrices of (…, 4) unit quaternions (w, x, y, z)."""
    q = np.asarray(quaternions, float)
    rows = np.empty((3, 3, *q.shape[:-1]))
    plain(write_rotation)(np.moveaxis(q, -1, 0), rows)
    return rows.transpose(*range(2, rows.ndim), 0, 1)


def quaternion_of(rotation: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (w, x, y, z) of a rotation matrix, (3, 3) or (9,)."""
    from scipy.spatial.transform import Rotation

    return np.roll(Rotation.from_matrix(np.reshape(rotation, (3, 3))).as_quat(), 1)


def quaternion_product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of (…, 4) quaternions: first rotate by `b`, then by `a`."""
    parts = [own[..., i] for own in (np.asarray(a, float), np.asarray(b, float)) for i in range(4)]
    numbers = plain(multiply)(*parts)
    product = np.empty((*np.shape(numbers[0]), 4))  # which takes half the time of np.stack
    for i, number in enumerate(numbers):
        product[..., i] = number
    return product


@kernel
def multiply(
    aw: float, ax: float, ay: float, az: float, bw: float, bx: float, by: float, bz: float
) -> tuple[float, float, float, float]:
    """Hamilton product of two quaternions (w, x, y, z); also of arrays of them."""
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def rotation_vectors(quaternions: np.ndarray) -> np.ndarray:
    """Logarithm of (…, 4) unit quaternions: the shorter way round, (…, 3) radians."""
    q = np.asarray(quaternions, float)
    q = np.where(q[..., :1] < 0, -q, q)
    if not q[..., 1:].any():  # most bodies do not turn, and zeros keep their signs
        return q[..., 1:] * 2.0
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    factor = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 1e-12)
    return q[..., 1:] * factor


def quaternions_from_vectors(vectors: np.ndarray) -> np.ndarray:
    """Exponential of (…, 3) rotation vectors (radians), (…, 4)."""
    vectors = np.asarray(vectors, float)
    if not vectors.any():
        return np.concatenate([np.ones((*vectors.shape[:-1], 1)), vectors], axis=-1)
    angle = np.sqrt(np.add.reduce(vectors * vectors, axis=-1, keepdims=True))
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * vectors], axis=-1)


@kernel
def rotate(quaternion: np.ndarray, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """Turn a vector by a unit quaternion."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx


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
def write_rotation(quaternion: np.ndarray, rotation: np.ndarray) -> None:
    """Write the rotation matrix of a unit quaternion into `rotation` (3, 3)."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@kernel
def quaternion_of_vector(wx: float, wy: float, wz: float) -> tuple[float, float, float, float]:
    """Exponential of a rotation vector (radians)."""
    angle = math.sqrt(wx * wx + wy * wy + wz * wz)
    s = 0.5 if angle < 1e-8 else math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), s * wx, s * wy, s * wz


@kernel
def rotate_quaternion(quaternion: np.ndarray, wx: float, wy: float, wz: float) -> None:
    """Turn `quaternion` in place by the rotation vector `w` (radians, world axes) and keep it of unit length."""
    c, x, y, z = quaternion_of_vector(wx, wy, wz)
    qw, qx, qy, qz = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    rw, rx, ry, rz = multiply(c, x, y, z, qw, qx, qy, qz)
    scale = 1.0 / math.sqrt(rw * rw + rx * rx + ry * ry + rz * rz)
    quaternion[0], quaternion[1], quaternion[2], quaternion[3] = rw * scale, rx * scale, ry * scale, rz * scale


@kernel
def write_velocity(
    position: np.ndarray,
    quaternion: np.ndarray,
    next_position: np.ndarray,
    next_quaternion: np.ndarray,
    dt: float,
    velocity: np.ndarray,
) -> None:
    """Write the velocity with which a body goes from one pose to the next in a step, the shorter way round.

    Its angular part is :func:`rotation_vectors` of the turn over `dt`, and zero, not rounding, where the body does not turn.

    Parameters
    ----------
    position, next_position : (3,) float, metres
    quaternion, next_quaternion : (4,) float
    dt : float, seconds
    velocity : (6,) float, m/s and rad/s
        Written.
    """
    turns = False
    for i in range(4):
        turns = turns or next_quaternion[i] != quaternion[i]
    for i in range(3):
        velocity[i] = (next_position[i] - position[i]) / dt
        velocity[3 + i] = 0.0
    if turns:
        w, x, y, z = multiply(
            next_quaternion[0], next_quaternion[1], next_quaternion[2], next_quaternion[3],
            quaternion[0], -quaternion[1], -quaternion[2], -quaternion[3],
        )  # fmt: skip
        sign = -1.0 if w < 0.0 else 1.0
        sine = math.sqrt(x * x + y * y + z * z)
        factor = sign * (2.0 * math.atan2(sine, sign * w) / sine if sine > 1e-12 else 2.0)
        velocity[3], velocity[4], velocity[5] = x * factor / dt, y * factor / dt, z * factor / dt


@kernel
def write_step_motion(velocity: np.ndarray, dt: float, step_motion: np.ndarray) -> None:
    """Write how the points of a body move during a step that rotates it by the angle ``|ω| dt``: twelve numbers, V and W.

    The point at arm r, seen from the step's beginning, moves by ``dt (V + W r)`` with ``W = (exp([ω dt]×) - 1) / dt``: the
    chord of its arc, to rounding. With ``ω × r`` instead, two bodies that rotate together would drift apart by the square of
    the angle, and their bristles with them.

    Parameters
    ----------
    velocity : (6,) float
        Velocity of the reference point and angular velocity.
    dt : float, seconds
    step_motion : (12,) float
        Written: V, then W row by row.
    """
    wx, wy, wz = velocity[3], velocity[4], velocity[5]
    square = wx * wx + wy * wy + wz * wz
    s, c, out = 1.0, 0.5 * dt, step_motion
    if square > 0.0:
        half = 0.5 * math.sqrt(square) * dt
        sine = 1.0 if abs(half) < 1e-6 else math.sin(half) / half
        s, c = sine * math.cos(half), 0.5 * dt * sine * sine
    out[0], out[1], out[2] = velocity[0], velocity[1], velocity[2]
    out[3], out[4], out[5] = c * (wx * wx - square), c * wx * wy - s * wz, c * wx * wz + s * wy
    out[6], out[7], out[8] = c * wx * wy + s * wz, c * (wy * wy - square), c * wy * wz - s * wx
    out[9], out[10], out[11] = c * wx * wz - s * wy, c * wy * wz + s * wx, c * (wz * wz - square)


@kernel
def write_backward_step_motion(velocity: np.ndarray, dt: float, step_motion: np.ndarray) -> None:
    """Write the motion over the step that has just ended, as seen from its end: ``W = (1 - exp(-[ω dt]×)) / dt``."""
    write_step_motion(velocity, -dt, step_motion)


@kernel
def write_world_inertia(rotation: np.ndarray, inertia: np.ndarray, out: np.ndarray) -> None:
    """Write the inertia in world axes, ``R I Rᵀ``, into `out` (3, 3)."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += rotation[i, a] * inertia[a, b] * rotation[j, b]
            out[i, j] = total


@kernel
def write_twist_map(rotation: np.ndarray, gx: float, gy: float, gz: float, sign: float, out: np.ndarray) -> None:
    """Write the matrix (6, 6) that maps a body's velocities in world axes to velocities at a sensor, in the sensor body's axes.

    Parameters
    ----------
    rotation : (3, 3) float
        Of the sensor's body.
    gx, gy, gz : float, metres
        From the body's reference point to that of the sensor's body, world axes.
    sign : float
        1 for the target's body, and -1 for the sensor's own, because velocities are those of the target relative to the sensor.
    out : (6, 6) float
        Written.
    """
    for i in range(3):
        rx, ry, rz = sign * rotation[0, i], sign * rotation[1, i], sign * rotation[2, i]
        out[i, 0], out[i, 1], out[i, 2] = rx, ry, rz
        out[i, 3], out[i, 4], out[i, 5] = gy * rz - gz * ry, gz * rx - gx * rz, gx * ry - gy * rx  # Rᵀ (ω × g)
        out[3 + i, 0], out[3 + i, 1], out[3 + i, 2] = 0.0, 0.0, 0.0
        out[3 + i, 3], out[3 + i, 4], out[3 + i, 5] = rx, ry, rz


@kernel
def project_on_axis(axis: np.ndarray, out: np.ndarray) -> None:
    """Replace the first column of a twist map by the column for a speed along `axis` (3,), in world axes, of the body."""
    for i in range(6):
        out[i, 0] = axis[0] * out[i, 0] + axis[1] * out[i, 1] + axis[2] * out[i, 2]


@kernel
def add_triple_product(
    matrix: np.ndarray,
    row: int,
    column: int,
    left: np.ndarray,
    left_width: int,
    middle: np.ndarray,
    right: np.ndarray,
    right_width: int,
    scale: float,
) -> None:
    """Add ``scale · leftᵀ middle right`` into `matrix`.

    `middle` is symmetric, 6 × 6; only its lower triangle is read. Of `left` the first `left_width` columns are used, and of
    `right` the first `right_width`.
    """
    for j in range(right_width):
        for i in range(6):
            total = 0.0
            for k in range(6):
                total += (middle[i, k] if k <= i else middle[k, i]) * right[k, j]
            for m in range(left_width):
                matrix[row + m, column + j] += scale * left[i, m] * total


@kernel
def solve_positive_definite(matrix: np.ndarray, vector: np.ndarray, n: int) -> None:
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
