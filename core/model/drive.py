# SPDX-License-Identifier: GPL-3.0-or-later
"""An actuator that moves its body along one axis."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf

import numpy as np

from ..errors import ParameterError
from .motion import Signal
from .parameter import Parameter, specifications, specified

CONTROLS = ("position", "velocity", "force")
"""What the target of a :class:`Drive` is: metres along the axis, metres per second, or newtons of a sensor's tactile sum."""


@dataclass(frozen=True)
class Drive:
    """A servo that slides its body along one axis, with no more than a certain force.

    The body's motion is that of its carrier: the drive adds a way along the axis. The servo's force is
    ``stiffness (x* - x) + damping (v* - v)`` with its own weight and its carrier's acceleration fed forward, all of it
    together limited to `max_force`.

    Attributes
    ----------
    control : str
        One of :data:`CONTROLS`.
    target : Signal
        In m from where the motion has the body, m/s, or N.
    axis : (3,) float
        Unit vector, the direction of positive ways; a finger closes along it.
    axis_in_world : bool
        True when the axis stands still in the world; False when it is given in the body's own frame and turns along.
    stiffness, damping : float, N/m and N·s/m
    max_force : float, N
    max_speed : float, m/s
        That the servo asks for; force control approaches with it.
    sensor : int
        For force control: the sensor whose tactile sum is controlled.
    settling, period : float, seconds
        For force control: time constant of :class:`.grip_controller.GripControl`, and how often it is asked.
    leader : int or None
        Body whose drive moves this body as well, each along its own axis by the same way, as the two fingers of a parallel
        gripper; then only the axis of this drive counts. What is said of forces is said of each of them.
    """

    control: str = "position"
    target: Signal = field(default_factory=lambda: Signal.constant(0.0))
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    axis_in_world: bool = False
    # fmt: off
    stiffness: float = specified(Parameter(
        "stiffness", "N/m", 1e5, 0.0, inf, "Position control: force per metre that is lacking", label="Stiffness"))
    damping: float = specified(Parameter(
        "damping", "N·s/m", 1e3, 0.0, inf, "Force for each m/s that is lacking", above_low=True, label="Damping"))
    max_force: float = specified(Parameter(
        "max_force", "N", 40.0, 0.0, inf, "Largest force of the drive", label="Max Force"))
    max_speed: float = specified(Parameter(
        "max_speed", "m/s", 0.05, 0.0, inf, "Speed that the drive asks for at the most", above_low=True, label="Max Speed",
        note="Force control approaches with it"))
    sensor: int = -1
    settling: float = specified(Parameter(
        "settling", "s", 0.1, 0.0, inf, "Force control: time in which the rest is made up", above_low=True, label="Settling",
        note="Longer than the foam swings"))
    period: float = specified(Parameter(
        "period", "s", 1e-3, 0.0, inf, "Force control: time between two looks at the sensor", above_low=True))
    # fmt: on
    leader: int | None = None

    def check(self, name: str) -> None:
        """Raise :class:`ParameterError` for the first value that means nothing."""
        if self.control not in CONTROLS:
            raise ParameterError(f"The control of '{name}' is '{self.control}': choose one of {', '.join(CONTROLS)}.")
        for key, specification in DRIVE_PARAMETERS.items():
            specification.check(getattr(self, key), f"driven body '{name}'")
        if not (np.isfinite(self.axis).all() and abs(np.linalg.norm(self.axis) - 1.0) < 1e-6):
            raise ParameterError(f"The axis of driven body '{name}' is not a unit vector: give it a direction.")
        if not np.isfinite(self.target.values).all():
            raise ParameterError(f"The target of driven body '{name}' is NaN or infinite: check its keyframes and drivers.")


DRIVE_PARAMETERS = specifications(Drive)
"""The specifications of a drive's parameters by name."""
