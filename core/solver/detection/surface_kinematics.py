# SPDX-License-Identifier: GPL-3.0-or-later
"""What smooth and deforming surfaces change in the contact rows (kernels): the normal, the depth, the velocity of the skin."""

from __future__ import annotations

import math

from ...compiled.kernels import kernel
from ...laws.contact import DEPTH, LANES, NX, NY, NZ, PX, PY, PZ, ZX
from .deformation import at_moment, frame_at, point_at

SURFACE_VX, SURFACE_VY, SURFACE_VZ = 0, LANES, 2 * LANES
"""Columns of the velocity that deformation adds, in rows of their own (see :class:`.Workspace`)."""


@kernel
def _barycentric(x, y, z, faces, i):
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
def _smooth_normal(target, triangle, weights, surfaces):
    """Unit normal interpolated between a triangle's corners; zero where the corners' normals cancel out."""
    moment, found, corner = surfaces.clock[1], surfaces.targets, surfaces.corner
    nx, ny, nz = 0.0, 0.0, 0.0
    for k in range(3):
        nx += weights[k] * at_moment(found, moment, target, corner[triangle, k], 3)
        ny += weights[k] * at_moment(found, moment, target, corner[triangle, k], 4)
        nz += weights[k] * at_moment(found, moment, target, corner[triangle, k], 5)
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    scale = 1.0 / length if length > 1e-9 else 0.0
    return scale * nx, scale * ny, scale * nz


@kernel
def _write_relative_rotation(axes, of, velocity, dt, rotation, out):
    """Write ``Rₐᵀ exp(ω dt) R_b``: from the frame of body `of` at the step's other end to the axes of body `axes` now.

    A point that moves in its body's frame while the body turns goes by ``(R' - R) x + R' (x' - x)``.
    """
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
def _target_velocity(target, triangle, weights, dt, surfaces):
    """How fast a place on a target's skin moves in its body's frame, m/s."""
    now, other = surfaces.clock[1], surfaces.clock[2]
    found, corner = surfaces.targets, surfaces.corner
    x, y, z = 0.0, 0.0, 0.0
    for k in range(3):
        i, share = corner[triangle, k], weights[k] / dt
        x += share * (at_moment(found, other, target, i, 0) - at_moment(found, now, target, i, 0))
        y += share * (at_moment(found, other, target, i, 1) - at_moment(found, now, target, i, 1))
        z += share * (at_moment(found, other, target, i, 2) - at_moment(found, now, target, i, 2))
    return x, y, z


@kernel
def _sensor_velocity(sensor, i, along, dt, surfaces):
    """How fast the place `along` (m) behind a contact point moves in the sensor's body, m/s."""
    x, y, z, nx, ny, nz = point_at(surfaces, surfaces.clock[1], sensor, i)
    ox, oy, oz, mx, my, mz = point_at(surfaces, surfaces.clock[2], sensor, i)
    return (ox - x - along * (mx - nx)) / dt, (oy - y - along * (my - ny)) / dt, (oz - z - along * (mz - nz)) / dt


