# SPDX-License-Identifier: GPL-3.0-or-later
"""What every texel feels in the present state (kernel)."""

from __future__ import annotations

import math

import numpy as np

from ..compiled.kernels import allocating_kernel
from ..laws.contact import (
    DEPTH,
    LANES,
    NX,
    NY,
    NZ,
    PX,
    PY,
    PZ,
    ZX,
    ZY,
    ZZ,
    bristle_rate,
    friction_force,
    max_bristle_deflection,
    normal_force,
)
from .detection.surface_kinematics import SURFACE_VX, SURFACE_VY, SURFACE_VZ
from .dynamics.effect_kernels import NOW, apply_effects, force_and_friction_law, has_effects, press_texel
from .dynamics.relative_kinematics import motion_values, pair_law, point_law, relative_motion, velocity_at


@allocating_kernel
def read_texels(model, state, workspace, force, shear, friction, depth, slip, contact, net, moment):
    """What every texel feels right now, from rows freshly gathered (Eq. 8, 9, 13); forces on the sensor, in its body's frame.

    `net` gets force and torque about the body's reference point, `moment` the sum of fn · point and of fn.
    """
    rows, points = workspace.rows, model.points
    strongest = np.full(len(force), -1.0)
    for pair in range(len(model.pairs)):
        sensor = model.pairs[pair, 0]
        a, b = model.sensor_body[sensor], model.target_body[model.pairs[pair, 1]]
        effects = has_effects(sensor, model.program)
        law, whole = pair_law(model.parameters, pair), 1.0 / model.weight[pair]
        relative_motion(a, b, workspace.twist, state.position, workspace.rotation, workspace.motion[pair])
        motion = motion_values(workspace.motion[pair])
        for r in range(workspace.contacts[pair]):
            block, lane = workspace.first_block[pair] + r // LANES, r % LANES
            point = model.point_first[pair] + workspace.slots[block, lane] - model.slot_start[pair]
            texel = model.texel[point]
            p = point_law(law, model.painted, point)
            nx, ny, nz = rows[block, NX + lane], rows[block, NY + lane], rows[block, NZ + lane]
            px, py, pz = rows[block, PX + lane], rows[block, PY + lane], rows[block, PZ + lane]
            vx, vy, vz = velocity_at(px, py, pz, motion)
            if workspace.moving[pair]:
                own = workspace.own
                vx, vy, vz = (
                    vx + own[block, SURFACE_VX + lane],
                    vy + own[block, SURFACE_VY + lane],
                    vz + own[block, SURFACE_VZ + lane],
                )
            rate = vx * nx + vy * ny + vz * nz
            tx, ty, tz = vx - rate * nx, vy - rate * ny, vz - rate * nz
            square = tx * tx + ty * ty + tz * tz
            fn = normal_force(rows[block, DEPTH + lane], rate, p)
            if effects:
                felt, offset = workspace.felt, model.point_first[pair] - model.slot_start[pair]
                press_texel(felt, block, LANES, lane, pair, rows[block, DEPTH + lane], rate, 0.0, math.sqrt(square), p, model)
                apply_effects(sensor, NOW, block, lane, 1, offset, p, model, state.memory, workspace.slots, felt)
                fn, p = force_and_friction_law(pair, block, lane, p, model, felt)
            zx, zy, zz = rows[block, ZX + lane], rows[block, ZY + lane], rows[block, ZZ + lane]
            length, limit = math.sqrt(zx * zx + zy * zy + zz * zz), max_bristle_deflection(fn, p)
            held = limit / length if length > limit else 1.0
            zx, zy, zz = held * zx, held * zy, held * zz
            # Friction drags the sensor along with the target; the target's surface normal points into the sensor.
            fx, fy, fz = 0.0, 0.0, 0.0
            if fn > 0.0:
                fx = friction_force(zx, bristle_rate(zx, tx, square, fn, p), tx, p)
                fy = friction_force(zy, bristle_rate(zy, ty, square, fn, p), ty, p)
                fz = friction_force(zz, bristle_rate(zz, tz, square, fn, p), tz, p)
            fx, fy, fz, fn = whole * fx, whole * fy, whole * fz, whole * fn
            friction[texel] += math.sqrt(fx * fx + fy * fy + fz * fz)
            # The whole force is what the texel's own plane gets its part of: where the object's surface leans, some is of fn.
            fx, fy, fz = fx + fn * nx, fy + fn * ny, fz + fn * nz
            shear[texel, 0] += fx * points[point, 6] + fy * points[point, 7] + fz * points[point, 8]
            shear[texel, 1] += fx * points[point, 9] + fy * points[point, 10] + fz * points[point, 11]
            if fn > strongest[texel]:  # the slip is that of the target and the point which press hardest
                strongest[texel] = fn
                slip[texel] = math.sqrt(square)
            contact[texel] = True
            force[texel] += fn
            depth[texel] = max(depth[texel], rows[block, DEPTH + lane])
            net[sensor, 0] += fx
            net[sensor, 1] += fy
            net[sensor, 2] += fz
            net[sensor, 3] += py * fz - pz * fy
            net[sensor, 4] += pz * fx - px * fz
            net[sensor, 5] += px * fy - py * fx
            moment[sensor, 0] += fn * px
            moment[sensor, 1] += fn * py
            moment[sensor, 2] += fn * pz
            moment[sensor, 3] += fn
