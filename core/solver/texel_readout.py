# SPDX-License-Identifier: GPL-3.0-or-later
"""What every texel feels in the present state (kernel)."""

from __future__ import annotations

import math

import numpy as np

from ..compiled.kernels import allocating
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
    bristle_limit,
    bristle_rate,
    friction_force,
    normal_force,
)
from .detection.surface_kinematics import OX, OY, OZ
from .dynamics.effect_kernels import NOW, force_and_law, has_effects, let_effects_act, press_texel
from .dynamics.relative_kinematics import law_of, painted_law, relative_motion, values, velocity_at


@allocating
def feel(world, state, scratch, force, shear, friction, depth, slip, contact, net, moment):
    """What every texel feels right now, from rows freshly gathered (Eq. 8, 9, 13); forces on the sensor, in its body's frame.

    `net` gets force and torque about the body's reference point, `moment` the sum of fn · point and of fn.
    """
    rows, points = scratch.rows, world.points
    strongest = np.full(len(force), -1.0)
    for pair in range(len(world.pairs)):
        sensor = world.pairs[pair, 0]
        a, b = world.sensor_body[sensor], world.target_body[world.pairs[pair, 1]]
        effects = has_effects(sensor, world.program)
        law, whole = law_of(world.parameters, pair), 1.0 / world.weight[pair]
        relative_motion(a, b, scratch.twist, state.position, scratch.rotation, scratch.motion[pair])
        motion = values(scratch.motion[pair])
        for r in range(scratch.contacts[pair]):
            block, lane = scratch.first_block[pair] + r // LANES, r % LANES
            point = world.point_first[pair] + scratch.slots[block, lane] - world.slot_start[pair]
            texel = world.texel[point]
            p = painted_law(law, world.painted, point)
            nx, ny, nz = rows[block, NX + lane], rows[block, NY + lane], rows[block, NZ + lane]
            px, py, pz = rows[block, PX + lane], rows[block, PY + lane], rows[block, PZ + lane]
            vx, vy, vz = velocity_at(px, py, pz, motion)
            if scratch.moving[pair]:
                own = scratch.own
                vx, vy, vz = vx + own[block, OX + lane], vy + own[block, OY + lane], vz + own[block, OZ + lane]
            rate = vx * nx + vy * ny + vz * nz
            tx, ty, tz = vx - rate * nx, vy - rate * ny, vz - rate * nz
            square = tx * tx + ty * ty + tz * tz
            fn = normal_force(rows[block, DEPTH + lane], rate, p)
            if effects:
                felt, offset = scratch.felt, world.point_first[pair] - world.slot_start[pair]
                press_texel(felt, block, LANES, lane, pair, rows[block, DEPTH + lane], rate, 0.0, math.sqrt(square), p, world)
                let_effects_act(sensor, NOW, block, lane, 1, offset, p, world, state.memory, scratch.slots, felt)
                fn, p = force_and_law(pair, block, lane, p, world, felt)
            zx, zy, zz = rows[block, ZX + lane], rows[block, ZY + lane], rows[block, ZZ + lane]
            length, limit = math.sqrt(zx * zx + zy * zy + zz * zz), bristle_limit(fn, p)
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
