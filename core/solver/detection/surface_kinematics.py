# SPDX-License-Identifier: GPL-3.0-or-later
"""How smooth and deforming surfaces change the contact rows (kernels): the normal, the depth, the surface's own velocity."""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import kernel
from ...geometry.rotations import matrix_times_vector
from ...laws.friction import turned_into_plane
from ..solver_model import SolverModel, State
from ..workspace import Workspace
from .deformation import point_at, vector_at_moment
from .detection_data import (
    BRISTLE,
    DEPTH,
    LANES,
    NORMAL,
    OTHER,
    POINT,
    PRESENT,
    DetectionData,
    SurfaceMotion,
    read_vector,
    write_vector,
)
from .shape_contacts import in_sensor_axes


@kernel
def _barycentric(x: float, y: float, z: float, faces: np.ndarray, i: int) -> tuple[float, float, float]:
    """Weights of a triangle's corners at a point of its plane."""
    ax, ay, az = faces[i, 0] - x, faces[i, 1] - y, faces[i, 2] - z
    bx, by, bz = faces[i, 3] - x, faces[i, 4] - y, faces[i, 5] - z
    cx, cy, cz = faces[i, 6] - x, faces[i, 7] - y, faces[i, 8] - z
    nx, ny, nz = faces[i, 9], faces[i, 10], faces[i, 11]
    a = nx * (by * cz - bz * cy) + ny * (bz * cx - bx * cz) + nz * (bx * cy - by * cx)
    b = nx * (cy * az - cz * ay) + ny * (cz * ax - cx * az) + nz * (cx * ay - cy * ax)
    c = nx * (ay * bz - az * by) + ny * (az * bx - ax * bz) + nz * (ax * by - ay * bx)
    total = a + b + c
    return a / total, b / total, c / total


@kernel
def _smooth_normal(
    target: int, triangle: int, weights: tuple[float, float, float], surfaces: SurfaceMotion
) -> tuple[float, float, float]:
    """Unit normal interpolated between a triangle's corners; zero where the corners' normals cancel out."""
    moment, found, corner = surfaces.clock[PRESENT], surfaces.targets, surfaces.corner
    nx, ny, nz = 0.0, 0.0, 0.0
    for k in range(3):
        x, y, z = vector_at_moment(found, moment, target, corner[triangle, k], 3)
        nx, ny, nz = nx + weights[k] * x, ny + weights[k] * y, nz + weights[k] * z
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    scale = 1.0 / length if length > 1e-9 else 0.0
    return scale * nx, scale * ny, scale * nz


@kernel
def _write_relative_rotation(
    bodies: tuple[int, int], velocity: np.ndarray, dt: float, rotation: np.ndarray, out: np.ndarray
) -> None:
    """Write ``Rₐᵀ exp(ω dt) R_b`` for bodies (a, b): from the frame of b at the step's other end to the axes of a now.

    A point that moves in its body's frame while the body rotates is displaced by ``(R' - R) x + R' (x' - x)``.
    """
    axes, of = bodies
    w = velocity[of, 3], velocity[of, 4], velocity[of, 5]
    angle = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) * dt
    half = 0.5 * angle
    sine = 1.0 if abs(half) < 1e-6 else math.sin(half) / half
    s, c = dt * sine * math.cos(half), 0.5 * dt * dt * sine * sine
    for i in range(3):
        for j in range(3):
            out[i, j] = 0.0
    for k in range(3):  # column k of R_b, turned: v + s (ω × v) + c (ω × (ω × v))
        v = rotation[of, 0, k], rotation[of, 1, k], rotation[of, 2, k]
        t = w[1] * v[2] - w[2] * v[1], w[2] * v[0] - w[0] * v[2], w[0] * v[1] - w[1] * v[0]
        u = w[1] * t[2] - w[2] * t[1], w[2] * t[0] - w[0] * t[2], w[0] * t[1] - w[1] * t[0]
        for i in range(3):
            for j in range(3):
                out[j, k] += rotation[axes, i, j] * (v[i] + s * t[i] + c * u[i])


@kernel
def _target_velocity(
    target: int, triangle: int, weights: tuple[float, float, float], dt: float, surfaces: SurfaceMotion
) -> tuple[float, float, float]:
    """Velocity of a point on a target's surface in its body's frame, m/s."""
    now, other = surfaces.clock[PRESENT], surfaces.clock[OTHER]
    found, corner = surfaces.targets, surfaces.corner
    x, y, z = 0.0, 0.0, 0.0
    for k in range(3):
        i, share = corner[triangle, k], weights[k] / dt
        ax, ay, az = vector_at_moment(found, now, target, i, 0)
        bx, by, bz = vector_at_moment(found, other, target, i, 0)
        x, y, z = x + share * (bx - ax), y + share * (by - ay), z + share * (bz - az)
    return x, y, z


