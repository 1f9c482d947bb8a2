# SPDX-License-Identifier: GPL-3.0-or-later
"""The contact law of one texel: penalty normal force and LuGre friction (paper, section 3.2, with its errata).

Where the print is wrong or silent, this is what is computed (docs/model.md has the whole story):

* Eq. 8: with `d` the penetration and ḋ its rate, ``fn = max(k d + cn ḋ, 0)``, along the object's surface normal. No adhesion.
* Eq. 10: ``g = fn (mud + (mus - mud) exp(-|v|² / x0²))``; the exponential was lost in print.
* Eq. 9, 13 as printed: ``ż = v - sigma0 |v| / g · z`` and ``ft = sigma0 z + sigma1 ż + ct v``.
* The bristle deflection is carried along as the texel and the surface under it turn, and never exceeds what static friction
  can hold (``sigma0 |z| ≤ mus fn``): where the normal force falls faster than the bristles can slide, Eq. 9 alone would leave
  friction without a normal force.

Over a substep the relative velocity is taken as constant, for which Eq. 9 has a closed solution: no step size makes it blow up.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .bvh import segment_entry
from .jit import kernel

# Columns of a contact row. One row per touching texel and target; the row is all that the solver's inner loop reads.
NORMAL, ARM_A, ARM_B, DEPTH, BRISTLE = 0, 3, 6, 9, 10  # unit vector on the object, lever arms (m), m, m
START, KEEP, GAIN, LIMIT = 13, 14, 15, 16  # z(t) = START z, z(t + dt) = KEEP z + GAIN v, LIMIT = largest |z|
NORMAL_FORCE, STIFF_N, STIFF_T = 17, 18, 19  # N at the step's end; d force / d velocity, N·s/m
ROW = 20

# Columns of a parameter row, one per sensor or pad.
K, CN, CT, SIGMA0, SIGMA1, X0, MUS, MUD = range(8)


class World(NamedTuple):
    """What does not change during a run: b bodies, m sensors with N texels together, q pairs of sensor and target.

    Attributes
    ----------
    texels : (N, 12) float
        Position, normal, x axis and y axis of each texel, in its body's frame and relative to the body's reference point.
    texel_start : (m + 1,) int
    parameters : (m, 8) float
    reach : (m,) float, metres
        Maximum penetration.
    pairs : (q, 2) int
        Sensor and target.
    sensor_body : (m,) int
    target_body : (targets,) int
    slot_start : (q,) int
        Where each pair's memory begins.
    free_at : (b,) int
        Place of each free body among the free ones, -1 for keyframed bodies.
    mass : (b,) float, kg
    inertia : (b, 3, 3) float, kg·m², body axes
    gravity : (3,) float, m/s²
    """

    texels: np.ndarray
    texel_start: np.ndarray
    parameters: np.ndarray
    reach: np.ndarray
    pairs: np.ndarray
    sensor_body: np.ndarray
    target_body: np.ndarray
    slot_start: np.ndarray
    free_at: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray
    gravity: np.ndarray


class State(NamedTuple):
    """What a run carries from step to step; copied, it is a checkpoint.

    Attributes
    ----------
    position : (b, 3) float, metres
        Reference point of each body: centre of mass of a free one, origin of a keyframed one.
    quaternion : (b, 4) float
    velocity : (b, 6) float
        Linear (m/s) and angular (rad/s), world axes.
    hint : (s,) int
        Triangle each texel met last, -1 for none, -2 once it was pressed past its reach.
    bristles : (s, 4) float
        Bristle deflection (m) in the frame of the sensor's body, and the share of the reach that is pressed in.
    """

    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    hint: np.ndarray
    bristles: np.ndarray


@kernel
def stribeck(speed_squared, parameters):
    """Friction coefficient of steady sliding, mud + (mus - mud) exp(-|v|²/x0²) (Eq. 10–12 divided by fn)."""
    x0 = parameters[X0]
    return parameters[MUD] + (parameters[MUS] - parameters[MUD]) * math.exp(-speed_squared / (x0 * x0))


@kernel
def bristle_step(speed_squared, normal_force, dt, parameters):
    """Solve Eq. 9 over `dt` at constant velocity: z(t + dt) = keep · z(t) + gain · v.

    Returns
    -------
    keep : float
    gain : float, seconds
    """
    if normal_force <= 0.0:
        return 0.0, 0.0
    g = normal_force * stribeck(speed_squared, parameters)
    if g <= 0.0:  # frictionless: nothing holds the bristles
        return 0.0, 0.0
    x = parameters[SIGMA0] * math.sqrt(speed_squared) / g * dt
    if x < 1e-12:
        return 1.0 - x, dt
    keep = math.exp(-x)
    return keep, -math.expm1(-x) / x * dt


@kernel
def bristle_limit(normal_force, parameters):
    """Largest bristle deflection that static friction holds, metres."""
    return max(normal_force, 0.0) * parameters[MUS] / parameters[SIGMA0]


@kernel
def friction_force(z, bristle_rate, velocity, parameters):
    """One component of Eq. 13."""
    return parameters[SIGMA0] * z + parameters[SIGMA1] * bristle_rate + parameters[CT] * velocity


@kernel
def bristle_rate(z, velocity, speed_squared, normal_force, parameters):
    """One component of Eq. 9."""
    g = normal_force * stribeck(speed_squared, parameters)
    if g <= 0.0:
        return 0.0
    return velocity - parameters[SIGMA0] * math.sqrt(speed_squared) / g * z


@kernel
def normal_force(depth, rate, parameters):
    """Eq. 8 without adhesion."""
    return max(parameters[K] * depth + parameters[CN] * rate, 0.0)


@kernel
def gather(pair, world, tree, state, rotation, rows, slots, used):
    """Collect the contacts of one sensor with one target as rows behind the `used` rows that are there already.

    The segment of a texel runs from its vertex `reach` deep into the sensor; where it enters the target counts. Memory of the
    pair in `state` is brought up to date: the triangle met, and the bristles, which are zero where nothing touches.

    Parameters
    ----------
    pair : int
    world : World
    tree : Tree
    state : State
    rotation : (b, 3, 3) float
        Orientation of each body.
    rows : (s, ROW) float
    slots : (s,) int
        Written: which place in the memory each row belongs to.

    Returns
    -------
    used : int
        Rows in use now.
    sunk : int
        Texels that were pressed past their maximum penetration and do not act.
    """
    sensor, target = world.pairs[pair, 0], world.pairs[pair, 1]
    a, b = world.sensor_body[sensor], world.target_body[target]
    position_a, rotation_a, position_b, rotation_b = state.position[a], rotation[a], state.position[b], rotation[b]
    hint, bristles, reach = state.hint, state.bristles, world.reach[sensor]
    slot = world.slot_start[pair] - 1
    ra00, ra01, ra02 = rotation_a[0, 0], rotation_a[0, 1], rotation_a[0, 2]
    ra10, ra11, ra12 = rotation_a[1, 0], rotation_a[1, 1], rotation_a[1, 2]
    ra20, ra21, ra22 = rotation_a[2, 0], rotation_a[2, 1], rotation_a[2, 2]
    rb00, rb01, rb02 = rotation_b[0, 0], rotation_b[0, 1], rotation_b[0, 2]
    rb10, rb11, rb12 = rotation_b[1, 0], rotation_b[1, 1], rotation_b[1, 2]
    rb20, rb21, rb22 = rotation_b[2, 0], rotation_b[2, 1], rotation_b[2, 2]
    gx, gy, gz = position_a[0] - position_b[0], position_a[1] - position_b[1], position_a[2] - position_b[2]
    root = tree.bounds[tree.roots[target]]
    sunk = 0
    for texel in range(world.texel_start[sensor], world.texel_start[sensor + 1]):
        slot += 1
        row = world.texels[texel]
        # Lever arm of the texel and its normal in world axes, then both in the target's frame.
        ax = ra00 * row[0] + ra01 * row[1] + ra02 * row[2]
        ay = ra10 * row[0] + ra11 * row[1] + ra12 * row[2]
        az = ra20 * row[0] + ra21 * row[1] + ra22 * row[2]
        nx = ra00 * row[3] + ra01 * row[4] + ra02 * row[5]
        ny = ra10 * row[3] + ra11 * row[4] + ra12 * row[5]
        nz = ra20 * row[3] + ra21 * row[4] + ra22 * row[5]
        wx, wy, wz = gx + ax, gy + ay, gz + az
        tx = rb00 * wx + rb10 * wy + rb20 * wz
        ty = rb01 * wx + rb11 * wy + rb21 * wz
        tz = rb02 * wx + rb12 * wy + rb22 * wz
        dx = reach * (rb00 * nx + rb10 * ny + rb20 * nz)
        dy = reach * (rb01 * nx + rb11 * ny + rb21 * nz)
        dz = reach * (rb02 * nx + rb12 * ny + rb22 * nz)
        ox, oy, oz = tx - dx, ty - dy, tz - dz
        met, triangle, leaving = 2.0, -1, 2.0
        outside = (
            min(ox, tx) > root[3] or max(ox, tx) < root[0]
            or min(oy, ty) > root[4] or max(oy, ty) < root[1]
            or min(oz, tz) > root[5] or max(oz, tz) < root[2]
        )  # fmt: skip
        before = hint[slot]
        if not outside:
            met, triangle, leaving = segment_entry(ox, oy, oz, dx, dy, dz, target, before, tree)
        if triangle < 0:
            # Sunk: the base is inside the object. Either the segment leaves it somewhere, or the object's surface has just run
            # past the base (it was within the last tenth of the reach a step ago) and has not come back since.
            ran_past = not outside and (before == -2 or (before >= 0 and bristles[slot, 3] > 0.9))
            if leaving <= 1.0 or ran_past:
                sunk += 1
                hint[slot] = -2
            else:
                hint[slot] = -1
            bristles[slot, 0] = 0.0
            bristles[slot, 1] = 0.0
            bristles[slot, 2] = 0.0
            bristles[slot, 3] = 0.0
            continue
        hint[slot] = triangle
        normal = tree.normals[triangle]
        cx = rb00 * normal[0] + rb01 * normal[1] + rb02 * normal[2]
        cy = rb10 * normal[0] + rb11 * normal[1] + rb12 * normal[2]
        cz = rb20 * normal[0] + rb21 * normal[1] + rb22 * normal[2]
        back = (1.0 - met) * reach  # distance from the texel's tip to the intersection, along the texel's normal
        depth = back * abs(nx * cx + ny * cy + nz * cz)
        out = rows[used]
        out[0], out[1], out[2] = cx, cy, cz
        out[3], out[4], out[5] = ax - back * nx, ay - back * ny, az - back * nz
        out[6], out[7], out[8] = out[3] + gx, out[4] + gy, out[5] + gz
        out[9] = depth
        bristles[slot, 3] = back / reach
        # The bristle turns with the sensor; what the surface's turn makes stand out of its plane is laid back into it.
        bx, by, bz = bristles[slot, 0], bristles[slot, 1], bristles[slot, 2]
        zx = ra00 * bx + ra01 * by + ra02 * bz
        zy = ra10 * bx + ra11 * by + ra12 * bz
        zz = ra20 * bx + ra21 * by + ra22 * bz
        out_of_plane = zx * cx + zy * cy + zz * cz
        length = zx * zx + zy * zy + zz * zz
        zx -= out_of_plane * cx
        zy -= out_of_plane * cy
        zz -= out_of_plane * cz
        flat = zx * zx + zy * zy + zz * zz
        scale = math.sqrt(length / flat) if flat > 0.0 else 0.0
        out[10], out[11], out[12] = scale * zx, scale * zy, scale * zz
        slots[used] = slot
        used += 1
    return used, sunk


@kernel
def linearise(row, vx, vy, vz, dt, parameters):
    """Write into a contact row how its force depends on the relative velocity at the step's end, near velocity `v`.

    The force on the target is ``-(k d + STIFF_N ḋ) n - (bias + STIFF_T v_t)``; `v` is the target's velocity relative to the
    sensor, metres per second.
    """
    rate = vx * row[0] + vy * row[1] + vz * row[2]
    tx, ty, tz = vx - rate * row[0], vy - rate * row[1], vz - rate * row[2]
    stiff = parameters[K] * dt + parameters[CN]
    force = parameters[K] * row[DEPTH] + stiff * rate
    if force <= 0.0:  # separates within the step: no force at all
        for column in range(START, ROW):
            row[column] = 0.0
        return
    limit = bristle_limit(force, parameters)
    length = math.sqrt(row[10] * row[10] + row[11] * row[11] + row[12] * row[12])
    held = limit / length if length > limit else 1.0  # the load fell: what can no longer be held has slipped already
    keep, gain = bristle_step(tx * tx + ty * ty + tz * tz, force, dt, parameters)
    keep *= held
    zx, zy, zz = keep * row[10] + gain * tx, keep * row[11] + gain * ty, keep * row[12] + gain * tz
    length = math.sqrt(zx * zx + zy * zy + zz * zz)
    if length > limit:  # the closed solution for constant velocity would overshoot: slide at the limit instead
        keep *= limit / length
        gain *= limit / length
    row[START], row[KEEP], row[GAIN], row[LIMIT] = held, keep, gain, limit
    row[NORMAL_FORCE], row[STIFF_N] = force, stiff
    row[STIFF_T] = (parameters[SIGMA0] + parameters[SIGMA1] / dt) * gain + parameters[CT]


@kernel
def friction_bias(row, dt, parameters):
    """Factor of the old bristle deflection in the friction force of the step, N/m."""
    return parameters[SIGMA0] * row[KEEP] + parameters[SIGMA1] * (row[KEEP] - row[START]) / dt
