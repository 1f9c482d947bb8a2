# SPDX-License-Identifier: GPL-3.0-or-later
"""One frame's substeps, and what the sensors feel at its end (kernels).

Velocities at the end of a substep are the unknowns of a linear system, implicit in the stiffness and damping of every contact,
so that a stiff or heavily damped contact needs no small step; positions follow with those velocities.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .bodies import (
    add_product,
    look_back,
    solve_positive,
    turn_quaternion,
    write_rotation,
    write_twist,
    write_twist_map,
    write_world_inertia,
)
from .contact import (
    DEPTH,
    GAIN,
    KEEP,
    LIMIT,
    NORMAL_FORCE,
    NX,
    NY,
    NZ,
    PUSH,
    PX,
    PY,
    PZ,
    ROW,
    STIFF_N,
    STIFF_T,
    ZX,
    ZY,
    ZZ,
    State,
    World,
    bristle_limit,
    bristle_rate,
    friction_bias,
    friction_force,
    gather,
    linearise,
    normal_force,
)
from .jit import kernel

PASSES = 40
"""Most rounds in which contacts are linearised anew within a substep; two or three are usual, one at rest."""


class Scratch(NamedTuple):
    """Working memory of the kernels, so that nothing is allocated inside the loop.

    Attributes
    ----------
    rotation, inertia : (b, 3, 3) float
        Orientation and world-axes inertia of each body.
    twist : (b, 12) float
        Velocity of each body's reference point and a matrix W (row by row): the points at arm r move by ``dt (V + W r)``.
    known : (b, 12) float
        The part of the twist that is not solved for.
    rows : (s, ROW) float
        One row per contact, those of a pair behind one another.
    slots : (s,) int
        Place of each row in the memory of :class:`.State`.
    pair_stop : (q,) int
        Where each pair's rows end.
    pose : (12,) float
        A relative pose.
    motion, part : (12,) float
        How a target's points move relative to a sensor, and the part of it that is not solved for: U, then W row by row.
    block, wrench : (6, 6), (6,) float
        What the contacts of one pair resist, and their force and torque on the target, both in the sensor's axes.
    map_a, map_b : (6, 6) float
        From the twists of both bodies to the relative motion.
    matrix, vector, momentum : (6 f, 6 f), (6 f,), (6 f,) float
        The linear system of the f free bodies.
    """

    rotation: np.ndarray
    inertia: np.ndarray
    twist: np.ndarray
    known: np.ndarray
    rows: np.ndarray
    slots: np.ndarray
    pair_stop: np.ndarray
    pose: np.ndarray
    motion: np.ndarray
    part: np.ndarray
    block: np.ndarray
    wrench: np.ndarray
    map_a: np.ndarray
    map_b: np.ndarray
    matrix: np.ndarray
    vector: np.ndarray
    momentum: np.ndarray


def scratch_for(world: World, state: State) -> Scratch:
    """Allocate the working memory of a run."""
    b, s = len(state.position), len(state.hint)
    twist = np.zeros((b, 12))
    for body in range(b):
        look_back(state.velocity[body], 1e-9, twist[body])
    n = 6 * max(1, int(world.free_at.max()) + 1)
    return Scratch(
        rotation=np.zeros((b, 3, 3)),
        inertia=np.zeros((b, 3, 3)),
        twist=twist,
        known=np.zeros((b, 12)),
        rows=np.zeros((s, ROW)),
        slots=np.zeros(s, np.int64),
        pair_stop=np.zeros(len(world.pairs), np.int64),
        pose=np.zeros(12),
        motion=np.zeros(12),
        part=np.zeros(12),
        block=np.zeros((6, 6)),
        wrench=np.zeros(6),
        map_a=np.zeros((6, 6)),
        map_b=np.zeros((6, 6)),
        matrix=np.zeros((n, n)),
        vector=np.zeros(n),
        momentum=np.zeros(n),
    )


@kernel
def _relative_motion(a, b, twist, position, rotation, motion):
    """How the points of body `b` move relative to body `a`, in the axes of `a`: ``v = U + W p`` (Eq. 3), written into `motion`.

    `p` is a point's place from the reference point of `a`. One motion serves all contacts of a pair.
    """
    for k in range(3):
        motion[k] = 0.0
        for m in range(3):
            motion[3 + 3 * k + m] = 0.0
    for i in range(3):
        u = twist[b, i] - twist[a, i]
        for j in range(3):
            u += twist[b, 3 + 3 * i + j] * (position[a, j] - position[b, j])
            w = twist[b, 3 + 3 * i + j] - twist[a, 3 + 3 * i + j]
            for k in range(3):
                for m in range(3):
                    motion[3 + 3 * k + m] += rotation[a, i, k] * w * rotation[a, j, m]
        for k in range(3):
            motion[k] += rotation[a, i, k] * u


@kernel
def _values(motion):
    """The twelve numbers of a motion as a tuple: the compiler keeps them in registers, which it may not do with an array's."""
    return (
        motion[0], motion[1], motion[2], motion[3], motion[4], motion[5],
        motion[6], motion[7], motion[8], motion[9], motion[10], motion[11],
    )  # fmt: skip


