# SPDX-License-Identifier: GPL-3.0-or-later
"""Bring the bristles of a pair's contacts to the end of a step (kernels)."""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import addressed_kernel, inlined, kernel
from ...geometry.rotations import matrix_times_vector
from ...laws.contact_law import ContactLaw, scaled_law
from ...laws.friction import deflection_scale, next_deflection
from ..detection.deformation import frame_at
from ..detection.detection_data import (
    BRISTLE,
    GAIN,
    KEEP,
    LANES,
    LIMIT,
    NORMAL,
    OTHER,
    POINT,
    DetectionData,
    SurfaceMotion,
    read_vector,
    write_vector,
)
from ..solver_model import SolverModel, State
from ..workspace import ContactWork, Workspace


@kernel
def relative_motion(
    a: int, b: int, step_motion: np.ndarray, position: np.ndarray, rotation: np.ndarray, motion: np.ndarray
) -> None:
    """How the points of body `b` move relative to body `a`, in the axes of `a`: ``v = U + W p`` (Eq. 3).

    `p` is a point's position relative to the reference point of `a`. One motion serves all contacts of a pair.

    Parameters
    ----------
    a, b : int
        Bodies.
    step_motion, position, rotation : (b, 12), (b, 3), (b, 3, 3) float
        Of all bodies (see :class:`.BodyWork`).
    motion : (12,) float
        Written: U (m/s), then W (1/s) row by row.
    """
    turns = False
    for i in range(3, 12):
        turns = turns or step_motion[b, i] != 0.0 or step_motion[a, i] != 0.0
    for k in range(12):
        motion[k] = 0.0
    for i in range(3):
        u = step_motion[b, i] - step_motion[a, i]
        for j in range(3):
            u += step_motion[b, 3 + 3 * i + j] * (position[a, j] - position[b, j])
        for k in range(3):
            motion[k] += rotation[a, i, k] * u
    if turns:
        for k in range(3):
            for m in range(3):
                total = 0.0
                for i in range(3):
                    for j in range(3):
                        w = step_motion[b, 3 + 3 * i + j] - step_motion[a, 3 + 3 * i + j]
                        total += rotation[a, i, k] * w * rotation[a, j, m]
                motion[3 + 3 * k + m] = total


