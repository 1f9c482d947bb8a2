# SPDX-License-Identifier: GPL-3.0-or-later
"""Driven bodies: an actuator slides them along an axis of their carrier (kernels, and the table of actuators).

The travel x along the axis is one more unknown of the step's linear system. Newton's law along the axis is taken for the body's
centre of mass as it moves in the world, the carrier's motion included. The actuator's force is implicit in speed and travel, so
that no gain asks for a small step.
"""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import kernel
from ...geometry.rotations import rotate
from ...model.scenario import Scenario
from ..solver_model import SolverModel, State
from ..workspace import Workspace

STIFFNESS, DAMPING, MAX_FORCE, MAX_SPEED = range(4)
"""Columns of :attr:`.Drives.gains`."""
TRAVEL, SPEED, FORCE = range(3)
"""Columns of :attr:`.State.drives`."""
TARGET_TRAVEL, HOLD_TRAVEL, TARGET_SPEED, PUSH = range(4)
"""The columns of a command are travel (m), whether it is held (0 or 1), speed (m/s), and a force that is added (N)."""


def drive_table(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Number the actuators of a scenario.

    Returns
    -------
    drive_of : (b,) int
        Actuator of each body, -1 without one; coupled bodies share it.
    gains : (d, 4) float
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
def write_axis(body: int, quaternion: np.ndarray, model: SolverModel, axis: np.ndarray) -> None:
    """Write the direction of a driven body's axis in the world into `axis` (3,)."""
    x, y, z = model.drives.axis[body, 0], model.drives.axis[body, 1], model.drives.axis[body, 2]
    if not model.drives.axis_in_world[body]:
        x, y, z = rotate(quaternion, x, y, z)
    axis[0], axis[1], axis[2] = x, y, z


@kernel
def place_driven(body: int, carrier_position: np.ndarray, model: SolverModel, state: State, axis: np.ndarray) -> None:
    """Put a driven body where its carrier, at `carrier_position` (3,) and with its orientation, and its travel put it."""
    write_axis(body, state.quaternion[body], model, axis)
    travel = state.drives[model.drives.of_body[body], TRAVEL]
    for i in range(3):
        state.position[body, i] = carrier_position[i] + travel * axis[i]


@kernel
def prepare_driven(
    body: int,
    dt: float,
    quaternion_after: np.ndarray,
    carrier: np.ndarray,
    model: SolverModel,
    state: State,
    workspace: Workspace,
) -> None:
    """Prepare a driven body for a step: its velocity if only its carrier moves, and the impulse that this motion takes.

    Parameters
    ----------
    body : int
    dt : float, seconds
    quaternion_after : (4,) float
        At the step's end.
    carrier : (6,) float
        Velocity of the body's centre of mass without the actuator's travel, and angular velocity.
    model : SolverModel
    state : State
    workspace : Workspace
    """
    d = model.drives.of_body[body]
    travel, speed = state.drives[d, TRAVEL], state.drives[d, SPEED]
    axis = workspace.drives.axis[body]
    write_axis(body, state.quaternion[body], model, axis)
    bx, by, bz = axis[0], axis[1], axis[2]
    write_axis(body, quaternion_after, model, axis)
    carried = workspace.bodies.carrier_velocity[body]
    carried[0] = carrier[0] + travel * (axis[0] - bx) / dt
    carried[1] = carrier[1] + travel * (axis[1] - by) / dt
    carried[2] = carrier[2] + travel * (axis[2] - bz) / dt
    load = speed
    for i in range(3):
        load += axis[i] * (carried[i] - state.velocity[body, i] - dt * model.bodies.gravity[i])
    workspace.drives.mass[d] += model.bodies.mass[body]
    workspace.drives.load[d] += model.bodies.mass[body] * load
    for i in range(3):
        carried[3 + i] = carrier[3 + i]


@kernel
def actuator_force(
    drive: int,
    speed: float,
    limited: bool,
    dt: float,
    command: np.ndarray,
    model: SolverModel,
    state: State,
    workspace: Workspace,
) -> tuple[float, float]:
    """Force of an actuator at a speed at the step's end, and how it falls with that speed, N and N·s/m.

    The force contains what its own weight and its carrier's acceleration take, so that neither displaces an actuator
    that is strong enough. Where it is not `limited`, largest force and speed are ignored.
    """
    gains = model.drives.gains[drive]
    wanted, slope = command[TARGET_SPEED], 1.0
    if command[HOLD_TRAVEL] > 0.0:
        pace = gains[STIFFNESS] / gains[DAMPING]
        wanted += pace * (command[TARGET_TRAVEL] - state.drives[drive, TRAVEL] - dt * speed)
        slope += pace * dt
    if limited and abs(wanted) > gains[MAX_SPEED]:
        wanted, slope = (gains[MAX_SPEED] if wanted > 0.0 else -gains[MAX_SPEED]), 1.0
    force = command[PUSH] + gains[DAMPING] * (wanted - speed) + workspace.drives.load[drive] / dt
    if limited and abs(force) > gains[MAX_FORCE]:
        return (gains[MAX_FORCE] if force > 0.0 else -gains[MAX_FORCE]), 0.0
    return force, gains[DAMPING] * slope


@kernel
def add_actuators(
    dt: float, limited: bool, commands: np.ndarray, model: SolverModel, state: State, workspace: Workspace
) -> None:
    """Add the actuators, linearised at the present guess, to the linear system.

    The first iteration is without limits: a force that is too large at the end of it is at its limit. With limits from the
    start a strong actuator would alternate between them.
    """
    system = workspace.system
    for drive in range(len(model.drives.gains)):
        at = model.drives.unknown[drive]
        guess = system.guess[at]
        force, slope = actuator_force(drive, guess, limited, dt, commands[drive], model, state, workspace)
        system.matrix[at, at] += workspace.drives.mass[drive] + dt * slope
        system.vector[at] += dt * (force + slope * guess)


@kernel
def move_drives(dt: float, commands: np.ndarray, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write down the travels, speeds and forces of the actuators at the step's end."""
    for drive in range(len(model.drives.gains)):
        speed = workspace.system.guess[model.drives.unknown[drive]]
        force, _ = actuator_force(drive, speed, True, dt, commands[drive], model, state, workspace)
        state.drives[drive, TRAVEL] += dt * speed
        state.drives[drive, SPEED], state.drives[drive, FORCE] = speed, force