@kernel
def _sensor_velocity(sensor: int, i: int, along: float, dt: float, surfaces: SurfaceMotion) -> tuple[float, float, float]:
    """Velocity of the place `along` (m) behind a contact point in the frame of the sensor's body, m/s."""
    x, y, z, nx, ny, nz = point_at(surfaces, surfaces.clock[PRESENT], sensor, i)
    ox, oy, oz, mx, my, mz = point_at(surfaces, surfaces.clock[OTHER], sensor, i)
    return (ox - x - along * (mx - nx)) / dt, (oy - y - along * (my - ny)) / dt, (oz - z - along * (mz - nz)) / dt


@kernel
def _apply_surface_motion(
    pair: int, dt: float, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace
) -> None:
    """Write smooth normals into the rows of a pair, and beside the rows the velocities that deformation adds.

    Where the smooth normal no longer faces the segment's base (at a silhouette) the depth is zero: ``d = max(-s · n, 0)``.
    Arguments as of :func:`finish_contacts`.
    """
    sensor, target = model.pairs.sensor[pair], model.pairs.target[pair]
    a, b = model.pairs.sensor_body[pair], model.pairs.target_body[pair]
    contacts, frame, surfaces = workspace.contacts, model.points.frame, detection.surfaces
    rows, pose, turn = contacts.rows, workspace.pairs.pose[pair], workspace.pairs.rotations[pair]
    smooth, deforms, bends = surfaces.target_smooth[target], surfaces.target_deforms[target], surfaces.sensor_deforms[sensor]
    still = surfaces.clock[PRESENT] == surfaces.clock[OTHER]
    if deforms:
        _write_relative_rotation((a, b), state.velocity, dt, workspace.bodies.rotation, turn[1])
    if bends:
        _write_relative_rotation((a, a), state.velocity, dt, workspace.bodies.rotation, turn[2])
    for r in range(contacts.number[pair]):
        block, lane = contacts.first_block[pair] + r // LANES, r % LANES
        slot = contacts.slots[block, lane]
        triangle, point = state.triangle[slot], model.pairs.first_point[pair] + slot - model.pairs.first_slot[pair]
        i, along = point - model.sensors.first_point[sensor], state.pressed_share[slot] * model.sensors.max_penetration[sensor]
        px, py, pz = read_vector(rows, block, POINT, lane)
        x = pose[9] + pose[0] * px + pose[1] * py + pose[2] * pz
        y = pose[10] + pose[3] * px + pose[4] * py + pose[5] * pz
        z = pose[11] + pose[6] * px + pose[7] * py + pose[8] * pz
        weights = _barycentric(x, y, z, detection.tree.faces, triangle)
        if smooth:
            fx, fy, fz = _smooth_normal(target, triangle, weights, surfaces)
            if fx != 0.0 or fy != 0.0 or fz != 0.0:
                nx, ny, nz = in_sensor_axes((fx, fy, fz), pose)
                facing = nx * frame[point, 3] + ny * frame[point, 4] + nz * frame[point, 5]
                write_vector(rows, block, NORMAL, lane, nx, ny, nz)
                rows[block, DEPTH + lane] = along * max(-facing, 0.0)
        if deforms or bends:
            vx, vy, vz = 0.0, 0.0, 0.0
            if deforms and not still:
                ux, uy, uz = matrix_times_vector(turn[1], *_target_velocity(target, triangle, weights, dt, surfaces))
                vx, vy, vz = vx + ux, vy + uy, vz + uz
            if bends and not still:
                ux, uy, uz = matrix_times_vector(turn[2], *_sensor_velocity(sensor, i, along, dt, surfaces))
                vx, vy, vz = vx - ux, vy - uy, vz - uz
            write_vector(contacts.surface_velocity, block, 0, lane, vx, vy, vz)


@kernel
def finish_contacts(
    pair: int, dt: float, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace
) -> None:
    """Complete the rows that :func:`.find_contacts` wrote: smooth and deforming surfaces, and bristles in the surface.

    Parameters
    ----------
    pair : int
    dt : float, seconds
        Time that velocities of surfaces are differences over: the step that begins, or minus the step that has ended.
    model : SolverModel
    detection : DetectionData
    state : State
    workspace : Workspace
    """
    sensor, target, surfaces = model.pairs.sensor[pair], model.pairs.target[pair], detection.surfaces
    if surfaces.target_smooth[target] or surfaces.target_deforms[target] or surfaces.sensor_deforms[sensor]:
        _apply_surface_motion(pair, dt, model, detection, state, workspace)
    contacts = workspace.contacts
    _rotate_bristles_into_plane(contacts.first_block[pair], contacts.number[pair], contacts.rows)


@kernel
def _rotate_bristles_into_plane(first: int, count: int, rows: np.ndarray) -> None:
    """Turn the bristles into the plane of the surface, which has turned since the last step; their lengths stay."""
    for block in range(first, first + (count + LANES - 1) // LANES):
        for lane in range(LANES):  # runs in vector registers: no branches, no calls
            nx, ny, nz = read_vector(rows, block, NORMAL, lane)
            zx, zy, zz = read_vector(rows, block, BRISTLE, lane)
            zx, zy, zz = turned_into_plane((zx, zy, zz), (nx, ny, nz))
            write_vector(rows, block, BRISTLE, lane, zx, zy, zz)