@kernel
def _law(parameters, pair):
    """A pair's parameters as a tuple, for the same reason."""
    return (
        parameters[pair, 0], parameters[pair, 1], parameters[pair, 2], parameters[pair, 3],
        parameters[pair, 4], parameters[pair, 5], parameters[pair, 6], parameters[pair, 7],
        parameters[pair, 8], parameters[pair, 9],
    )  # fmt: skip


@kernel
def _painted_law(p, painted, point):
    """A sensor's parameters with the multipliers of one of its contact points; `p` itself where nothing is painted."""
    if len(painted) == 0:
        return p
    k, friction = painted[point, 0], painted[point, 1]
    return (p[0] * k, p[1] * k, p[2], p[3], p[4], p[5], p[6] * friction, p[7] * friction, p[8], p[9])


@kernel
def _velocity(rows, r, motion):
    """Velocity of the target at a contact point relative to the sensor, in the axes of the sensor's body."""
    px, py, pz = rows[r, PX], rows[r, PY], rows[r, PZ]
    return (
        motion[0] + motion[3] * px + motion[4] * py + motion[5] * pz,
        motion[1] + motion[6] * px + motion[7] * py + motion[8] * pz,
        motion[2] + motion[9] * px + motion[10] * py + motion[11] * pz,
    )


@kernel
def gather_all(world, tree, neighbours, state, scratch):
    """Contacts of all pairs of sensor and target where the bodies are now. Returns how many points are sunk too deep to act."""
    for body in range(len(state.position)):
        write_rotation(state.quaternion[body], scratch.rotation[body])
    used, sunk = 0, 0
    for pair in range(len(world.pairs)):
        used, deep = gather(
            pair, world, tree, neighbours, state, scratch.rotation, scratch.rows, scratch.slots, used, scratch.pose
        )
        sunk += deep
        scratch.pair_stop[pair] = used
    return sunk


