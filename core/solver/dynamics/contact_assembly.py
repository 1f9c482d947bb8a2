# SPDX-License-Identifier: GPL-3.0-or-later
"""The contacts of a pair, linearised and summed up: what they resist, and the force they bring (kernels)."""

from __future__ import annotations

import math

from ...compiled.kernels import inlined, kernel
from ...laws.contact import (
    CN,
    DEPTH,
    EXPONENT,
    EXTRA_VISCOSITY,
    FRICTION_SCALE,
    GAIN,
    KEEP,
    LANES,
    LIMIT,
    LINEAR,
    NORMAL_BIAS,
    NORMAL_SLOPE,
    NX,
    NY,
    NZ,
    PX,
    PY,
    PZ,
    ZX,
    ZY,
    ZZ,
    K,
    linearise_contact,
    normal_tangent,
)
from ..detection.surface_kinematics import SURFACE_VX, SURFACE_VY, SURFACE_VZ
from ..workspace import SUMS
from .effect_kernels import STEP, apply_effects, has_effects, may_pull, press_texel, write_tangent
from .relative_kinematics import motion_values, pair_law, point_law, relative_motion, velocity_at


@inlined
def sum_pair_contacts(pair, dt, model, state, workspace):
    """Sum up the contacts of a pair at the velocities that are guessed."""
    a, b = model.sensor_body[model.pairs[pair, 0]], model.target_body[model.pairs[pair, 1]]
    relative_motion(a, b, workspace.twist, state.position, workspace.rotation, workspace.motion[pair])
    relative_motion(a, b, workspace.known, state.position, workspace.rotation, workspace.part[pair])
    first = model.point_first[pair] - model.slot_start[pair]
    _sum_contacts(pair, first, dt, pair_law(model.parameters, pair), model, state.memory, workspace)


