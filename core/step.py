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
    DRIVEN,
    FREE,
    KEYFRAMED,
    add_product,
    keep_axis,
    look_back,
    solve_positive,
    turn_quaternion,
    write_rotation,
    write_twist,
    write_twist_map,
    write_world_inertia,
)
from .contact import (
    CN,
    DEPTH,
    DRAG,
    EXPONENT,
    GAIN,
    GRIP,
    KEEP,
    LANES,
    LIMIT,
    LINEAR,
    NX,
    NY,
    NZ,
    PUSH,
    PX,
    PY,
    PZ,
    ROW,
    SLOPE,
    ZX,
    ZY,
    ZZ,
    K,
    State,
    World,
    bristle_limit,
    bristle_rate,
    friction_force,
    linearise,
    normal_force,
    normal_tangent,
)
from .crew import LATE, SPINS, announce, hand_in, is_over, is_stopped, linger, take
from .effects.laws import COLUMNS
from .gather import gather
from .jit import allocating, inlined, kernel
from .pads import (
    NOW,
    STEP,
    force_and_law,
    has_effects,
    let_effects_act,
    may_pull,
    note_pressed,
    press_texel,
    remember,
    write_tangent,
)
from .servo import SPEED, add_servos, carry_driven, move_drives, place_driven
from .shapes import Shapes, refit, set_moment
from .skin import OX, OY, OZ, turn_rows
from .tumble import mean_spin, product, spin_of

GATHER, SUM, BEND = 2, 3, 4
"""Phases of a step whose pairs are shared out: find the contacts, sum them up, bend the bristles."""

PASSES = 40
"""Most rounds in which contacts are linearised anew within a substep; two or three are usual, one at rest."""