@kernel
def _solve_velocities(dt, world, state, scratch):
    """Velocities of the free bodies at the step's end, written into the state.

    Contacts are linearised at the current guess and the linear system solved, until the guess no longer moves; a contact that
    would pull is left out of the next round. Where the rounds go in circles (friction that was guessed for too much load throws
    the contact off, without the contact there is no friction), the guess moves by a share of the way only. All that a share
    mixes keeps the momentum. With no free body one round only linearises.
    """
    free_at, mass, velocity, inertia = world.free_at, world.mass, state.velocity, scratch.inertia
    matrix, vector, momentum = scratch.matrix, scratch.vector, scratch.momentum
    n = 6 * int(free_at.max() + 1)
    for body in range(len(free_at)):
        write_twist(velocity[body], dt, scratch.twist[body])
        at = 6 * free_at[body]
        if at >= 0:
            for i in range(3):
                momentum[at + i] = mass[body] * (velocity[body, i] + dt * world.gravity[i])
                total = 0.0
                for j in range(3):
                    total += inertia[body, i, j] * velocity[body, 3 + j]
                momentum[at + 3 + i] = total
    first_change, last_change, share = 0.0, 0.0, 1.0
    for turn in range(PASSES):
        for body in range(len(free_at)):
            _write_known(velocity[body], scratch.twist[body], free_at[body] < 0, scratch.known[body])
        for i in range(n):
            vector[i] = momentum[i]
            for j in range(n):
                matrix[i, j] = 0.0
        start = 0
        for pair in range(len(world.pairs)):
            a, b = world.sensor_body[world.pairs[pair, 0]], world.target_body[world.pairs[pair, 1]]
            stop = scratch.pair_stop[pair]
            if start < stop:
                _relative_motion(a, b, scratch.twist, state.position, scratch.rotation, scratch.motion)
                _relative_motion(a, b, scratch.known, state.position, scratch.rotation, scratch.part)
                first = world.point_start[world.pairs[pair, 0]] - world.slot_start[pair]
                _sum_contacts(start, stop, dt, _law(world.parameters, pair), world.painted, first, scratch)
                if free_at[a] >= 0 or free_at[b] >= 0:
                    _add_pair(a, b, dt, world, state, scratch)
            start = stop
        if n == 0:
            return
        for body in range(len(free_at)):
            at = 6 * free_at[body]
            if at >= 0:
                for i in range(3):
                    matrix[at + i, at + i] += mass[body]
                    for j in range(i + 1):
                        matrix[at + 3 + i, at + 3 + j] += inertia[body, i, j]
        solve_positive(matrix, vector, n)
        change = 0.0
        for body in range(len(free_at)):
            at = 6 * free_at[body]
            if at >= 0:
                for i in range(6):
                    change = max(change, abs(vector[at + i] - velocity[body, i]))
        # Contacts that come on and off in the first rounds find their own way; later ones shrink by 1 - share if all is well.
        if turn > 3 and change > (1.0 - 0.25 * share) * last_change:
            share *= 0.5
        last_change = change
        for body in range(len(free_at)):
            at = 6 * free_at[body]
            if at >= 0:
                for i in range(6):
                    velocity[body, i] = share * vector[at + i] + (1.0 - share) * velocity[body, i]
                write_twist(velocity[body], dt, scratch.twist[body])
        if turn == 0:
            first_change = change
        if change <= 1e-6 * first_change or change < 1e-13:
            return


