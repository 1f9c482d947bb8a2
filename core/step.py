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
    add_cross_block,
    add_own_block,
    add_wrench,
    look_back,
    solve_positive,
    turn_quaternion,
    write_rotation,
    write_twist,
    write_world_inertia,
)
from .contact import (
    ARM_A,
    ARM_B,
    DEPTH,
    GAIN,
    KEEP,
    LIMIT,
    NORMAL_FORCE,
    ROW,
    STIFF_N,
    STIFF_T,
    K,
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

PASSES = 12
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
        matrix=np.zeros((n, n)),
        vector=np.zeros(n),
        momentum=np.zeros(n),
    )


@kernel
def _relative_velocity(rows, r, twist, a, b):
    """Velocity of the target's point relative to the sensor's, world axes (Eq. 3)."""
    return (
        twist[b, 0]
        + twist[b, 3] * rows[r, 6]
        + twist[b, 4] * rows[r, 7]
        + twist[b, 5] * rows[r, 8]
        - twist[a, 0]
        - twist[a, 3] * rows[r, 3]
        - twist[a, 4] * rows[r, 4]
        - twist[a, 5] * rows[r, 5],
        twist[b, 1]
        + twist[b, 6] * rows[r, 6]
        + twist[b, 7] * rows[r, 7]
        + twist[b, 8] * rows[r, 8]
        - twist[a, 1]
        - twist[a, 6] * rows[r, 3]
        - twist[a, 7] * rows[r, 4]
        - twist[a, 8] * rows[r, 5],
        twist[b, 2]
        + twist[b, 9] * rows[r, 6]
        + twist[b, 10] * rows[r, 7]
        + twist[b, 11] * rows[r, 8]
        - twist[a, 2]
        - twist[a, 9] * rows[r, 3]
        - twist[a, 10] * rows[r, 4]
        - twist[a, 11] * rows[r, 5],
    )