@kernel
def apply_surface_motion(pair, first, count, dt, model, tree, surfaces, state, workspace):
    """Put smooth normals into the rows of a pair, and beside them the velocities that deformation adds.

    Where the smooth normal no longer faces the segment's base (at a silhouette) the depth is zero: ``d = max(-s · n, 0)``.
    Arguments as of :func:`.narrow_phase`; `count` rows begin in block `first`.
    """
    sensor, target = model.pairs[pair, 0], model.pairs[pair, 1]
    a, b = model.sensor_body[sensor], model.target_body[target]
    rows, own, pose, turn = workspace.rows, workspace.own, workspace.pose[pair], workspace.turn[pair]
    smooth, deforms, bends = surfaces.smooth[target], surfaces.deforms[target], surfaces.bends[sensor]
    still = surfaces.clock[1] == surfaces.clock[2]
    if deforms:
        _write_relative_rotation(a, b, state.velocity, dt, workspace.rotation, turn[1])
    if bends:
        _write_relative_rotation(a, a, state.velocity, dt, workspace.rotation, turn[2])
    for r in range(count):
        block, lane = first + r // LANES, r % LANES
        slot = workspace.slots[block, lane]
        triangle, point = state.hint[slot], model.point_first[pair] + slot - model.slot_start[pair]
        i, along = point - model.point_start[sensor], state.bristles[slot, 3] * model.reach[sensor]
        px, py, pz = rows[block, PX + lane], rows[block, PY + lane], rows[block, PZ + lane]
        x = pose[9] + pose[0] * px + pose[1] * py + pose[2] * pz
        y = pose[10] + pose[3] * px + pose[4] * py + pose[5] * pz
        z = pose[11] + pose[6] * px + pose[7] * py + pose[8] * pz
        weights = _barycentric(x, y, z, tree.faces, triangle)
        if smooth:
            fx, fy, fz = _smooth_normal(target, triangle, weights, surfaces)
            if fx != 0.0 or fy != 0.0 or fz != 0.0:
                nx = pose[0] * fx + pose[3] * fy + pose[6] * fz
                ny = pose[1] * fx + pose[4] * fy + pose[7] * fz
                nz = pose[2] * fx + pose[5] * fy + pose[8] * fz
                normal_bounds = nx * model.points[point, 3] + ny * model.points[point, 4] + nz * model.points[point, 5]
                rows[block, NX + lane], rows[block, NY + lane], rows[block, NZ + lane] = nx, ny, nz
                rows[block, DEPTH + lane] = along * max(-normal_bounds, 0.0)
        if deforms or bends:
            vx, vy, vz = 0.0, 0.0, 0.0
            if deforms and not still:
                ux, uy, uz = _target_velocity(target, triangle, weights, dt, surfaces)
                vx += turn[1, 0, 0] * ux + turn[1, 0, 1] * uy + turn[1, 0, 2] * uz
                vy += turn[1, 1, 0] * ux + turn[1, 1, 1] * uy + turn[1, 1, 2] * uz
                vz += turn[1, 2, 0] * ux + turn[1, 2, 1] * uy + turn[1, 2, 2] * uz
            if bends and not still:
                ux, uy, uz = _sensor_velocity(sensor, i, along, dt, surfaces)
                vx -= turn[2, 0, 0] * ux + turn[2, 0, 1] * uy + turn[2, 0, 2] * uz
                vy -= turn[2, 1, 0] * ux + turn[2, 1, 1] * uy + turn[2, 1, 2] * uz
                vz -= turn[2, 2, 0] * ux + turn[2, 2, 1] * uy + turn[2, 2, 2] * uz
            own[block, SURFACE_VX + lane], own[block, SURFACE_VY + lane], own[block, SURFACE_VZ + lane] = vx, vy, vz


@kernel
def rotate_rows(pair, model, surfaces, workspace):
    """Turn normals and bristles of a pair's rows as the texels of its bending sensor turn during the step.

    A bristle is carried along with its texel, as a rigid sensor carries all of its own.
    """
    sensor, rows, turn = model.pairs[pair, 0], workspace.rows, workspace.turn[pair]
    for r in range(workspace.contacts[pair]):
        block, lane = workspace.first_block[pair] + r // LANES, r % LANES
        point = model.point_first[pair] + workspace.slots[block, lane] - model.slot_start[pair]
        after = frame_at(surfaces, surfaces.clock[2], sensor, point - model.point_start[sensor])
        for row in range(3):
            for column in range(3):
                turn[1, row, column] = 0.0
                for axis in range(3):
                    turn[1, row, column] += after[3 + 3 * axis + row] * model.points[point, 3 + 3 * axis + column]
        for first in (NX, ZX):
            x, y, z = rows[block, first + lane], rows[block, first + LANES + lane], rows[block, first + 2 * LANES + lane]
            for k in range(3):
                rows[block, first + k * LANES + lane] = turn[1, k, 0] * x + turn[1, k, 1] * y + turn[1, k, 2] * z