@kernel
def _sum_contacts(start, stop, dt, law, painted, first, scratch):
    """Linearise the contacts of a pair, and sum their forces on the target and what they resist.

    The contact point of a row is `first` plus its slot.

    With a contact's damping tensor ``C = ct 1 + (cn - ct) n nᵀ`` and velocities ``v + ω × p`` the block is the sum of
    ``Jᵀ C J``, its lower triangle; the wrench is what the springs and the known part of the motion do.
    """
    rows, block, wrench = scratch.rows, scratch.block, scratch.wrench
    motion, part = _values(scratch.motion), _values(scratch.part)
    a00, a10, a11, a20, a21, a22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    b00, b01, b02, b10, b11, b12, b20, b21, b22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    c00, c10, c11, c20, c21, c22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    sx, sy, sz, qx, qy, qz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for r in range(start, stop):
        p = _painted_law(law, painted, first + scratch.slots[r])
        vx, vy, vz = _velocity(rows, r, motion)
        linearise(rows, r, vx, vy, vz, dt, p)
        if rows[r, NORMAL_FORCE] <= 0.0:
            continue
        nx, ny, nz = rows[r, NX], rows[r, NY], rows[r, NZ]
        px, py, pz = rows[r, PX], rows[r, PY], rows[r, PZ]
        t = rows[r, STIFF_T]
        e = rows[r, STIFF_N] - t
        ux, uy, uz = _velocity(rows, r, part)
        push = rows[r, PUSH] + e * (ux * nx + uy * ny + uz * nz)
        stick = friction_bias(rows, r, dt, p)
        fx = -push * nx - stick * rows[r, ZX] - t * ux
        fy = -push * ny - stick * rows[r, ZY] - t * uy
        fz = -push * nz - stick * rows[r, ZZ] - t * uz
        sx += fx
        sy += fy
        sz += fz
        qx += py * fz - pz * fy
        qy += pz * fx - px * fz
        qz += px * fy - py * fx
        mx, my, mz = py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx
        ex, ey, ez = e * nx, e * ny, e * nz
        gx, gy, gz = e * mx, e * my, e * mz
        tx, ty, tz = t * px, t * py, t * pz
        square = tx * px + ty * py + tz * pz
        a00 += t + ex * nx
        a10 += ey * nx
        a11 += t + ey * ny
        a20 += ez * nx
        a21 += ez * ny
        a22 += t + ez * nz
        # Lower-left block: [p]× C.
        b00 += gx * nx
        b01 += gx * ny - tz
        b02 += gx * nz + ty
        b10 += gy * nx + tz
        b11 += gy * ny
        b12 += gy * nz - tx
        b20 += gz * nx - ty
        b21 += gz * ny + tx
        b22 += gz * nz
        c00 += gx * mx + square - tx * px
        c10 += gy * mx - ty * px
        c11 += gy * my + square - ty * py
        c20 += gz * mx - tz * px
        c21 += gz * my - tz * py
        c22 += gz * mz + square - tz * pz
    block[0, 0], block[1, 0], block[1, 1], block[2, 0], block[2, 1], block[2, 2] = a00, a10, a11, a20, a21, a22
    block[3, 0], block[3, 1], block[3, 2] = b00, b01, b02
    block[4, 0], block[4, 1], block[4, 2] = b10, b11, b12
    block[5, 0], block[5, 1], block[5, 2] = b20, b21, b22
    block[3, 3], block[4, 3], block[4, 4], block[5, 3], block[5, 4], block[5, 5] = c00, c10, c11, c20, c21, c22
    wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5] = sx, sy, sz, qx, qy, qz


@kernel
def _add_pair(a, b, dt, world, state, scratch):
    """Bring a pair's sums into the linear system of the free bodies."""
    at_a, at_b = 6 * world.free_at[a], 6 * world.free_at[b]
    map_a, map_b, block, wrench = scratch.map_a, scratch.map_b, scratch.block, scratch.wrench
    write_twist_map(scratch.rotation[a], 0.0, 0.0, 0.0, -1.0, map_a)
    gx = state.position[a, 0] - state.position[b, 0]
    gy = state.position[a, 1] - state.position[b, 1]
    gz = state.position[a, 2] - state.position[b, 2]
    write_twist_map(scratch.rotation[a], gx, gy, gz, 1.0, map_b)
    for i in range(6):
        for j in range(6):
            if at_a >= 0:
                scratch.vector[at_a + i] += dt * map_a[j, i] * wrench[j]
            if at_b >= 0:
                scratch.vector[at_b + i] += dt * map_b[j, i] * wrench[j]
    if at_a >= 0:
        add_product(scratch.matrix, at_a, at_a, map_a, block, map_a, dt)
    if at_b >= 0:
        add_product(scratch.matrix, at_b, at_b, map_b, block, map_b, dt)
    if at_a >= 0 and at_b >= 0:  # only the lower triangle of the system is read
        if at_a > at_b:
            add_product(scratch.matrix, at_a, at_b, map_a, block, map_b, dt)
        else:
            add_product(scratch.matrix, at_b, at_a, map_b, block, map_a, dt)


@kernel
def _write_known(velocity, twist, keyframed, known):
    """What the system does not solve for: all of a keyframed twist, a finite turn's excess over ``ω × r`` of a free one."""
    for i in range(12):
        known[i] = twist[i]
    if not keyframed:
        for i in range(3):
            known[i] = 0.0
        known[4] += velocity[5]
        known[5] -= velocity[4]
        known[6] -= velocity[5]
        known[8] += velocity[3]
        known[9] += velocity[4]
        known[10] -= velocity[3]