@kernel
def write_pair_motion(pair: int, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write the relative motion of a pair's bodies, as their present step motions say it, into the workspace."""
    a, b = model.pairs.sensor_body[pair], model.pairs.target_body[pair]
    bodies = workspace.bodies
    relative_motion(a, b, bodies.step_motion, state.position, bodies.rotation, workspace.pairs.motion[pair])


@kernel
def motion_values(motion: np.ndarray) -> tuple[float, ...]:
    """The twelve numbers of a motion as a tuple, which may stay in registers; those of an array may not."""
    return (
        motion[0], motion[1], motion[2], motion[3], motion[4], motion[5],
        motion[6], motion[7], motion[8], motion[9], motion[10], motion[11],
    )  # fmt: skip


@kernel
def point_law(law: ContactLaw, multipliers: np.ndarray, point: int) -> ContactLaw:
    """The law of a pair with the painted multipliers of one of its contact points."""
    if len(multipliers) == 0:
        return law
    return scaled_law(law, multipliers[point, 0], multipliers[point, 1])


@inlined
def velocity_at(point: tuple[float, float, float], motion: tuple[float, ...]) -> tuple[float, float, float]:
    """Velocity of the target at a contact point relative to the sensor, in the axes of the sensor's body, m/s."""
    px, py, pz = point
    return (
        motion[0] + motion[3] * px + motion[4] * py + motion[5] * pz,
        motion[1] + motion[6] * px + motion[7] * py + motion[8] * pz,
        motion[2] + motion[9] * px + motion[10] * py + motion[11] * pz,
    )


@inlined
def row_of(r: int, pair: int, contacts: ContactWork) -> tuple[int, int]:
    """Block and lane of the r-th contact of a pair."""
    return contacts.first_block[pair] + r // LANES, r % LANES


@inlined
def row_velocity(
    block: int, lane: int, motion: tuple[float, ...], moving: bool, contacts: ContactWork
) -> tuple[float, float, float, float]:
    """Velocity of the target at a contact, relative to the sensor, m/s, and its part along the normal.

    Parameters
    ----------
    block, lane : int
        Row of the contact.
    motion : tuple of 12 float
        Relative motion of the two bodies.
    moving : bool
        The target or the sensor deforms, which adds to the velocity.
    contacts : ContactWork

    Returns
    -------
    vx, vy, vz : float
    rate : float
        Of the depth.
    """
    vx, vy, vz = velocity_at(read_vector(contacts.rows, block, POINT, lane), motion)
    if moving:
        ux, uy, uz = read_vector(contacts.surface_velocity, block, 0, lane)
        vx, vy, vz = vx + ux, vy + uy, vz + uz
    nx, ny, nz = read_vector(contacts.rows, block, NORMAL, lane)
    return vx, vy, vz, vx * nx + vy * ny + vz * nz


@addressed_kernel
def update_pair_friction(
    pair: int, dt: float, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace
) -> None:
    """Bring the bristle deflections of a pair to the step's end, in the sensor's axes at that time."""
    if workspace.contacts.number[pair] == 0:
        return
    write_pair_motion(pair, model, state, workspace)
    _write_motion_at_step_end(pair, dt, model, workspace)
    if workspace.contacts.deforming[pair]:
        _rotate_surface_velocities(pair, workspace)
    if detection.surfaces.sensor_deforms[model.pairs.sensor[pair]]:
        _rotate_rows(pair, model, detection.surfaces, workspace)
    _update_bristles(pair, motion_values(workspace.pairs.known_motion[pair]), state, workspace)


@kernel
def _rotate_surface_velocities(pair: int, workspace: Workspace) -> None:
    """Rotate the velocities that deformation adds by the sensor's rotation during the step."""
    contacts, rotation = workspace.contacts, workspace.pairs.rotations[pair, 0]
    for r in range(contacts.number[pair]):
        b, lane = row_of(r, pair, contacts)
        turned = matrix_times_vector(rotation, *read_vector(contacts.surface_velocity, b, 0, lane))
        write_vector(contacts.surface_velocity, b, 0, lane, *turned)


@kernel
def _update_bristles(pair: int, motion: tuple[float, ...], state: State, workspace: Workspace) -> None:
    """Bring the bristles of a pair's contacts to the step's end, at the velocities of `motion`."""
    contacts, bristle = workspace.contacts, state.bristle
    rows, slots = contacts.rows, contacts.slots
    surface_velocity, moving = contacts.surface_velocity, contacts.deforming[pair]
    first, left = contacts.first_block[pair], contacts.number[pair]
    for b in range(first, first + (left + LANES - 1) // LANES):
        for lane in range(LANES):  # runs in vector registers: no branches, no calls
            nx, ny, nz = read_vector(rows, b, NORMAL, lane)
            vx, vy, vz = velocity_at(read_vector(rows, b, POINT, lane), motion)
            if moving:
                ux, uy, uz = read_vector(surface_velocity, b, 0, lane)
                vx, vy, vz = vx + ux, vy + uy, vz + uz
            keep, gain = rows[b, KEEP + lane], rows[b, GAIN + lane]
            rate = vx * nx + vy * ny + vz * nz
            zx, zy, zz = read_vector(rows, b, BRISTLE, lane)
            zx = next_deflection(keep, zx, gain, vx - rate * nx)
            zy = next_deflection(keep, zy, gain, vy - rate * ny)
            zz = next_deflection(keep, zz, gain, vz - rate * nz)
            scale = deflection_scale(zx * zx + zy * zy + zz * zz, rows[b, LIMIT + lane])
            write_vector(rows, b, BRISTLE, lane, scale * zx, scale * zy, scale * zz)
        for lane in range(min(left, LANES)):
            slot = slots[b, lane]
            bristle[slot, 0], bristle[slot, 1], bristle[slot, 2] = read_vector(rows, b, BRISTLE, lane)
        left -= LANES


@kernel
def _write_motion_at_step_end(pair: int, dt: float, model: SolverModel, workspace: Workspace) -> None:
    """Rotate a pair's relative motion by the sensor's rotation during the step, ``(1 + dt W)ᵀ`` in its own axes.

    The result is written over the pair's known motion, and the rotation into the first of the pair's rotations.
    """
    a, step_motion, rotation = model.pairs.sensor_body[pair], workspace.bodies.step_motion, workspace.bodies.rotation
    motion, result = workspace.pairs.motion[pair], workspace.pairs.known_motion[pair]
    turned = workspace.pairs.rotations[pair, 0]
    turns = False
    for i in range(12):
        result[i] = motion[i]
        turns = turns or (i > 2 and step_motion[a, i] != 0.0)
    for k in range(3):
        for m in range(3):
            turned[k, m] = 1.0 if k == m else 0.0
    for k in range(3 if turns else 0):
        for m in range(3):
            turn = 0.0  # entry (m, k) of the sensor's W in its own axes
            for i in range(3):
                for j in range(3):
                    turn += rotation[a, i, m] * step_motion[a, 3 + 3 * i + j] * rotation[a, j, k]
            turned[k, m] += dt * turn
            result[k] += dt * turn * motion[m]
            for j in range(3):
                result[3 + 3 * k + j] += dt * turn * motion[3 + 3 * m + j]


@kernel
def _rotate_rows(pair: int, model: SolverModel, surfaces: SurfaceMotion, workspace: Workspace) -> None:
    """Rotate normals and bristles of a pair's rows as the texels of its deforming sensor rotate during the step.

    A bristle is carried along with its texel, as a rigid sensor carries all of its own.
    """
    sensor, contacts, frame = model.pairs.sensor[pair], workspace.contacts, model.points.frame
    rows, turn = contacts.rows, workspace.pairs.rotations[pair, 1]
    for r in range(contacts.number[pair]):
        block, lane = contacts.first_block[pair] + r // LANES, r % LANES
        point = model.pairs.first_point[pair] + contacts.slots[block, lane] - model.pairs.first_slot[pair]
        after = frame_at(surfaces, surfaces.clock[OTHER], sensor, point - model.sensors.first_point[sensor])
        for row in range(3):
            for column in range(3):
                turn[row, column] = 0.0
                for axis in range(3):
                    turn[row, column] += after[3 + 3 * axis + row] * frame[point, 3 + 3 * axis + column]
        for first in (NORMAL, BRISTLE):
            turned = matrix_times_vector(turn, *read_vector(rows, block, first, lane))
            write_vector(rows, block, first, lane, *turned)
