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
WAY, SPEED, FORCE = range(3)
TO_WAY, HOLDS_WAY, TO_SPEED, PUSH = range(4)


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
def write_axis(body, quaternion, world, axis):
    """Write the direction of a driven body's axis in the world into `axis` (3,)."""
    x, y, z = world.axis[body, 0], world.axis[body, 1], world.axis[body, 2]
    if not world.axis_in_world[body]:
        x, y, z = rotate(quaternion, x, y, z)
    axis[0], axis[1], axis[2] = x, y, z


@kernel
def place_driven(body, place, world, state, axis):
    """Put a driven body where its carrier, at `place` (3,) and with its orientation, and its drive have it."""
    write_axis(body, state.quaternion[body], world, axis)
    way = state.drives[world.drive_of[body], WAY]
    for i in range(3):
        state.position[body, i] = place[i] + way * axis[i]


@kernel
def carry_driven(body, dt, quaternion_after, carrier, world, state, scratch):
    """Prepare a driven body for a step: what its carrier alone would have it do, and the impulse that would take.

    Parameters
    ----------
    quaternion_after : (4,) float
        At the step's end.
    carrier : (6,) float
        Velocity of the body's centre of mass without the drive's way, and angular velocity.
    """
    d = world.drive_of[body]
    way, speed = state.drives[d, WAY], state.drives[d, SPEED]
    axis = scratch.axis[body]
    write_axis(body, state.quaternion[body], world, axis)
    bx, by, bz = axis[0], axis[1], axis[2]
    write_axis(body, quaternion_after, world, axis)
    carried = scratch.carried[body]
    carried[0] = carrier[0] + way * (axis[0] - bx) / dt
    carried[1] = carrier[1] + way * (axis[1] - by) / dt
    carried[2] = carrier[2] + way * (axis[2] - bz) / dt
    load = speed
    for i in range(3):
        load += axis[i] * (carried[i] - state.velocity[body, i] - dt * world.gravity[i])
    scratch.drive_mass[d] += world.mass[body]
    scratch.drive_load[d] += world.mass[body] * load
    for i in range(3):
        carried[3 + i] = carrier[3 + i]


@kernel
def servo_force(drive, speed, limited, dt, command, world, state, scratch):
    """Force of a drive at a speed at the step's end, and how it falls with that speed, N and N·s/m.

    What its own weight and its carrier's acceleration ask for is part of it, so that neither displaces a servo that is
    strong enough. Where it is not `limited`, largest force and speed are left out of account.
    """
    gains = world.drives[drive]
    wanted, slope = command[TO_SPEED], 1.0
    if command[HOLDS_WAY] > 0.0:
        pace = gains[STIFFNESS] / gains[DAMPING]
        wanted += pace * (command[TO_WAY] - state.drives[drive, WAY] - dt * speed)
        slope += pace * dt
    if limited and abs(wanted) > gains[MAX_SPEED]:
        wanted, slope = (gains[MAX_SPEED] if wanted > 0.0 else -gains[MAX_SPEED]), 1.0
    force = command[PUSH] + gains[DAMPING] * (wanted - speed) + scratch.drive_load[drive] / dt
    if limited and abs(force) > gains[MAX_FORCE]:
        return (gains[MAX_FORCE] if force > 0.0 else -gains[MAX_FORCE]), 0.0
    return force, gains[DAMPING] * slope


@kernel
def add_servos(dt, limited, commands, world, state, scratch):
    """Bring the drives, linearised at the present guess, into the linear system.

    The first round is without limits: a force that would be too large at the end of that is at its limit. The other way
    round a strong drive would be thrown from limit to limit.
    """
    for drive in range(len(world.drives)):
        at, guess = world.drive_at[drive], scratch.guess[world.drive_at[drive]]
        force, slope = servo_force(drive, guess, limited, dt, commands[drive], world, state, scratch)
        scratch.matrix[at, at] += scratch.drive_mass[drive] + dt * slope
        scratch.vector[at] += dt * (force + slope * guess)


@kernel
def move_drives(dt, commands, world, state, scratch):
    """Write down the ways, speeds and forces of the drives at the step's end."""
    for drive in range(len(world.drives)):
        speed = scratch.guess[world.drive_at[drive]]
        force, _ = servo_force(drive, speed, True, dt, commands[drive], world, state, scratch)
        state.drives[drive, WAY] += dt * speed
        state.drives[drive, SPEED], state.drives[drive, FORCE] = speed, force