@kernel
def _store_bristles(dt, world, state, scratch):
    """Bristle deflections at the step's end, as the sensor sees them then."""
    rows, motion, seen, start = scratch.rows, scratch.motion, scratch.part, 0
    for pair in range(len(world.pairs)):
        stop = scratch.pair_stop[pair]
        if start < stop:
            a, b = world.sensor_body[world.pairs[pair, 0]], world.target_body[world.pairs[pair, 1]]
            _relative_motion(a, b, scratch.twist, state.position, scratch.rotation, motion)
            _seen_at_the_end(a, dt, scratch.twist, scratch.rotation, motion, seen)
        values = _values(seen)
        for r in range(start, stop):
            vx, vy, vz = _velocity(rows, r, values)
            out = vx * rows[r, NX] + vy * rows[r, NY] + vz * rows[r, NZ]
            zx = rows[r, KEEP] * rows[r, ZX] + rows[r, GAIN] * (vx - out * rows[r, NX])
            zy = rows[r, KEEP] * rows[r, ZY] + rows[r, GAIN] * (vy - out * rows[r, NY])
            zz = rows[r, KEEP] * rows[r, ZZ] + rows[r, GAIN] * (vz - out * rows[r, NZ])
            square = zx * zx + zy * zy + zz * zz
            if square > rows[r, LIMIT] * rows[r, LIMIT]:
                scale = rows[r, LIMIT] / math.sqrt(square)
                zx, zy, zz = scale * zx, scale * zy, scale * zz
            slot = scratch.slots[r]
            state.bristles[slot, 0], state.bristles[slot, 1], state.bristles[slot, 2] = zx, zy, zz
        start = stop


@kernel
def _seen_at_the_end(a, dt, twist, rotation, motion, seen):
    """Turn a relative motion by what the sensor itself turns during the step, ``(1 + dt W)ᵀ`` in its own axes."""
    for i in range(12):
        seen[i] = motion[i]
    for k in range(3):
        for m in range(3):
            turn = 0.0  # entry (m, k) of the sensor's W in its own axes
            for i in range(3):
                for j in range(3):
                    turn += rotation[a, i, m] * twist[a, 3 + 3 * i + j] * rotation[a, j, k]
            seen[k] += dt * turn * motion[m]
            for j in range(3):
                seen[3 + 3 * k + j] += dt * turn * motion[3 + 3 * m + j]


@kernel
def advance_frame(dt, path_position, path_quaternion, path_velocity, world, tree, neighbours, state, scratch):
    """Run the substeps of one frame; the state is brought forward in place.

    Parameters
    ----------
    dt : float, seconds
    path_position, path_quaternion : (steps + 1, b, 3) and (steps + 1, b, 4) float
        Where the keyframed bodies are at the beginning of each step, and at the end of the last.
    path_velocity : (steps, b, 6) float
        Their velocities during each step.

    Returns
    -------
    sunk : int
        Most contact points that were sunk too deep to act in any one step.
    """
    worst = 0
    for step in range(len(path_velocity)):
        _place_keyframed(step, path_position, path_quaternion, world, state)
        for body in range(len(world.free_at)):
            if world.free_at[body] < 0:
                for i in range(6):
                    state.velocity[body, i] = path_velocity[step, body, i]
        worst = max(worst, gather_all(world, tree, neighbours, state, scratch))
        for body in range(len(world.free_at)):
            if world.free_at[body] >= 0:
                write_world_inertia(scratch.rotation[body], world.inertia[body], scratch.inertia[body])
        _solve_velocities(dt, world, state, scratch)
        _store_bristles(dt, world, state, scratch)
        for body in range(len(world.free_at)):
            if world.free_at[body] >= 0:
                _move_free(body, dt, world, state, scratch)
    _place_keyframed(len(path_velocity), path_position, path_quaternion, world, state)
    for body in range(len(world.free_at)):
        look_back(state.velocity[body], dt, scratch.twist[body])
    return worst


