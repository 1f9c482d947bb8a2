# SPDX-License-Identifier: GPL-3.0-or-later
"""Driven bodies: an actuator slides them along an axis of their carrier (kernels, and the table of actuators).

The travel x along the axis is one more unknown of the step's linear system. Newton's law along the axis is taken for the body's
centre of mass as it moves in the world, the carrier's motion included. The actuator's force is implicit in speed and travel, so
that no gain asks for a small step.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...compiled.kernels import kernel
from ...errors import ParameterError
from ...geometry.grid_layout import GridLayout
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


# Controllers of a gripper. They use tactile data and nothing of the simulation, so that they can drive real hardware.
#
# A controller receives an array of values from the sensor's electronics, at its own rate, and returns a :class:`Command` to the
# drive of the finger. In a simulation :class:`DriveCommands` calls it; on a robot, a loop of five lines does::
#
#     controller = GripControl(speed=0.05, max_force=40.0)
#     while True:
#         command = controller.update(TactileData(rows, columns, sensor.read()), target=5.0, seconds=0.001)
#         drive.set(command.velocity, command.push)


@dataclass(frozen=True)
class TactileData:
    """One reading of a tactile sensor.

    Attributes
    ----------
    rows, columns : int
        Size of the array; a sensor that is no grid has one column.
    values : (rows · columns,) float, N
        Normal force of each texel, row by row.
    """

    rows: int
    columns: int
    values: np.ndarray

    @property
    def total(self) -> float:
        """Sum of the values, N."""
        return float(np.sum(self.values))


class Command(NamedTuple):
    """Command to a drive; positive is the direction in which the finger closes.

    Its force is ``push + damping (velocity - speed)``, and while `homing` also a spring to where it started.

    Attributes
    ----------
    velocity : float, m/s
    push : float, N
    homing : bool
        Go back to where the drive started, no faster than its speed limit.
    """

    velocity: float
    push: float = 0.0
    homing: bool = False


@dataclass
class GripControl:
    """Velocity until first touch, then force control on the tactile sum (paper, section 5.2.2 and Fig. 12).

    After the first touch the drive pushes with the wanted force and damps its own motion. An integral slowly adds what the
    sensor's sum still lacks: a curved object presses the texels sideways as well, and a guide has friction. The stiffness of
    object and sensor need not be known. When the touch is lost the finger approaches again; a target of zero or less opens it.

    Attributes
    ----------
    speed : float, m/s
        Of the approach.
    max_force : float, N
        The push never exceeds it.
    settling : float, seconds
        Time constant of the integral: longer than the time in which finger and foam come to rest.
    touch : float, N
        Sum from which on the finger touches.
    push : float, N
        Present push.
    touching : bool
    """

    speed: float
    max_force: float
    settling: float = 0.1
    touch: float = 1e-3
    push: float = field(default=0.0, init=False)
    touching: bool = field(default=False, init=False)
    _wanted: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        for name in ("speed", "max_force", "settling"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ParameterError(f"{name} of a grip controller is {value:g}: give it a value above zero.")

    def update(self, data: TactileData, target: float, seconds: float) -> Command:
        """Return the command for the next period.

        Parameters
        ----------
        data : TactileData
        target : float, N
            Wanted sum; zero or less opens the finger.
        seconds : float
            Since the last update.
        """
        if target <= 0.0:
            self.touching = False
            return Command(0.0, homing=True)
        total = data.total
        was_touching, self.touching = self.touching, total > min(self.touch, 0.5 * target)
        if not self.touching:
            return Command(self.speed)
        self.push = target if not was_touching else self.push + target - self._wanted
        self.push += (target - total) * seconds / self.settling
        self.push, self._wanted = min(max(self.push, 0.0), self.max_force), target
        return Command(0.0, self.push)


class DriveCommands:
    """The targets and controllers of a scenario's actuators.

    Parameters
    ----------
    scenario : Scenario
    """

    def __init__(self, scenario: Scenario):
        self._scenario = scenario
        drives = [(i, body.drive) for i, body in enumerate(scenario.bodies) if body.drive is not None]
        self._drives = {i: drive for i, drive in drives if drive.leader is None}
        self._targets = {body: drive.target for body, drive in self._drives.items()}
        self._coupled = Counter(i if drive.leader is None else drive.leader for i, drive in drives)
        self._controllers = {
            body: GripControl(drive.max_speed, drive.max_force, drive.settling)
            for body, drive in self._drives.items()
            if drive.control == "force"
        }

    @property
    def reads_sensors(self) -> bool:
        """Whether any actuator has a controller."""
        return bool(self._controllers)

    def extend(self, time: float, targets: Mapping[int, float]) -> None:
        """Append the next targets of some bodies' actuators."""
        for body, value in targets.items():
            if body in self._targets and self._targets[body].times[-1] < time - 1e-9:
                self._targets[body] = self._targets[body].extended(time, value)

    def control_intervals(
        self, times: np.ndarray, dt: float, read: Callable[[int], np.ndarray]
    ) -> Iterator[tuple[int, int, np.ndarray]]:
        """Yield the steps of a frame in intervals during which no controller is updated.

        Parameters
        ----------
        times : (steps + 1,) float, seconds
        dt : float, seconds
        read : callable
            Returns the (n,) values of a sensor, by its index, in the present state.

        Yields
        ------
        first, last : int
            Steps, the last one excluded.
        commands : (steps, d, 4) float
            Valid for these steps.
        """
        steps = len(times) - 1
        commands = np.zeros((steps, len(self._drives), 4))
        for i, (body, drive) in enumerate(self._drives.items()):
            target = self._targets[body].at(times)
            if drive.control == "position":
                commands[:, i, TARGET_TRAVEL], commands[:, i, HOLD_TRAVEL] = target[1:], 1.0
                commands[:, i, TARGET_SPEED] = np.diff(target) / dt
            elif drive.control == "velocity":
                commands[:, i, TARGET_SPEED] = target[1:]
        turns = {body: range(0, steps, max(1, round(self._drives[body].period / dt))) for body in self._controllers}
        stops = sorted({0, steps}.union(*turns.values()))
        for first, last in zip(stops, stops[1:], strict=False):
            for i, body in enumerate(self._drives):
                if first in turns.get(body, ()):
                    seconds = min(turns[body].step, steps - first) * dt
                    wanted = float(self._targets[body].at(times[first + 1 : first + 2])[0])
                    commands[first:, i] = self._controller_command(body, wanted, seconds, read)
            yield first, last, commands

    def _controller_command(self, body: int, target: float, seconds: float, read: Callable[[int], np.ndarray]) -> np.ndarray:
        """Return the (4,) command of a controller for the next `seconds`."""
        sensor = self._drives[body].sensor
        values = read(sensor)
        layout = self._scenario.sensors[sensor].texels.layout
        if isinstance(layout, GridLayout):
            rows, columns, values = layout.rows, layout.columns, layout.image(values).ravel()
        else:
            rows, columns = len(values), 1
        told: Command = self._controllers[body].update(TactileData(rows, columns, values), target, seconds)
        command = np.zeros(4)
        command[TARGET_SPEED], command[HOLD_TRAVEL] = told.velocity, told.homing
        command[PUSH] = told.push * self._coupled[body]
        return command
