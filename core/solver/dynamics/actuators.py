# SPDX-License-Identifier: GPL-3.0-or-later
"""Driven bodies: a servo slides them along an axis of their carrier (kernels, and what they are told).

The way x along the axis is one more unknown of the step's linear system. Newton's law along the axis is taken for the body's
centre of mass as it moves in the world, carrier and all; the servo's force is implicit in speed and way, so that no gain
asks for a small step.
"""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import kernel
from ...geometry.rotations import rotate
from ...model.scenario import Scenario

# Columns of World.drives, State.drives and a command.
STIFFNESS, DAMPING, MAX_FORCE, MAX_SPEED = range(4)
TRAVEL, SPEED, FORCE = range(3)
TARGET_TRAVEL, HOLD_TRAVEL, TARGET_SPEED, PUSH = range(4)


def drive_table(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Number the drives of a scenario.

    Returns
    -------
    drive_of : (b,) int
        Drive of each body, -1 without one; coupled bodies share it.
    drives : (d, 4) float
        Stiffness, damping, largest force and speed; forces are those on all coupled bodies together.
    """
    leaders = [i for i, body in enumerate(scenario.bodies) if body.drive is not None and body.drive.leader is None]
    drive_of = np.full(len(scenario.bodies), -1)
    for i, body in enumerate(scenario.bodies):
        if body.drive is not None:
            drive_of[i] = leaders.index(i if body.drive.leader is None else body.drive.leader)
    rows: list[list[float]] = []
    for i in leaders:
        drive = scenario.bodies[i].drive
        assert drive is not None
        bodies = np.count_nonzero(drive_of == len(rows))
        rows.append([bodies * drive.stiffness, bodies * drive.damping, bodies * drive.max_force, drive.max_speed])
    return drive_of, np.array(rows, dtype=float).reshape(-1, 4)


@kernel
def write_axis(body, quaternion, model, axis):
    """Write the direction of a driven body's axis in the world into `axis` (3,)."""
    x, y, z = model.axis[body, 0], model.axis[body, 1], model.axis[body, 2]
    if not model.axis_in_world[body]:
        x, y, z = rotate(quaternion, x, y, z)
    axis[0], axis[1], axis[2] = x, y, z


@kernel
def place_driven(body, place, model, state, axis):
    """Put a driven body where its carrier, at `place` (3,) and with its orientation, and its drive have it."""
    write_axis(body, state.quaternion[body], model, axis)
    way = state.drives[model.drive_of[body], TRAVEL]
    for i in range(3):
        state.position[body, i] = place[i] + way * axis[i]


@kernel
def prepare_driven(body, dt, quaternion_after, carrier, model, state, workspace):
    """Prepare a driven body for a step: what its carrier alone would have it do, and the impulse that would take.

    Parameters
    ----------
    quaternion_after : (4,) float
        At the step's end.
    carrier : (6,) float
        Velocity of the body's centre of mass without the drive's way, and angular velocity.
    """
    d = model.drive_of[body]
    way, speed = state.drives[d, TRAVEL], state.drives[d, SPEED]
    axis = workspace.axis[body]
    write_axis(body, state.quaternion[body], model, axis)
    bx, by, bz = axis[0], axis[1], axis[2]
    write_axis(body, quaternion_after, model, axis)
    carried = workspace.carried[body]
    carried[0] = carrier[0] + way * (axis[0] - bx) / dt
    carried[1] = carrier[1] + way * (axis[1] - by) / dt
    carried[2] = carrier[2] + way * (axis[2] - bz) / dt
    load = speed
    for i in range(3):
        load += axis[i] * (carried[i] - state.velocity[body, i] - dt * model.gravity[i])
    workspace.drive_mass[d] += model.mass[body]
    workspace.drive_load[d] += model.mass[body] * load
    for i in range(3):
        carried[3 + i] = carrier[3 + i]


@kernel
def actuator_force(drive, speed, limited, dt, command, model, state, workspace):
    """Force of a drive at a speed at the step's end, and how it falls with that speed, N and N·s/m.

    What its own weight and its carrier's acceleration ask for is part of it, so that neither displaces a servo that is
    strong enough. Where it is not `limited`, largest force and speed are left out of account.
    """
    gains = model.drives[drive]
    wanted, slope = command[TARGET_SPEED], 1.0
    if command[HOLD_TRAVEL] > 0.0:
        pace = gains[STIFFNESS] / gains[DAMPING]
        wanted += pace * (command[TARGET_TRAVEL] - state.drives[drive, TRAVEL] - dt * speed)
        slope += pace * dt
    if limited and abs(wanted) > gains[MAX_SPEED]:
        wanted, slope = (gains[MAX_SPEED] if wanted > 0.0 else -gains[MAX_SPEED]), 1.0
    force = command[PUSH] + gains[DAMPING] * (wanted - speed) + workspace.drive_load[drive] / dt
    if limited and abs(force) > gains[MAX_FORCE]:
        return (gains[MAX_FORCE] if force > 0.0 else -gains[MAX_FORCE]), 0.0
    return force, gains[DAMPING] * slope


@kernel
def add_actuators(dt, limited, commands, model, state, workspace):
    """Bring the drives, linearised at the present guess, into the linear system.

    The first round is without limits: a force that would be too large at the end of that is at its limit. The other way
    round a strong drive would be thrown from limit to limit.
    """
    for drive in range(len(model.drives)):
        at, guess = model.drive_at[drive], workspace.guess[model.drive_at[drive]]
        force, slope = actuator_force(drive, guess, limited, dt, commands[drive], model, state, workspace)
        workspace.matrix[at, at] += workspace.drive_mass[drive] + dt * slope
        workspace.vector[at] += dt * (force + slope * guess)


@kernel
def move_drives(dt, commands, model, state, workspace):
    """Write down the ways, speeds and forces of the drives at the step's end."""
    for drive in range(len(model.drives)):
        speed = workspace.guess[model.drive_at[drive]]
        force, _ = actuator_force(drive, speed, True, dt, commands[drive], model, state, workspace)
        state.drives[drive, TRAVEL] += dt * speed
        state.drives[drive, SPEED], state.drives[drive, FORCE] = speed, force
