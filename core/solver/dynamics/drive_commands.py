# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands to the actuators, step by step: their targets over time, or the output of controllers that read a sensor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from ...geometry.layout.grid_layout import GridLayout
from ...model.scenario import Scenario
from .actuators import HOLD_TRAVEL, PUSH, TARGET_SPEED, TARGET_TRAVEL
from .grip_controller import Command, GripControl, TactileData


class DriveCommands:
    """The targets and controllers of a scenario's actuators.

    Parameters
    ----------
    scenario : Scenario
    """

    def __init__(self, scenario: Scenario):
        self._scenario = scenario
        self._drives = {
            i: body.drive for i, body in enumerate(scenario.bodies) if body.drive is not None and body.drive.leader is None
        }
        self._targets = {body: drive.target for body, drive in self._drives.items()}
        self._coupled = {body: 1 for body in self._drives}
        for other in scenario.bodies:
            if other.drive is not None and other.drive.leader is not None:
                self._coupled[other.drive.leader] += 1
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