@kernel
def gather_all(world, tree, neighbours, state, scratch):
    """Contacts of all pairs of sensor and target where the bodies are now. Returns how many texels are sunk too deep to act."""
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
    would pull is left out of the next round. With no free body one round only linearises.
    """
    free_at, mass, velocity, inertia = world.free_at, world.mass, state.velocity, scratch.inertia
    matrix, vector, momentum, rows = scratch.matrix, scratch.vector, scratch.momentum, scratch.rows
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
    first_change = 0.0
    for turn in range(PASSES):
        for body in range(len(free_at)):
            _write_known(velocity[body], scratch.twist[body], free_at[body] < 0, scratch.known[body])
        for i in range(n):
            vector[i] = momentum[i]
            for j in range(n):
                matrix[i, j] = 0.0
        start = 0
        for pair in range(len(world.pairs)):
            sensor = world.pairs[pair, 0]
            a, b = world.sensor_body[sensor], world.target_body[world.pairs[pair, 1]]
            at_a, at_b = 6 * free_at[a], 6 * free_at[b]
            p = world.parameters[sensor]
            stop = scratch.pair_stop[pair]
            sx, sy, sz, qx, qy, qz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0  # force and torque on the target
            for r in range(start, stop):
                vx, vy, vz = _relative_velocity(rows, r, scratch.twist, a, b)
                linearise(rows, r, vx, vy, vz, dt, p)
                if rows[r, NORMAL_FORCE] <= 0.0:
                    continue
                # What the known part of the motion and the stored springs do to the target; the sensor gets the opposite.
                ux, uy, uz = _relative_velocity(rows, r, scratch.known, a, b)
                out = ux * rows[r, 0] + uy * rows[r, 1] + uz * rows[r, 2]
                push = p[K] * rows[r, DEPTH] + (rows[r, STIFF_N] - rows[r, STIFF_T]) * out
                stick = friction_bias(rows, r, dt, p)
                fx = -push * rows[r, 0] - stick * rows[r, 10] - rows[r, STIFF_T] * ux
                fy = -push * rows[r, 1] - stick * rows[r, 11] - rows[r, STIFF_T] * uy
                fz = -push * rows[r, 2] - stick * rows[r, 12] - rows[r, STIFF_T] * uz
                sx += fx
                sy += fy
                sz += fz
                qx += rows[r, 7] * fz - rows[r, 8] * fy
                qy += rows[r, 8] * fx - rows[r, 6] * fz
                qz += rows[r, 6] * fy - rows[r, 7] * fx
            if at_b >= 0:
                add_wrench(vector, at_b, dt * sx, dt * sy, dt * sz, dt * qx, dt * qy, dt * qz)
                add_own_block(matrix, at_b, rows, start, stop, ARM_B, dt)
            if at_a >= 0:
                # The same wrench, reversed and about the sensor's reference point.
                gx = state.position[b, 0] - state.position[a, 0]
                gy = state.position[b, 1] - state.position[a, 1]
                gz = state.position[b, 2] - state.position[a, 2]
                qx, qy, qz = qx + gy * sz - gz * sy, qy + gz * sx - gx * sz, qz + gx * sy - gy * sx
                add_wrench(vector, at_a, -dt * sx, -dt * sy, -dt * sz, -dt * qx, -dt * qy, -dt * qz)
                add_own_block(matrix, at_a, rows, start, stop, ARM_A, dt)
            if at_a >= 0 and at_b >= 0:
                if at_a < at_b:
                    add_cross_block(matrix, at_a, at_b, rows, start, stop, ARM_A, ARM_B, dt)
                else:
                    add_cross_block(matrix, at_b, at_a, rows, start, stop, ARM_B, ARM_A, dt)
            start = scratch.pair_stop[pair]
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
                    velocity[body, i] = vector[at + i]
                write_twist(velocity[body], dt, scratch.twist[body])
        if turn == 0:
            first_change = change
        if change <= 1e-6 * first_change or change < 1e-13:
            return


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
    """Bristle deflections at the step's end, back in the frame of the sensor's body."""
    rows, start = scratch.rows, 0
    for pair in range(len(world.pairs)):
        a, b = world.sensor_body[world.pairs[pair, 0]], world.target_body[world.pairs[pair, 1]]
        for r in range(start, scratch.pair_stop[pair]):
            vx, vy, vz = _relative_velocity(rows, r, scratch.twist, a, b)
            # As seen from the sensor, which itself has turned by 1 + dt W at the step's end.
            vx, vy, vz = (
                vx + dt * (scratch.twist[a, 3] * vx + scratch.twist[a, 6] * vy + scratch.twist[a, 9] * vz),
                vy + dt * (scratch.twist[a, 4] * vx + scratch.twist[a, 7] * vy + scratch.twist[a, 10] * vz),
                vz + dt * (scratch.twist[a, 5] * vx + scratch.twist[a, 8] * vy + scratch.twist[a, 11] * vz),
            )
            out = vx * rows[r, 0] + vy * rows[r, 1] + vz * rows[r, 2]
            zx = rows[r, KEEP] * rows[r, 10] + rows[r, GAIN] * (vx - out * rows[r, 0])
            zy = rows[r, KEEP] * rows[r, 11] + rows[r, GAIN] * (vy - out * rows[r, 1])
            zz = rows[r, KEEP] * rows[r, 12] + rows[r, GAIN] * (vz - out * rows[r, 2])
            square = zx * zx + zy * zy + zz * zz
            if square > rows[r, LIMIT] * rows[r, LIMIT]:
                scale = rows[r, LIMIT] / math.sqrt(square)
                zx, zy, zz = scale * zx, scale * zy, scale * zz
            slot = scratch.slots[r]
            for i in range(3):
                state.bristles[slot, i] = (
                    scratch.rotation[a, 0, i] * zx + scratch.rotation[a, 1, i] * zy + scratch.rotation[a, 2, i] * zz
                )
        start = scratch.pair_stop[pair]


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
        Most texels that were sunk too deep to act in any one step.
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
    rows, start = scratch.rows, 0
    for pair in range(len(world.pairs)):
        sensor = world.pairs[pair, 0]
        a, b = world.sensor_body[sensor], world.target_body[world.pairs[pair, 1]]
        p = world.parameters[sensor]
        for r in range(start, scratch.pair_stop[pair]):
            texel = world.texel_start[sensor] + scratch.slots[r] - world.slot_start[pair]
            vx, vy, vz = _relative_velocity(rows, r, scratch.twist, a, b)
            rate = vx * rows[r, 0] + vy * rows[r, 1] + vz * rows[r, 2]
            tx, ty, tz = vx - rate * rows[r, 0], vy - rate * rows[r, 1], vz - rate * rows[r, 2]
            square = tx * tx + ty * ty + tz * tz
            fn = normal_force(rows[r, DEPTH], rate, p)
            length = math.sqrt(rows[r, 10] * rows[r, 10] + rows[r, 11] * rows[r, 11] + rows[r, 12] * rows[r, 12])
            limit = bristle_limit(fn, p)
            held = limit / length if length > limit else 1.0
            zx, zy, zz = held * rows[r, 10], held * rows[r, 11], held * rows[r, 12]
            fx, fy, fz = 0.0, 0.0, 0.0
            if fn > 0.0:
                fx = friction_force(zx, bristle_rate(zx, tx, square, fn, p), tx, p)
                fy = friction_force(zy, bristle_rate(zy, ty, square, fn, p), ty, p)
                fz = friction_force(zz, bristle_rate(zz, tz, square, fn, p), tz, p)
            # Friction drags the sensor along with the target; the target's surface normal points into the sensor.
            lx = scratch.rotation[a, 0, 0] * fx + scratch.rotation[a, 1, 0] * fy + scratch.rotation[a, 2, 0] * fz
            ly = scratch.rotation[a, 0, 1] * fx + scratch.rotation[a, 1, 1] * fy + scratch.rotation[a, 2, 1] * fz
            lz = scratch.rotation[a, 0, 2] * fx + scratch.rotation[a, 1, 2] * fy + scratch.rotation[a, 2, 2] * fz
            shear[texel, 0] += lx * world.texels[texel, 6] + ly * world.texels[texel, 7] + lz * world.texels[texel, 8]
            shear[texel, 1] += lx * world.texels[texel, 9] + ly * world.texels[texel, 10] + lz * world.texels[texel, 11]
            lx += fn * (
                scratch.rotation[a, 0, 0] * rows[r, 0]
                + scratch.rotation[a, 1, 0] * rows[r, 1]
                + scratch.rotation[a, 2, 0] * rows[r, 2]
            )
            ly += fn * (
                scratch.rotation[a, 0, 1] * rows[r, 0]
                + scratch.rotation[a, 1, 1] * rows[r, 1]
                + scratch.rotation[a, 2, 1] * rows[r, 2]
            )
            lz += fn * (
                scratch.rotation[a, 0, 2] * rows[r, 0]
                + scratch.rotation[a, 1, 2] * rows[r, 1]
                + scratch.rotation[a, 2, 2] * rows[r, 2]
            )
            px = (
                scratch.rotation[a, 0, 0] * rows[r, 3]
                + scratch.rotation[a, 1, 0] * rows[r, 4]
                + scratch.rotation[a, 2, 0] * rows[r, 5]
            )
            py = (
                scratch.rotation[a, 0, 1] * rows[r, 3]
                + scratch.rotation[a, 1, 1] * rows[r, 4]
                + scratch.rotation[a, 2, 1] * rows[r, 5]
            )
            pz = (
                scratch.rotation[a, 0, 2] * rows[r, 3]
                + scratch.rotation[a, 1, 2] * rows[r, 4]
                + scratch.rotation[a, 2, 2] * rows[r, 5]
            )
            if not contact[texel] or fn > force[texel]:
                slip[texel] = math.sqrt(square)
            contact[texel] = True
            force[texel] += fn
            depth[texel] = max(depth[texel], rows[r, DEPTH])
            net[sensor, 0] += lx
            net[sensor, 1] += ly
            net[sensor, 2] += lz
            net[sensor, 3] += py * lz - pz * ly
            net[sensor, 4] += pz * lx - px * lz
            net[sensor, 5] += px * ly - py * lx
            moment[sensor, 0] += fn * px
            moment[sensor, 1] += fn * py
            moment[sensor, 2] += fn * pz
            moment[sensor, 3] += fn
        start = scratch.pair_stop[pair]
