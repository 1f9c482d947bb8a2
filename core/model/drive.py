# SPDX-License-Identifier: GPL-3.0-or-later
"""An actuator that moves its body along one axis."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import ParameterError
from .motion import Signal

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
    stiffness: float = 1e5
    damping: float = 1e3
    max_force: float = 40.0
    max_speed: float = 0.05
    sensor: int = -1
    settling: float = 0.1
    period: float = 1e-3
    leader: int | None = None

    def check(self, name: str) -> None:
        """Raise :class:`ParameterError` for the first value that means nothing."""
        if self.control not in CONTROLS:
            raise ParameterError(f"The control of '{name}' is '{self.control}': choose one of {', '.join(CONTROLS)}.")
        for key in ("damping", "max_speed", "settling", "period"):
            value = getattr(self, key)
            if not (np.isfinite(value) and value > 0):
                raise ParameterError(f"{key} of driven body '{name}' is {value:g}: give it a value above zero.")
        for key in ("stiffness", "max_force"):
            value = getattr(self, key)
            if not (np.isfinite(value) and value >= 0):
                raise ParameterError(f"{key} of driven body '{name}' is {value:g}: give it a value of zero or more.")
        if not (np.isfinite(self.axis).all() and abs(np.linalg.norm(self.axis) - 1.0) < 1e-6):
            raise ParameterError(f"The axis of driven body '{name}' is not a unit vector: give it a direction.")
        if not np.isfinite(self.target.values).all():
            raise ParameterError(f"The target of driven body '{name}' is NaN or infinite: check its keyframes and drivers.")
