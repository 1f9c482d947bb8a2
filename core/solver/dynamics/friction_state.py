# SPDX-License-Identifier: GPL-3.0-or-later
"""How the bristles of a pair bend in a step (kernels)."""

from __future__ import annotations

import math

from ...compiled.kernels import inlined, kernel
from ...laws.contact import GAIN, KEEP, LANES, LIMIT, NX, NY, NZ, PX, PY, PZ, ZX, ZY, ZZ
from ..detection.surface_kinematics import SURFACE_VX, SURFACE_VY, SURFACE_VZ, rotate_rows
from .relative_kinematics import motion_values, relative_motion, velocity_at


@inlined
def update_pair_friction(pair, dt, model, surfaces, state, workspace):
    """Bristle deflections at the step's end, as the sensor sees them then."""
    a, b = model.sensor_body[model.pairs[pair, 0]], model.target_body[model.pairs[pair, 1]]
    motion, part = workspace.motion[pair], workspace.part[pair]
    relative_motion(a, b, workspace.twist, state.position, workspace.rotation, motion)
    _motion_at_step_end(a, dt, workspace.twist, workspace.rotation, motion, part, workspace.turn[pair])
    if workspace.moving[pair]:
        _rotate_surface_velocities(pair, workspace)
    if surfaces.bends[model.pairs[pair, 0]]:
        rotate_rows(pair, model, surfaces, workspace)
    _update_bristles(pair, motion_values(part), state, workspace)


@kernel
def _rotate_surface_velocities(pair, workspace):
    """Turn the velocities that deformation adds by what the sensor turns during the step."""
    own, turn = workspace.own, workspace.turn[pair]
    for r in range(workspace.contacts[pair]):
        b, lane = workspace.first_block[pair] + r // LANES, r % LANES
        u = own[b, SURFACE_VX + lane], own[b, SURFACE_VY + lane], own[b, SURFACE_VZ + lane]
        for k in range(3):
            own[b, k * LANES + lane] = turn[0, k, 0] * u[0] + turn[0, k, 1] * u[1] + turn[0, k, 2] * u[2]


@kernel
def _update_bristles(pair, motion, state, workspace):
    """Bring the bristles of a pair's contacts to the step's end, at the velocities of `motion`."""
    rows, slots, bristles = workspace.rows, workspace.slots, state.bristles
    own, moving = workspace.own, workspace.moving[pair]
    first, left = workspace.first_block[pair], workspace.contacts[pair]
    for b in range(first, first + (left + LANES - 1) // LANES):
        for lane in range(LANES):
            nx, ny, nz = rows[b, NX + lane], rows[b, NY + lane], rows[b, NZ + lane]
            vx, vy, vz = velocity_at(rows[b, PX + lane], rows[b, PY + lane], rows[b, PZ + lane], motion)
            if moving:
                vx, vy, vz = vx + own[b, SURFACE_VX + lane], vy + own[b, SURFACE_VY + lane], vz + own[b, SURFACE_VZ + lane]
            keep, gain, limit = rows[b, KEEP + lane], rows[b, GAIN + lane], rows[b, LIMIT + lane]
            out = vx * nx + vy * ny + vz * nz
            zx = keep * rows[b, ZX + lane] + gain * (vx - out * nx)
            zy = keep * rows[b, ZY + lane] + gain * (vy - out * ny)
            zz = keep * rows[b, ZZ + lane] + gain * (vz - out * nz)
            square = zx * zx + zy * zy + zz * zz
            scale = limit / math.sqrt(square) if square > limit * limit else 1.0
            rows[b, ZX + lane], rows[b, ZY + lane], rows[b, ZZ + lane] = scale * zx, scale * zy, scale * zz
        for lane in range(min(left, LANES)):
            slot = slots[b, lane]
            bristles[slot, 0], bristles[slot, 1] = rows[b, ZX + lane], rows[b, ZY + lane]
            bristles[slot, 2] = rows[b, ZZ + lane]
        left -= LANES


@kernel
def _motion_at_step_end(a, dt, twist, rotation, motion, seen, turned):
    """Turn a relative motion by what the sensor itself turns during the step, ``(1 + dt W)ᵀ`` in its own axes.

    That matrix is left in the first of `turned` (3, 3, 3).
    """
    for i in range(12):
        seen[i] = motion[i]
    for k in range(3):
        for m in range(3):
            turn = 0.0  # entry (m, k) of the sensor's W in its own axes
            for i in range(3):
                for j in range(3):
                    turn += rotation[a, i, m] * twist[a, 3 + 3 * i + j] * rotation[a, j, k]
            turned[0, k, m] = dt * turn + (1.0 if k == m else 0.0)
            seen[k] += dt * turn * motion[m]
            for j in range(3):
                seen[3 + 3 * k + j] += dt * turn * motion[3 + 3 * m + j]
