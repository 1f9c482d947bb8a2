# SPDX-License-Identifier: GPL-3.0-or-later
"""Update of a body's motion in a step, by its mode (kernels): no other module of the solver asks for it.

A keyframed body follows its path. A free one has six unknowns, the velocity and the mean spin of the step. A driven one follows
its carrier, and has the speed along its axis as its only unknown, which coupled bodies share (see :mod:`.actuators`).
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.rotations import (
    matrix_times_vector,
    project_on_axis,
    rotate_quaternion,
    to_body_axes,
    write_rotation,
    write_step_motion,
    write_twist_map,
    write_world_inertia,
)
from ...model.body import Mode
from ..solver_model import Pairs, SolverModel, State
from ..workspace import Workspace
from .actuators import place_driven, prepare_driven

# Rotation of a body that nothing touches: its angular momentum and its energy are both conserved (kernels).
#
# A body with three different moments of inertia tumbles: its angular velocity changes although nothing acts. Rotating it by the
# angular velocity at a step's beginning would add energy in every step, until it spins about its thinnest axis with twice as
# much. The midpoint rule of Simo and Wong (1991, ALGO_C1) conserves both: a Cayley map rotates the body by the mean of the
# angular velocities at the step's ends.

LARGEST_TURN = 0.25
"""Largest rotation of one midpoint step, radians: its iterations then converge after a few."""


@kernel
def _inverse_cayley_rotation(vx: float, vy: float, vz: float, jx: float, jy: float, jz: float) -> tuple[float, float, float]:
    """Rotate `v` by the inverse Cayley map of 2 `j`: the length of `j` is the tangent of half the angle."""
    cx, cy, cz = vy * jz - vz * jy, vz * jx - vx * jz, vx * jy - vy * jx
    scale = 2.0 / (1.0 + jx * jx + jy * jy + jz * jz)
    return (
        vx + scale * (cx + cy * jz - cz * jy),
        vy + scale * (cy + cz * jx - cx * jz),
        vz + scale * (cz + cx * jy - cy * jx),
    )


@kernel
def _half_rotation(lx: float, ly: float, lz: float, dt: float, inverse: np.ndarray) -> tuple[float, float, float]:
    """Rotation over a short step, as the tangent of half the angle along its axis; `l` is the angular momentum. Body axes."""
    wx, wy, wz = matrix_times_vector(inverse, lx, ly, lz)
    jx, jy, jz = 0.5 * dt * wx, 0.5 * dt * wy, 0.5 * dt * wz
    for _ in range(40):
        ex, ey, ez = _inverse_cayley_rotation(lx, ly, lz, jx, jy, jz)
        wx, wy, wz = matrix_times_vector(inverse, lx + ex, ly + ey, lz + ez)
        x, y, z = 0.25 * dt * wx, 0.25 * dt * wy, 0.25 * dt * wz
        change = abs(x - jx) + abs(y - jy) + abs(z - jz)
        jx, jy, jz = x, y, z
        if change <= 1e-15 * (abs(x) + abs(y) + abs(z)):  # rounding alone may keep it from less
            break
    return jx, jy, jz


@kernel
def mean_angular_velocity(
    rotation: np.ndarray, inverse: np.ndarray, lx: float, ly: float, lz: float, dt: float
) -> tuple[float, float, float]:
    """Mean angular velocity of a body over a step in which nothing acts on it.

    Parameters
    ----------
    rotation : (3, 3) float
        At the step's beginning.
    inverse : (3, 3) float, 1/(kg·m²)
        Inverse of its inertia, body axes.
    lx, ly, lz : float, kg·m²/s
        Angular momentum, world axes.
    dt : float, seconds

    Returns
    -------
    x, y, z : float, rad/s
        World axes; the shorter way round.
    """
    lx, ly, lz = to_body_axes(rotation, lx, ly, lz)
    wx, wy, wz = matrix_times_vector(inverse, lx, ly, lz)
    parts = int(min(dt * math.sqrt(wx * wx + wy * wy + wz * wz) / LARGEST_TURN, 1000.0)) + 1
    qw, qx, qy, qz = 1.0, 0.0, 0.0, 0.0  # the turn so far
    for _ in range(parts):
        jx, jy, jz = _half_rotation(lx, ly, lz, dt / parts, inverse)
        lx, ly, lz = _inverse_cayley_rotation(lx, ly, lz, jx, jy, jz)
        qw, qx, qy, qz = (
            qw - qx * jx - qy * jy - qz * jz,
            qx + qw * jx + qy * jz - qz * jy,
            qy + qw * jy + qz * jx - qx * jz,
            qz + qw * jz + qx * jy - qy * jx,
        )
    if qw < 0.0:
        qw, qx, qy, qz = -qw, -qx, -qy, -qz
    sine = math.sqrt(qx * qx + qy * qy + qz * qz)
    pace = 2.0 / (qw * dt) if sine < 1e-8 * qw else 2.0 * math.atan2(sine, qw) / (sine * dt)
    return matrix_times_vector(rotation, pace * qx, pace * qy, pace * qz)


@inlined
def write_end(body: int, dt: float, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write orientation and spin of a free body at the step's end, and by how much its energy differs from what was reckoned.

    A body that nothing touches keeps its angular momentum and its energy. Torques bring it momentum, but the spin that follows
    depends on how the body lies at the end: its energy grows by more or less than the torques' impulse times the mean of the
    spins at both ends, which is what the work of its contacts is reckoned with.
    """
    if model.bodies.mode[body] != FREE:
        return
    velocity, work = state.velocity[body], workspace.bodies
    quaternion, rotation, extra = work.end_quaternion[body], work.end_rotation[body], work.spin_correction[body]
    before, inertia = work.velocity_before[body], work.inertia[body]
    spin = velocity[3] - extra[0], velocity[4] - extra[1], velocity[5] - extra[2]
    lx, ly, lz = matrix_times_vector(inertia, spin[0], spin[1], spin[2])
    for i in range(4):
        quaternion[i] = state.quaternion[body, i]
    rotate_quaternion(quaternion, dt * velocity[3], dt * velocity[4], dt * velocity[5])
    write_rotation(quaternion, rotation)
    wx, wy, wz = matrix_times_vector(model.bodies.inverse_inertia[body], *to_body_axes(rotation, lx, ly, lz))
    ex, ey, ez = matrix_times_vector(rotation, wx, wy, wz)
    work.end_spin[body, 0], work.end_spin[body, 1], work.end_spin[body, 2] = ex, ey, ez
    first = before[3] - extra[0], before[4] - extra[1], before[5] - extra[2]
    gx, gy, gz = matrix_times_vector(inertia, velocity[3] - before[3], velocity[4] - before[4], velocity[5] - before[5])
    kx, ky, kz = lx - gx, ly - gy, lz - gz  # angular momentum at the beginning
    grown = lx * ex + ly * ey + lz * ez - (kx * first[0] + ky * first[1] + kz * first[2])
    reckoned = gx * (before[3] + velocity[3]) + gy * (before[4] + velocity[4]) + gz * (before[5] + velocity[5])
    work.unbooked_energy[body] = 0.5 * (grown - reckoned)