@kernel
def _write_tangents(pair, first_point, dt, motion, law, model, memory, workspace):
    """Write what is not the same for all contacts of a pair, for the loop that must not call it itself.

    The tangents of a curved normal law at the velocities of `motion`, what effects make of them, and what was painted.
    """
    rows, painted, sensor = workspace.rows, model.painted, model.pairs[pair, 0]
    effects = has_effects(sensor, model.program)
    for r in range(workspace.contacts[pair]):
        b, lane = workspace.first_block[pair] + r // LANES, r % LANES
        point = first_point + workspace.slots[b, lane]
        vx, vy, vz = velocity_at(rows[b, PX + lane], rows[b, PY + lane], rows[b, PZ + lane], motion)
        if workspace.moving[pair]:
            vx, vy, vz = (
                vx + workspace.own[b, SURFACE_VX + lane],
                vy + workspace.own[b, SURFACE_VY + lane],
                vz + workspace.own[b, SURFACE_VZ + lane],
            )
        rate = vx * rows[b, NX + lane] + vy * rows[b, NY + lane] + vz * rows[b, NZ + lane]
        p = point_law(law, painted, point)
        rows[b, FRICTION_SCALE + lane], rows[b, EXTRA_VISCOSITY + lane] = painted[point, 1] if len(painted) > 0 else 1.0, 0.0
        if effects:
            speed = math.sqrt(max(vx * vx + vy * vy + vz * vz - rate * rate, 0.0))
            press_texel(workspace.felt, b, LANES, lane, pair, rows[b, DEPTH + lane] + dt * rate, rate, 0.0, speed, p, model)
        else:
            rows[b, NORMAL_BIAS + lane], rows[b, NORMAL_SLOPE + lane] = normal_tangent(rows[b, DEPTH + lane], rate, dt, p)
    if effects:
        first, left = workspace.first_block[pair], workspace.contacts[pair]
        for b in range(first, first + (left + LANES - 1) // LANES):
            count = min(left, LANES)
            apply_effects(sensor, STEP, b, 0, count, first_point, law, model, memory, workspace.slots, workspace.felt)
            for lane in range(count):
                write_tangent(pair, b, lane, dt, rows[b, FRICTION_SCALE + lane], model, workspace.felt, rows)
            left -= LANES


@kernel
def _sum_contacts(pair, first_point, dt, p, model, memory, workspace):
    """Linearise the contacts of a pair, and sum their forces on the target and what they resist.

    The contact point of a row is `first_point` plus its slot.

    With a contact's damping tensor ``C = ct 1 + (cn - ct) n nᵀ`` and velocities ``v + ω × p`` the block is the sum of
    ``Jᵀ C J``, its lower triangle; the wrench is what the springs and the known part of the motion do.
    """
    rows, sums = workspace.rows, workspace.sums[pair]
    motion, part = motion_values(workspace.motion[pair]), motion_values(workspace.part[pair])
    for i in range(SUMS * LANES):
        sums[i] = 0.0
    own, moving = workspace.own, workspace.moving[pair]
    sensor = model.pairs[pair, 0]
    vary = p[EXPONENT] != LINEAR or len(model.painted) > 0 or has_effects(sensor, model.program)
    sticks = may_pull(sensor, model.program)
    if vary:
        _write_tangents(pair, first_point, dt, motion, p, model, memory, workspace)
    first = workspace.first_block[pair]
    for b in range(first, first + (workspace.contacts[pair] + LANES - 1) // LANES):
        for lane in range(LANES):  # runs in vector registers: no branches, no calls
            nx, ny, nz = rows[b, NX + lane], rows[b, NY + lane], rows[b, NZ + lane]
            px, py, pz = rows[b, PX + lane], rows[b, PY + lane], rows[b, PZ + lane]
            zx, zy, zz = rows[b, ZX + lane], rows[b, ZY + lane], rows[b, ZZ + lane]
            vx, vy, vz = velocity_at(px, py, pz, motion)
            ux, uy, uz = velocity_at(px, py, pz, part)
            if moving:
                vx, vy, vz = vx + own[b, SURFACE_VX + lane], vy + own[b, SURFACE_VY + lane], vz + own[b, SURFACE_VZ + lane]
                ux, uy, uz = ux + own[b, SURFACE_VX + lane], uy + own[b, SURFACE_VY + lane], uz + own[b, SURFACE_VZ + lane]
            push, slope, grip, drag = p[K] * rows[b, DEPTH + lane], p[K] * dt + p[CN], 1.0, 0.0
            if vary:
                push, slope, grip = rows[b, NORMAL_BIAS + lane], rows[b, NORMAL_SLOPE + lane], rows[b, FRICTION_SCALE + lane]
                drag = rows[b, EXTRA_VISCOSITY + lane]
            limit, push, stiff_n, bias, t, keep, gain = linearise_contact(
                nx, ny, nz, zx, zy, zz, push, slope, grip, drag, sticks, vx, vy, vz, dt, p
            )
            rows[b, LIMIT + lane], rows[b, KEEP + lane], rows[b, GAIN + lane] = limit, keep, gain
            e = stiff_n - t
            push += e * (ux * nx + uy * ny + uz * nz)
            fx = -push * nx - bias * zx - t * ux
            fy = -push * ny - bias * zy - t * uy
            fz = -push * nz - bias * zz - t * uz
            mx, my, mz = py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx
            ex, ey, ez = e * nx, e * ny, e * nz
            gx, gy, gz = e * mx, e * my, e * mz
            tx, ty, tz = t * px, t * py, t * pz
            square = tx * px + ty * py + tz * pz
            sums[0 * LANES + lane] += t + ex * nx
            sums[1 * LANES + lane] += ey * nx
            sums[2 * LANES + lane] += t + ey * ny
            sums[3 * LANES + lane] += ez * nx
            sums[4 * LANES + lane] += ez * ny
            sums[5 * LANES + lane] += t + ez * nz
            sums[6 * LANES + lane] += gx * nx
            sums[7 * LANES + lane] += gx * ny - tz
            sums[8 * LANES + lane] += gx * nz + ty
            sums[9 * LANES + lane] += gx * mx + square - tx * px
            sums[10 * LANES + lane] += gy * nx + tz
            sums[11 * LANES + lane] += gy * ny
            sums[12 * LANES + lane] += gy * nz - tx
            sums[13 * LANES + lane] += gy * mx - ty * px
            sums[14 * LANES + lane] += gy * my + square - ty * py
            sums[15 * LANES + lane] += gz * nx - ty
            sums[16 * LANES + lane] += gz * ny + tx
            sums[17 * LANES + lane] += gz * nz
            sums[18 * LANES + lane] += gz * mx - tz * px
            sums[19 * LANES + lane] += gz * my - tz * py
            sums[20 * LANES + lane] += gz * mz + square - tz * pz
            sums[21 * LANES + lane] += fx
            sums[22 * LANES + lane] += fy
            sums[23 * LANES + lane] += fz
            sums[24 * LANES + lane] += py * fz - pz * fy
            sums[25 * LANES + lane] += pz * fx - px * fz
            sums[26 * LANES + lane] += px * fy - py * fx
    for half in (8, 4, 2, 1):  # the lanes, in pairs
        for i in range(0, SUMS * LANES, LANES):
            for lane in range(half):
                sums[i + lane] += sums[i + lane + half]