@kernel
def _place_keyframed(step, path_position, path_quaternion, world, state):
    for body in range(len(world.free_at)):
        if world.free_at[body] < 0:
            for i in range(3):
                state.position[body, i] = path_position[step, body, i]
            for i in range(4):
                state.quaternion[body, i] = path_quaternion[step, body, i]


@kernel
def _move_free(body, dt, world, state, scratch):
    """Move a free body with its new velocity. What nothing touches keeps its angular momentum exactly."""
    velocity, inertia, vector = state.velocity[body], scratch.inertia[body], scratch.vector
    for i in range(3):
        state.position[body, i] += dt * velocity[i]
        vector[i] = inertia[i, 0] * velocity[3] + inertia[i, 1] * velocity[4] + inertia[i, 2] * velocity[5]
    turn_quaternion(state.quaternion[body], dt * velocity[3], dt * velocity[4], dt * velocity[5])
    write_rotation(state.quaternion[body], scratch.rotation[body])
    write_world_inertia(scratch.rotation[body], world.inertia[body], inertia)
    for i in range(3):
        for j in range(i + 1):
            scratch.matrix[i, j] = inertia[i, j]
    solve_positive(scratch.matrix, vector, 3)
    for i in range(3):
        velocity[3 + i] = vector[i]


@kernel
def feel(world, state, scratch, force, shear, depth, slip, contact, net, moment):
    """What every texel feels right now, from rows freshly gathered (Eq. 8, 9, 13); forces on the sensor, in its body's frame.

    `net` gets force and torque about the body's reference point, `moment` the sum of fn · point and of fn.
    """
    rows, points, start = scratch.rows, world.points, 0
    strongest = np.full(len(force), -1.0)
    for pair in range(len(world.pairs)):
        sensor = world.pairs[pair, 0]
        a, b = world.sensor_body[sensor], world.target_body[world.pairs[pair, 1]]
        law = _law(world.parameters, pair)
        _relative_motion(a, b, scratch.twist, state.position, scratch.rotation, scratch.motion)
        for r in range(start, scratch.pair_stop[pair]):
            point = world.point_start[sensor] + scratch.slots[r] - world.slot_start[pair]
            texel = world.texel[point]
            p = _painted_law(law, world.painted, point)
            nx, ny, nz = rows[r, NX], rows[r, NY], rows[r, NZ]
            vx, vy, vz = _velocity(rows, r, scratch.motion)
            rate = vx * nx + vy * ny + vz * nz
            tx, ty, tz = vx - rate * nx, vy - rate * ny, vz - rate * nz
            square = tx * tx + ty * ty + tz * tz
            fn = normal_force(rows[r, DEPTH], rate, p)
            zx, zy, zz = rows[r, ZX], rows[r, ZY], rows[r, ZZ]
            length, limit = math.sqrt(zx * zx + zy * zy + zz * zz), bristle_limit(fn, p)
            held = limit / length if length > limit else 1.0
            zx, zy, zz = held * zx, held * zy, held * zz
            # Friction drags the sensor along with the target; the target's surface normal points into the sensor.
            fx, fy, fz = 0.0, 0.0, 0.0
            if fn > 0.0:
                fx = friction_force(zx, bristle_rate(zx, tx, square, fn, p), tx, p)
                fy = friction_force(zy, bristle_rate(zy, ty, square, fn, p), ty, p)
                fz = friction_force(zz, bristle_rate(zz, tz, square, fn, p), tz, p)
            shear[texel, 0] += fx * points[point, 6] + fy * points[point, 7] + fz * points[point, 8]
            shear[texel, 1] += fx * points[point, 9] + fy * points[point, 10] + fz * points[point, 11]
            fx, fy, fz = fx + fn * nx, fy + fn * ny, fz + fn * nz
            if fn > strongest[texel]:  # the slip is that of the target and the point which press hardest
                strongest[texel] = fn
                slip[texel] = math.sqrt(square)
            contact[texel] = True
            force[texel] += fn
            depth[texel] = max(depth[texel], rows[r, DEPTH])
            px, py, pz = rows[r, PX], rows[r, PY], rows[r, PZ]
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
        start = scratch.pair_stop[pair]
