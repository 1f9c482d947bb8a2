# SPDX-License-Identifier: GPL-3.0-or-later
"""What all contacts of a pair of sensor and target have in common: one relative motion, one law (kernels)."""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...laws.contact_law import ContactLaw, scaled_law
from ..detection.detection_data import LANES, NORMAL, POINT, read_vector
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