SUMS = 27
"""Numbers that the contacts of a pair are summed up in: a symmetric (6, 6) block by its lower triangle, and a wrench."""


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
    rows : (blocks, ROW) float
        One row per contact, in blocks (see :mod:`.contact`).
    slots : (blocks, LANES) int
        Place of each row in the memory of :class:`.State`.
    own : (blocks, 3 · LANES) float
        Velocity that a deforming target or sensor adds at each row, in the sensor's axes, m/s; read where `moving` says so.
    moving : (q,) bool
    first_block : (q,) int
        Where each pair's rows begin.
    contacts, sunk : (q,) int
        How many rows each pair has in use, and how many of its points are pressed past their maximum penetration.
    sums : (q, SUMS · LANES) float
        Of the contacts of each pair, lane by lane.
    pose : (q, 12) float
        Rotation (row by row) and position of each pair's sensor in the target's frame.
    turn : (q, 3, 3, 3) float
        Rotations that deforming surfaces need.
    motion, part : (q, 12) float
        How a target's points move relative to a sensor, and the part of it that is not solved for: U, then W row by row.
    block, wrench : (6, 6), (6,) float
        What the contacts of one pair resist, and their force and torque on the target, both in the sensor's axes.
    map_a, map_b : (6, 6) float
        From the twists of both bodies to the relative motion.
    matrix, vector, momentum, guess : (u, u), (u,), (u,), (u,) float
        The linear system, and its u unknowns as they were guessed last.
    tumbling : (b, 3) float
        By how much the mean spin of a free body over the step differs from its spin at the beginning if nothing acts, rad/s.
    axis : (b, 3) float
        Direction of each drive in the world at the step's end.
    carried : (b, 6) float
        Velocity of a driven body without the speed of its drive.
    felt : (blocks, COLUMNS · LANES) float
        What effects make of each contact (:mod:`.effects.laws`); without rows when none acts on forces.
    pressed : (1, COLUMNS · N) float
        What presses on each contact point at the step's end, the same way.
    every : (N,) int
        Numbers of the contact points.
    drive_mass, drive_load : (d,) float
        What each drive moves (kg), and the impulse that its weight and its carrier ask for in this step (N·s).
    step : (1,) float, seconds
        The time step that helpers are to reckon with.
    board : (BOARD,) or (0,) int
        Where helpers look for work (see :mod:`.crew`).
    """

    rotation: np.ndarray
    inertia: np.ndarray
    twist: np.ndarray
    known: np.ndarray
    rows: np.ndarray
    slots: np.ndarray
    own: np.ndarray
    moving: np.ndarray
    first_block: np.ndarray
    contacts: np.ndarray
    sunk: np.ndarray
    sums: np.ndarray
    pose: np.ndarray
    turn: np.ndarray
    motion: np.ndarray
    part: np.ndarray
    block: np.ndarray
    wrench: np.ndarray
    map_a: np.ndarray
    map_b: np.ndarray
    matrix: np.ndarray
    vector: np.ndarray
    momentum: np.ndarray
    guess: np.ndarray
    tumbling: np.ndarray
    axis: np.ndarray
    carried: np.ndarray
    felt: np.ndarray
    pressed: np.ndarray
    every: np.ndarray
    drive_mass: np.ndarray
    drive_load: np.ndarray
    step: np.ndarray
    board: np.ndarray


def scratch_for(world: World, state: State, shapes: Shapes, board: np.ndarray) -> Scratch:
    """Allocate the working memory of a run."""
    b = len(state.position)
    slots = np.diff(world.slot_start, append=len(state.hint))
    blocks = np.cumsum([0, *(-(-slots // LANES))])
    twist = np.zeros((b, 12))
    for body in range(b):
        look_back(state.velocity[body], 1e-9, twist[body])
    n = max(6, world.unknowns)
    moving = shapes.bends[world.pairs[:, 0]] | shapes.deforms[world.pairs[:, 1]]
    return Scratch(
        rotation=np.zeros((b, 3, 3)),
        inertia=np.zeros((b, 3, 3)),
        twist=twist,
        known=np.zeros((b, 12)),
        rows=np.zeros((blocks[-1], ROW)),
        slots=np.zeros((blocks[-1], LANES), np.int64),
        own=np.zeros((blocks[-1] if moving.any() else 0, 3 * LANES)),
        moving=moving,
        first_block=blocks[:-1],
        contacts=np.zeros(len(world.pairs), np.int64),
        sunk=np.zeros(len(world.pairs), np.int64),
        sums=np.zeros((len(world.pairs), SUMS * LANES)),
        pose=np.zeros((len(world.pairs), 12)),
        turn=np.zeros((len(world.pairs), 3, 3, 3)),
        motion=np.zeros((len(world.pairs), 12)),
        part=np.zeros((len(world.pairs), 12)),
        block=np.zeros((6, 6)),
        wrench=np.zeros(6),
        map_a=np.zeros((6, 6)),
        map_b=np.zeros((6, 6)),
        matrix=np.zeros((n, n)),
        vector=np.zeros(n),
        momentum=np.zeros(n),
        guess=np.zeros(n),
        tumbling=np.zeros((b, 3)),
        axis=np.zeros((b, 3)),
        carried=np.zeros((b, 6)),
        felt=np.zeros((0 if world.program.is_empty else blocks[-1], COLUMNS * LANES)),
        pressed=np.zeros((1, 0 if world.program.is_empty else COLUMNS * len(world.points))),
        every=np.arange(len(world.points)),
        drive_mass=np.zeros(len(world.drives)),
        drive_load=np.zeros(len(world.drives)),
        step=np.zeros(1),
        board=board,
    )


def contacts_of(pair: int, scratch: Scratch) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the contacts of one pair, freshly gathered.

    Returns
    -------
    slots : (n,) int
        Place of each in the memory of :class:`.State`.
    normal : (n, 3) float
        The target's outward normal, in the frame of the sensor's body like the point.
    point : (n, 3) float, metres
        From the body's reference point.
    depth : (n,) float, metres
    """
    count, first = scratch.contacts[pair], scratch.first_block[pair]
    blocks = slice(first, first - (-count // LANES))
    columns = scratch.rows[blocks].reshape(-1, ROW // LANES, LANES).swapaxes(1, 2).reshape(-1, ROW // LANES)[:count]
    n, p = NX // LANES, PX // LANES
    return scratch.slots[blocks].ravel()[:count], columns[:, n : n + 3], columns[:, p : p + 3], columns[:, DEPTH // LANES]


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


@inlined
def _velocity(px, py, pz, motion):
    """Velocity of the target at a contact point relative to the sensor, in the axes of the sensor's body."""
    return (
        motion[0] + motion[3] * px + motion[4] * py + motion[5] * pz,
        motion[1] + motion[6] * px + motion[7] * py + motion[8] * pz,
        motion[2] + motion[9] * px + motion[10] * py + motion[11] * pz,
    )


@inlined
def gather_all(dt, world, tree, neighbours, shapes, state, scratch):
    """Contacts of all pairs of sensor and target where the bodies are now. Returns how many points are sunk too deep to act."""
    for body in range(len(state.position)):
        write_rotation(state.quaternion[body], scratch.rotation[body])
    scratch.step[0] = dt
    _share_out(GATHER, world, tree, neighbours, shapes, state, scratch)
    return scratch.sunk.sum()


@inlined
def _share_out(phase, world, tree, neighbours, shapes, state, scratch):
    """Do a phase for all pairs, alone or with helpers; surfaces that deform are moved on when first asked for, so alone."""
    board, pairs = scratch.board, len(world.pairs)
    if len(board) == 0 or pairs == 1 or shapes.moves[0]:
        for pair in range(pairs):
            _do(phase, pair, world, tree, neighbours, shapes, state, scratch)
        return
    announce(board, phase)
    pair = 0
    while pair < pairs:
        _, pair = take(board, pairs)
        if pair < pairs:
            _do(phase, pair, world, tree, neighbours, shapes, state, scratch)
            hand_in(board)
    turn = 0
    while not is_over(board, pairs):
        linger(board, turn)
        turn += 1
    if turn >= SPINS:
        board[LATE] += 1


@kernel
def help_out(world, tree, neighbours, shapes, state, scratch):
    """Do what :func:`_share_out` puts on the board, until it says that the helpers may go home."""
    board, pairs, turn = scratch.board, len(world.pairs), 0
    while not is_stopped(board):
        phase, pair = take(board, pairs)
        if pair < pairs:
            _do(phase, pair, world, tree, neighbours, shapes, state, scratch)
            hand_in(board)
            turn = 0
        else:
            linger(board, turn)
            turn += 1


@inlined
def _do(phase, pair, world, tree, neighbours, shapes, state, scratch):
    """One phase of one pair. What it writes belongs to this pair alone."""
    dt = scratch.step[0]
    if phase == GATHER:
        gather(pair, dt, world, tree, neighbours, shapes, state, scratch)
    elif scratch.contacts[pair] > 0:
        if phase == SUM:
            _sum_pair(pair, dt, world, state, scratch)
        else:
            _bend_pair(pair, dt, world, shapes, state, scratch)


@inlined
def _solve_velocities(dt, commands, world, tree, neighbours, shapes, state, scratch):
    """Velocities of free and driven bodies at the step's end, written into the state.

    Contacts and drives are linearised at the current guess and the linear system solved, until the guess no longer moves; a
    contact that would pull is left out of the next round. Where the rounds go in circles (friction that was guessed for too
    much load throws the contact off, without the contact there is no friction), the guess moves by a share of the way only.
    All that a share mixes keeps the momentum. With nothing to solve for one round only linearises.
    """
    matrix, vector, guess, n = scratch.matrix, scratch.vector, scratch.guess, world.unknowns
    _begin_guess(dt, world, state, scratch)
    first_change, last_change, share = 0.0, 0.0, 1.0
    opening = min(1, len(world.drives))  # drives are without limits in the first round: what it changes says nothing yet
    for turn in range(PASSES):
        _write_twists(dt, world, state, scratch)
        for i in range(n):
            vector[i] = scratch.momentum[i]
            for j in range(n):
                matrix[i, j] = 0.0
        _share_out(SUM, world, tree, neighbours, shapes, state, scratch)
        for pair in range(len(world.pairs)):
            a, b = world.sensor_body[world.pairs[pair, 0]], world.target_body[world.pairs[pair, 1]]
            if world.at[a] >= 0 or world.at[b] >= 0:
                _add_pair(pair, a, b, dt, world, state, scratch)
        if n == 0:
            return
        for body in range(len(world.kind)):
            if world.kind[body] == FREE:
                at = world.at[body]
                for i in range(3):
                    matrix[at + i, at + i] += world.mass[body]
                    for j in range(i + 1):
                        matrix[at + 3 + i, at + 3 + j] += scratch.inertia[body, i, j]
        if len(world.drives) > 0:
            add_servos(dt, turn > 0, commands, world, state, scratch)
        solve_positive(matrix, vector, n)
        change = 0.0  # a length, so that a scene that is turned as a whole takes the same rounds
        for i in range(n):
            change += (vector[i] - guess[i]) ** 2
        change = math.sqrt(change)
        # Contacts that come on and off in the first rounds find their own way; later ones shrink by 1 - share if all is well.
        if turn > 3 and change > (1.0 - 0.25 * share) * last_change:
            share *= 0.5
        last_change = change
        for i in range(n):
            guess[i] = share * vector[i] + (1.0 - share) * guess[i]
        if turn <= opening:
            first_change = change
        if turn >= opening and (change <= 1e-6 * first_change or change < 1e-13):
            break
    _write_twists(dt, world, state, scratch)


@inlined
def _begin_guess(dt, world, state, scratch):
    """Velocities as they are for a first guess, and what momentum the bodies would have without contacts and drives."""
    momentum, guess, velocity = scratch.momentum, scratch.guess, state.velocity
    for body in range(len(world.kind)):
        at = world.at[body]
        if world.kind[body] == FREE:
            inertia, spin = scratch.inertia[body], velocity[body, 3:]
            lx, ly, lz = product(inertia, spin[0], spin[1], spin[2])
            mean = mean_spin(scratch.rotation[body], world.inverse_inertia[body], lx, ly, lz, dt)
            # The spin that is solved for is the mean over the step, so that a body tumbles as it should.
            for i in range(3):
                guess[at + i] = velocity[body, i]
                momentum[at + i] = world.mass[body] * (velocity[body, i] + dt * world.gravity[i])
                guess[at + 3 + i] = mean[i]
                scratch.tumbling[body, i] = mean[i] - spin[i]
            momentum[at + 3], momentum[at + 4], momentum[at + 5] = product(inertia, mean[0], mean[1], mean[2])
        elif world.kind[body] == KEYFRAMED:
            write_twist(velocity[body], dt, scratch.twist[body])
            for i in range(12):
                scratch.known[body, i] = scratch.twist[body, i]
    for drive in range(len(world.drives)):
        at = world.drive_at[drive]
        guess[at] = state.drives[drive, SPEED]
        momentum[at] = scratch.drive_mass[drive] * guess[at] - scratch.drive_load[drive]


@kernel
def _write_twists(dt, world, state, scratch):
    """Velocities and twists that follow from the guess, and the part of the twists that is not solved for.

    That is a finite turn's excess over ``ω × r`` of a free body, and what its carrier does of a driven one.
    """
    guess, velocity, twist, known = scratch.guess, state.velocity, scratch.twist, scratch.known
    for body in range(len(world.kind)):
        at = world.at[body]
        if world.kind[body] == FREE:
            for i in range(6):
                velocity[body, i] = guess[at + i]
            write_twist(velocity[body], dt, twist[body])
            for i in range(3):
                known[body, i] = 0.0
            for i in range(3, 12):
                known[body, i] = twist[body, i]
            known[body, 4] += velocity[body, 5]
            known[body, 5] -= velocity[body, 4]
            known[body, 6] -= velocity[body, 5]
            known[body, 8] += velocity[body, 3]
            known[body, 9] += velocity[body, 4]
            known[body, 10] -= velocity[body, 3]
        elif world.kind[body] == DRIVEN:
            for i in range(6):
                velocity[body, i] = scratch.carried[body, i]
            write_twist(velocity[body], dt, known[body])
            for i in range(3):
                velocity[body, i] += guess[at] * scratch.axis[body, i]
            write_twist(velocity[body], dt, twist[body])


@kernel
def _write_tangents(pair, first_point, dt, motion, law, world, memory, scratch):
    """Write what is not the same for all contacts of a pair, for the loop that must not call it itself.

    The tangents of a curved normal law at the velocities of `motion`, what effects make of them, and what was painted.
    """
    rows, painted, sensor = scratch.rows, world.painted, world.pairs[pair, 0]
    effects = has_effects(sensor, world.program)
    for r in range(scratch.contacts[pair]):
        b, lane = scratch.first_block[pair] + r // LANES, r % LANES
        point = first_point + scratch.slots[b, lane]
        vx, vy, vz = _velocity(rows[b, PX + lane], rows[b, PY + lane], rows[b, PZ + lane], motion)
        if scratch.moving[pair]:
            vx, vy, vz = vx + scratch.own[b, OX + lane], vy + scratch.own[b, OY + lane], vz + scratch.own[b, OZ + lane]
        rate = vx * rows[b, NX + lane] + vy * rows[b, NY + lane] + vz * rows[b, NZ + lane]
        p = _painted_law(law, painted, point)
        rows[b, GRIP + lane], rows[b, DRAG + lane] = painted[point, 1] if len(painted) > 0 else 1.0, 0.0
        if effects:
            speed = math.sqrt(max(vx * vx + vy * vy + vz * vz - rate * rate, 0.0))
            press_texel(scratch.felt, b, LANES, lane, pair, rows[b, DEPTH + lane] + dt * rate, rate, 0.0, speed, p, world)
        else:
            rows[b, PUSH + lane], rows[b, SLOPE + lane] = normal_tangent(rows[b, DEPTH + lane], rate, dt, p)
    if effects:
        first, left = scratch.first_block[pair], scratch.contacts[pair]
        for b in range(first, first + (left + LANES - 1) // LANES):
            count = min(left, LANES)
            let_effects_act(sensor, STEP, b, 0, count, first_point, law, world, memory, scratch.slots, scratch.felt)
            for lane in range(count):
                write_tangent(pair, b, lane, dt, rows[b, GRIP + lane], world, scratch.felt, rows)
            left -= LANES


@inlined
def _sum_pair(pair, dt, world, state, scratch):
    """Sum up the contacts of a pair at the velocities that are guessed."""
    a, b = world.sensor_body[world.pairs[pair, 0]], world.target_body[world.pairs[pair, 1]]
    _relative_motion(a, b, scratch.twist, state.position, scratch.rotation, scratch.motion[pair])
    _relative_motion(a, b, scratch.known, state.position, scratch.rotation, scratch.part[pair])
    first = world.point_first[pair] - world.slot_start[pair]
    _sum_contacts(pair, first, dt, _law(world.parameters, pair), world, state.memory, scratch)


@kernel
def _remember(dt, world, state, scratch):
    """Let the effects remember what happened in the step, at the velocities of its end."""
    for pair in range(len(world.pairs)):
        sensor = world.pairs[pair, 0]
        if scratch.contacts[pair] > 0 and has_effects(sensor, world.program):
            a, b = world.sensor_body[sensor], world.target_body[world.pairs[pair, 1]]
            _relative_motion(a, b, scratch.twist, state.position, scratch.rotation, scratch.motion[pair])
            _note_pair(pair, dt, _values(scratch.motion[pair]), _law(world.parameters, pair), world, scratch)
    for pair in range(len(world.pairs)):
        sensor = world.pairs[pair, 0]
        if (pair == 0 or world.pairs[pair - 1, 0] != sensor) and has_effects(sensor, world.program):
            remember(sensor, _law(world.parameters, pair), world, scratch.pressed, scratch.every, state.memory)


@kernel
def _note_pair(pair, dt, motion, law, world, scratch):
    """Keep what presses on the points of a pair's sensor."""
    rows = scratch.rows
    for r in range(scratch.contacts[pair]):
        b, lane = scratch.first_block[pair] + r // LANES, r % LANES
        point = world.point_first[pair] + scratch.slots[b, lane] - world.slot_start[pair]
        vx, vy, vz = _velocity(rows[b, PX + lane], rows[b, PY + lane], rows[b, PZ + lane], motion)
        if scratch.moving[pair]:
            vx, vy, vz = vx + scratch.own[b, OX + lane], vy + scratch.own[b, OY + lane], vz + scratch.own[b, OZ + lane]
        rate = vx * rows[b, NX + lane] + vy * rows[b, NY + lane] + vz * rows[b, NZ + lane]
        slide = dt * math.sqrt(max(vx * vx + vy * vy + vz * vz - rate * rate, 0.0))
        p, end = _painted_law(law, world.painted, point), rows[b, DEPTH + lane] + dt * rate
        note_pressed(point, pair, end, rate, slide, p, world, scratch.pressed)


@kernel
def _sum_contacts(pair, first_point, dt, p, world, memory, scratch):
    """Linearise the contacts of a pair, and sum their forces on the target and what they resist.

    The contact point of a row is `first_point` plus its slot.

    With a contact's damping tensor ``C = ct 1 + (cn - ct) n nᵀ`` and velocities ``v + ω × p`` the block is the sum of
    ``Jᵀ C J``, its lower triangle; the wrench is what the springs and the known part of the motion do.
    """
    rows, sums = scratch.rows, scratch.sums[pair]
    motion, part = _values(scratch.motion[pair]), _values(scratch.part[pair])
    for i in range(SUMS * LANES):
        sums[i] = 0.0
    own, moving = scratch.own, scratch.moving[pair]
    sensor = world.pairs[pair, 0]
    vary = p[EXPONENT] != LINEAR or len(world.painted) > 0 or has_effects(sensor, world.program)
    sticks = may_pull(sensor, world.program)
    if vary:
        _write_tangents(pair, first_point, dt, motion, p, world, memory, scratch)
    first = scratch.first_block[pair]
    for b in range(first, first + (scratch.contacts[pair] + LANES - 1) // LANES):
        for lane in range(LANES):  # runs in vector registers: no branches, no calls
            nx, ny, nz = rows[b, NX + lane], rows[b, NY + lane], rows[b, NZ + lane]
            px, py, pz = rows[b, PX + lane], rows[b, PY + lane], rows[b, PZ + lane]
            zx, zy, zz = rows[b, ZX + lane], rows[b, ZY + lane], rows[b, ZZ + lane]
            vx, vy, vz = _velocity(px, py, pz, motion)
            ux, uy, uz = _velocity(px, py, pz, part)
            if moving:
                vx, vy, vz = vx + own[b, OX + lane], vy + own[b, OY + lane], vz + own[b, OZ + lane]
                ux, uy, uz = ux + own[b, OX + lane], uy + own[b, OY + lane], uz + own[b, OZ + lane]
            push, slope, grip, drag = p[K] * rows[b, DEPTH + lane], p[K] * dt + p[CN], 1.0, 0.0
            if vary:
                push, slope, grip = rows[b, PUSH + lane], rows[b, SLOPE + lane], rows[b, GRIP + lane]
                drag = rows[b, DRAG + lane]
            limit, push, stiff_n, bias, t, keep, gain = linearise(
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


@inlined
def _collect(pair, world, scratch):
    """Add up what :func:`_sum_contacts` has left for the parts of a pair; returns whether that is all and anything touches."""
    pairs, sums, block, wrench = world.pairs, scratch.sums[pair], scratch.block, scratch.wrench
    if pair == 0 or pairs[pair, 0] != pairs[pair - 1, 0] or pairs[pair, 1] != pairs[pair - 1, 1]:
        block[:], wrench[:] = 0.0, 0.0
    if scratch.contacts[pair] > 0:
        at = 0
        for i in range(6):
            for j in range(i + 1):
                block[i, j] += sums[at]
                at += LANES
        for i in range(6):
            wrench[i] += sums[at]
            at += LANES
    last = pair + 1 == len(pairs) or pairs[pair, 0] != pairs[pair + 1, 0] or pairs[pair, 1] != pairs[pair + 1, 1]
    return last and block[0, 0] + block[1, 1] + block[2, 2] > 0.0  # zero where nothing touches


@inlined
def _add_pair(pair, a, b, dt, world, state, scratch):
    """Bring a pair's sums into the linear system, all parts together with the last."""
    if not _collect(pair, world, scratch):
        return
    map_a, map_b, wrench = scratch.map_a, scratch.map_b, scratch.wrench
    at_a, width_a = _write_map(a, a, -1.0, world, state, scratch, map_a)
    at_b, width_b = _write_map(b, a, 1.0, world, state, scratch, map_b)
    for j in range(6):
        for i in range(width_a):
            scratch.vector[at_a + i] += dt * map_a[j, i] * wrench[j]
        for i in range(width_b):
            scratch.vector[at_b + i] += dt * map_b[j, i] * wrench[j]
    if width_a > 0:
        _add_block(at_a, map_a, width_a, at_a, map_a, width_a, dt, scratch)
    if width_b > 0:
        _add_block(at_b, map_b, width_b, at_b, map_b, width_b, dt, scratch)
    if width_a > 0 and width_b > 0:
        if at_a >= at_b:  # only the lower triangle of the system is read
            _add_block(at_a, map_a, width_a, at_b, map_b, width_b, dt, scratch)
        if at_b >= at_a:  # coupled bodies share their unknown: both of the mixed products count there
            _add_block(at_b, map_b, width_b, at_a, map_a, width_a, dt, scratch)


@kernel
def _add_block(row, left, left_width, column, right, right_width, dt, scratch):
    if left_width == 6 and right_width == 6:  # the usual case with its widths in plain sight of the compiler
        add_product(scratch.matrix, row, column, left, 6, scratch.block, right, 6, dt)
    else:
        add_product(scratch.matrix, row, column, left, left_width, scratch.block, right, right_width, dt)


@kernel
def _write_map(body, sensor_body, sign, world, state, scratch, out):
    """From a body's unknowns to relative motion in the axes of the sensor's body; returns where they are and how many."""
    gx = state.position[sensor_body, 0] - state.position[body, 0]
    gy = state.position[sensor_body, 1] - state.position[body, 1]
    gz = state.position[sensor_body, 2] - state.position[body, 2]
    if world.kind[body] == KEYFRAMED:
        return -1, 0
    write_twist_map(scratch.rotation[sensor_body], gx, gy, gz, sign, out)
    if world.kind[body] == FREE:
        return world.at[body], 6
    keep_axis(scratch.axis[body], out)
    return world.at[body], 1


@inlined
def _bend_pair(pair, dt, world, shapes, state, scratch):
    """Bristle deflections at the step's end, as the sensor sees them then."""
    a, b = world.sensor_body[world.pairs[pair, 0]], world.target_body[world.pairs[pair, 1]]
    motion, part = scratch.motion[pair], scratch.part[pair]
    _relative_motion(a, b, scratch.twist, state.position, scratch.rotation, motion)
    _seen_at_the_end(a, dt, scratch.twist, scratch.rotation, motion, part, scratch.turn[pair])
    if scratch.moving[pair]:
        _turn_own(pair, scratch)
    if shapes.bends[world.pairs[pair, 0]]:
        turn_rows(pair, world, shapes, scratch)
    _bend_bristles(pair, _values(part), state, scratch)


@kernel
def _turn_own(pair, scratch):
    """Turn the velocities that deformation adds by what the sensor turns during the step."""
    own, turn = scratch.own, scratch.turn[pair]
    for r in range(scratch.contacts[pair]):
        b, lane = scratch.first_block[pair] + r // LANES, r % LANES
        u = own[b, OX + lane], own[b, OY + lane], own[b, OZ + lane]
        for k in range(3):
            own[b, k * LANES + lane] = turn[0, k, 0] * u[0] + turn[0, k, 1] * u[1] + turn[0, k, 2] * u[2]


@kernel
def _bend_bristles(pair, motion, state, scratch):
    """Bring the bristles of a pair's contacts to the step's end, at the velocities of `motion`."""
    rows, slots, bristles = scratch.rows, scratch.slots, state.bristles
    own, moving = scratch.own, scratch.moving[pair]
    first, left = scratch.first_block[pair], scratch.contacts[pair]
    for b in range(first, first + (left + LANES - 1) // LANES):
        for lane in range(LANES):
            nx, ny, nz = rows[b, NX + lane], rows[b, NY + lane], rows[b, NZ + lane]
            vx, vy, vz = _velocity(rows[b, PX + lane], rows[b, PY + lane], rows[b, PZ + lane], motion)
            if moving:
                vx, vy, vz = vx + own[b, OX + lane], vy + own[b, OY + lane], vz + own[b, OZ + lane]
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
def _seen_at_the_end(a, dt, twist, rotation, motion, seen, turned):
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


@kernel
def advance_steps(
    dt, first, last, path_position, path_quaternion, path_velocity, commands, world, tree, neighbours, shapes, state, scratch
):
    """Run some of the substeps of one frame; the state is brought forward in place.

    Parameters
    ----------
    dt : float, seconds
    first, last : int
        Steps to run, the last one excluded.
    path_position, path_quaternion : (steps + 1, b, 3) and (steps + 1, b, 4) float
        Where the keyframed bodies are at the beginning of each step, and at the end of the last; driven ones without the way
        of their drives.
    path_velocity : (steps, b, 6) float
        Their velocities during each step.
    commands : (steps, d, 4) float
        What the drives are told.

    Returns
    -------
    sunk : int
        Most contact points that were sunk too deep to act in any one step.
    """
    worst = 0
    moves = shapes.moves[0]
    if moves and first == 0:
        refit(shapes, tree)
    for step in range(first, last):
        _place(path_position[step], path_quaternion[step], world, state, scratch)
        for drive in range(len(world.drives)):
            scratch.drive_mass[drive] = scratch.drive_load[drive] = 0.0
        for body in range(len(world.kind)):
            if world.kind[body] == KEYFRAMED:
                for i in range(6):
                    state.velocity[body, i] = path_velocity[step, body, i]
            elif world.kind[body] == DRIVEN:
                after = path_quaternion[step + 1, body]
                carry_driven(body, dt, after, path_velocity[step, body], world, state, scratch)
        if moves:
            set_moment(step, step + 1, dt, world, shapes)
        worst = max(worst, gather_all(dt, world, tree, neighbours, shapes, state, scratch))
        for body in range(len(world.kind)):
            if world.kind[body] == FREE:
                write_world_inertia(scratch.rotation[body], world.inertia[body], scratch.inertia[body])
        _solve_velocities(dt, commands[step], world, tree, neighbours, shapes, state, scratch)
        if len(scratch.felt) > 0:
            _remember(dt, world, state, scratch)
        _share_out(BEND, world, tree, neighbours, shapes, state, scratch)
        if len(world.drives) > 0:
            move_drives(dt, commands[step], world, state, scratch)
        for body in range(len(world.kind)):
            if world.kind[body] == FREE:
                _move_free(body, dt, world, state, scratch)
    if moves:
        set_moment(last, last - 1, dt, world, shapes)
    _place(path_position[last], path_quaternion[last], world, state, scratch)
    for body in range(len(world.kind)):
        look_back(state.velocity[body], dt, scratch.twist[body])
    return worst


@inlined
def _place(position, quaternion, world, state, scratch):
    """Put keyframed and driven bodies where they are at the beginning of a step."""
    for body in range(len(world.kind)):
        if world.kind[body] != FREE:
            for i in range(4):
                state.quaternion[body, i] = quaternion[body, i]
            for i in range(3):
                state.position[body, i] = position[body, i]
            if world.kind[body] == DRIVEN:
                place_driven(body, position[body], world, state, scratch.axis[body])


@inlined
def _move_free(body, dt, world, state, scratch):
    """Move a free body with its new velocity. What nothing touches keeps its angular momentum and its energy."""
    velocity, rotation, extra = state.velocity[body], scratch.rotation[body], scratch.tumbling[body]
    for i in range(3):
        state.position[body, i] += dt * velocity[i]
    lx, ly, lz = product(scratch.inertia[body], velocity[3] - extra[0], velocity[4] - extra[1], velocity[5] - extra[2])
    turn_quaternion(state.quaternion[body], dt * velocity[3], dt * velocity[4], dt * velocity[5])
    write_rotation(state.quaternion[body], rotation)
    velocity[3], velocity[4], velocity[5] = spin_of(rotation, world.inverse_inertia[body], lx, ly, lz)


@allocating
def feel(world, state, scratch, force, shear, depth, slip, contact, net, moment):
    """What every texel feels right now, from rows freshly gathered (Eq. 8, 9, 13); forces on the sensor, in its body's frame.

    `net` gets force and torque about the body's reference point, `moment` the sum of fn · point and of fn.
    """
    rows, points = scratch.rows, world.points
    strongest = np.full(len(force), -1.0)
    for pair in range(len(world.pairs)):
        sensor = world.pairs[pair, 0]
        a, b = world.sensor_body[sensor], world.target_body[world.pairs[pair, 1]]
        effects = has_effects(sensor, world.program)
        law, whole = _law(world.parameters, pair), 1.0 / world.weight[pair]
        _relative_motion(a, b, scratch.twist, state.position, scratch.rotation, scratch.motion[pair])
        motion = _values(scratch.motion[pair])
        for r in range(scratch.contacts[pair]):
            block, lane = scratch.first_block[pair] + r // LANES, r % LANES
            point = world.point_first[pair] + scratch.slots[block, lane] - world.slot_start[pair]
            texel = world.texel[point]
            p = _painted_law(law, world.painted, point)
            nx, ny, nz = rows[block, NX + lane], rows[block, NY + lane], rows[block, NZ + lane]
            px, py, pz = rows[block, PX + lane], rows[block, PY + lane], rows[block, PZ + lane]
            vx, vy, vz = _velocity(px, py, pz, motion)
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
            shear[texel, 0] += fx * points[point, 6] + fy * points[point, 7] + fz * points[point, 8]
            shear[texel, 1] += fx * points[point, 9] + fy * points[point, 10] + fz * points[point, 11]
            fx, fy, fz = fx + fn * nx, fy + fn * ny, fz + fn * nz
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