KEYFRAMED, FREE, DRIVEN = (int(mode) for mode in Mode)
"""As numbers, which compiled code compares with those of :attr:`.Bodies.mode`."""


def number_unknowns(mode: np.ndarray, drive_of: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Number the unknowns of a step: six for each free body, then one for each drive.

    Parameters
    ----------
    mode : (b,) int
    drive_of : (b,) int
        Actuator of each body, -1 without one.

    Returns
    -------
    first_unknown : (b,) int
        Index of the first unknown of each body, -1 for keyframed bodies.
    drive_unknown : (d,) int
    unknowns : int
    """
    free = mode == FREE
    drives = int(drive_of.max(initial=-1)) + 1
    drive_unknown = 6 * np.count_nonzero(free) + np.arange(drives)
    first_unknown = np.where(free, 6 * (np.cumsum(free) - 1), -1)
    first_unknown[mode == DRIVEN] = drive_unknown[drive_of[mode == DRIVEN]]
    return first_unknown, drive_unknown, int(6 * np.count_nonzero(free) + drives)


def pairs_with_account(mode: np.ndarray, pairs: Pairs) -> np.ndarray:
    """(q,) bool: which pairs have an energy account: a free body, and none that an actuator supplies with energy."""
    modes = mode[np.stack([pairs.sensor_body, pairs.target_body])]
    return (modes == FREE).any(axis=0) & (modes != DRIVEN).all(axis=0)


@inlined
def place(
    body: int, position: np.ndarray, quaternion: np.ndarray, model: SolverModel, state: State, workspace: Workspace
) -> None:
    """Put a body where its path has it at the beginning of a step; a free one is where it is.

    `position` (b, 3) and `quaternion` (b, 4) are those of the path.
    """
    mode = model.bodies.mode[body]
    if mode != FREE:
        for i in range(4):
            state.quaternion[body, i] = quaternion[body, i]
        for i in range(3):
            state.position[body, i] = position[body, i]
        if mode == DRIVEN:
            place_driven(body, position[body], model, state, workspace.drives.axis[body])


@inlined
def prescribe_velocity(
    body: int, dt: float, velocity: np.ndarray, after: np.ndarray, model: SolverModel, state: State, workspace: Workspace
) -> None:
    """Give a body the velocity of its path, (6,); `after` (4,) is the quaternion of the path at the step's end."""
    mode = model.bodies.mode[body]
    if mode == KEYFRAMED:
        for i in range(6):
            state.velocity[body, i] = velocity[i]
    elif mode == DRIVEN:
        prepare_driven(body, dt, after, velocity, model, state, workspace)


@inlined
def write_inertia(body: int, model: SolverModel, workspace: Workspace) -> None:
    """Turn the inertia of a free body into the world's frame."""
    if model.bodies.mode[body] == FREE:
        write_world_inertia(workspace.bodies.rotation[body], model.bodies.inertia[body], workspace.bodies.inertia[body])


@inlined
def write_guess(body: int, dt: float, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write the present velocity of a body as the first guess, its momentum without contacts, and the motion of its path."""
    bodies, work, system, velocity = model.bodies, workspace.bodies, workspace.system, state.velocity
    momentum, guess, free = system.momentum, system.guess, system.free_solution
    at = bodies.first_unknown[body]
    if bodies.mode[body] == FREE:
        inertia, spin = work.inertia[body], velocity[body, 3:]
        lx, ly, lz = matrix_times_vector(inertia, spin[0], spin[1], spin[2])
        mean = mean_angular_velocity(work.rotation[body], bodies.inverse_inertia[body], lx, ly, lz, dt)
        # The spin that is solved for is the mean over the step, which makes a body tumble as it should.
        for i in range(3):
            guess[at + i] = velocity[body, i]
            free[at + i] = velocity[body, i] + dt * bodies.gravity[i]
            momentum[at + i] = bodies.mass[body] * free[at + i]
            guess[at + 3 + i] = free[at + 3 + i] = work.velocity_before[body, 3 + i] = mean[i]
            work.spin_correction[body, i] = mean[i] - spin[i]
        momentum[at + 3], momentum[at + 4], momentum[at + 5] = matrix_times_vector(inertia, mean[0], mean[1], mean[2])
    elif bodies.mode[body] == KEYFRAMED:
        write_step_motion(velocity[body], dt, work.step_motion[body])
        for i in range(12):
            work.known_step_motion[body, i] = work.step_motion[body, i]


@inlined
def write_motion(body: int, dt: float, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write the velocity and step motion of a body that follow from the guess, and the part that is not solved for.

    Of a free body that part is by how much a finite rotation exceeds ``ω × r``; of a driven one it is its carrier's motion.
    """
    bodies, work = model.bodies, workspace.bodies
    guess, velocity, motion, known = workspace.system.guess, state.velocity, work.step_motion, work.known_step_motion
    at = bodies.first_unknown[body]
    if bodies.mode[body] == FREE:
        for i in range(6):
            velocity[body, i] = guess[at + i]
        write_step_motion(velocity[body], dt, motion[body])
        for i in range(3):
            known[body, i] = 0.0
        for i in range(3, 12):
            known[body, i] = motion[body, i]
        known[body, 4] += velocity[body, 5]
        known[body, 5] -= velocity[body, 4]
        known[body, 6] -= velocity[body, 5]
        known[body, 8] += velocity[body, 3]
        known[body, 9] += velocity[body, 4]
        known[body, 10] -= velocity[body, 3]
    elif bodies.mode[body] == DRIVEN:
        for i in range(6):
            velocity[body, i] = work.carrier_velocity[body, i]
        write_step_motion(velocity[body], dt, known[body])
        for i in range(3):
            velocity[body, i] += guess[at] * workspace.drives.axis[body, i]
        write_step_motion(velocity[body], dt, motion[body])


@inlined
def add_mass(body: int, model: SolverModel, workspace: Workspace) -> None:
    """Add mass and inertia of a free body to the matrix; :func:`.add_actuators` adds those of driven ones."""
    bodies, matrix = model.bodies, workspace.system.matrix
    if bodies.mode[body] == FREE:
        at = bodies.first_unknown[body]
        for i in range(3):
            matrix[at + i, at + i] += bodies.mass[body]
            for j in range(i + 1):
                matrix[at + 3 + i, at + 3 + j] += workspace.bodies.inertia[body, i, j]


@kernel
def write_map(
    body: int, sensor_body: int, sign: float, model: SolverModel, state: State, workspace: Workspace, out: np.ndarray
) -> tuple[int, int]:
    """Write the map from a body's unknowns to relative motion in the sensor body's axes; return their index and number."""
    gx = state.position[sensor_body, 0] - state.position[body, 0]
    gy = state.position[sensor_body, 1] - state.position[body, 1]
    gz = state.position[sensor_body, 2] - state.position[body, 2]
    if model.bodies.mode[body] == KEYFRAMED:
        return -1, 0
    write_twist_map(workspace.bodies.rotation[sensor_body], gx, gy, gz, sign, out)
    if model.bodies.mode[body] == FREE:
        return model.bodies.first_unknown[body], 6
    project_on_axis(workspace.drives.axis[body], out)
    return model.bodies.first_unknown[body], 1


@inlined
def is_moved_by_path(body: int, model: SolverModel, state: State) -> bool:
    """True for a keyframed body that moves: its animation may bring any energy."""
    moves = False
    if model.bodies.mode[body] == KEYFRAMED:
        for i in range(6):
            moves = moves or state.velocity[body, i] != 0.0
    return moves


@inlined
def add_integration_loss(lost: float, body: int, dt: float, model: SolverModel, state: State) -> float:
    """Add the energy that a free body has lost since the start by being moved with the velocity of each step's end, joules.

    Gravity accelerates a body by the mean velocity and lowers it by the last: a falling body loses in each step what a rising
    one gains.
    """
    bodies = model.bodies
    if bodies.mode[body] == FREE:
        for i in range(3):
            gained = state.velocity[body, i] - bodies.initial_velocity[body, i]
            lost += 0.5 * dt * bodies.mass[body] * bodies.gravity[i] * gained
    return lost


@inlined
def move(body: int, dt: float, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Move a free body with its new velocity, and give it the orientation and spin of :func:`write_end`."""
    if model.bodies.mode[body] != FREE:
        return
    velocity, work = state.velocity[body], workspace.bodies
    for i in range(3):
        state.position[body, i] += dt * velocity[i]
        velocity[3 + i] = work.end_spin[body, i]
        for j in range(3):
            work.rotation[body, i, j] = work.end_rotation[body, i, j]
    for i in range(4):
        state.quaternion[body, i] = work.end_quaternion[body, i]
