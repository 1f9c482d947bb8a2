# SPDX-License-Identifier: GPL-3.0-or-later
"""Controllers of a gripper. They use tactile data and nothing of the simulation, so that they can drive real hardware.

A controller receives an array of values from the sensor's electronics, at its own rate, and returns a :class:`Command` to the
drive of the finger. In a simulation :mod:`.drive_commands` calls it; on a robot, a loop of five lines does::

    controller = GripControl(speed=0.05, max_force=40.0)
    while True:
        command = controller.update(TactileData(rows, columns, sensor.read()), target=5.0, seconds=0.001)
        drive.set(command.velocity, command.push)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...errors import ParameterError


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
