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
"""The target of a :class:`Drive` is a distance along the axis (m), a speed (m/s) or the sum of a sensor's forces (N)."""


@dataclass(frozen=True)
class Drive:
    """An actuator that moves its body along one axis with a limited force.

    The body follows the motion of its carrier, and the drive adds a displacement along the axis. The force of the actuator is
    ``stiffness (x* - x) + damping (v* - v)`` plus a feed-forward of the body's weight and of the carrier's acceleration. The
    sum is limited to `max_force`.

    Attributes
    ----------
    control : str
        One of :data:`CONTROLS`.
    target : Signal
        For position control in m, counted from where the motion puts the body; else in m/s or N.
    axis : (3,) float
        Unit vector of positive displacements; a finger closes along it.
    axis_in_world : bool
        True when the axis is fixed in the world; False when it is fixed in the frame of the body and turns with it.
    stiffness, damping, max_force, max_speed, settling, period : float
        See the specifications below. `settling` is the time constant of :class:`.grip_controller.GripControl`.
    sensor : int
        For force control: index of the sensor whose sum of normal forces is controlled.
    leader : int or None
        Index of the body whose drive also moves this body: both move by the same distance, each along its own axis, as the two
        fingers of a parallel gripper do. Of this drive only the axis counts then. Forces are those of each body.
    """

    control: str = "position"
    target: Signal = field(default_factory=lambda: Signal.constant(0.0))
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    axis_in_world: bool = False
    # fmt: off
    stiffness: float = specified(Parameter(
        "stiffness", "N/m", 1e5, 0.0, inf, "Position control: force per metre of error", label="Stiffness"))
    damping: float = specified(Parameter(
        "damping", "N·s/m", 1e3, 0.0, inf, "Force per m/s of error", above_low=True, label="Damping"))
    max_force: float = specified(Parameter(
        "max_force", "N", 40.0, 0.0, inf, "Largest force of the drive", label="Max Force"))
    max_speed: float = specified(Parameter(
        "max_speed", "m/s", 0.05, 0.0, inf, "Largest speed that the drive commands", above_low=True, label="Max Speed",
        note="Force control approaches with it"))
    sensor: int = -1
    settling: float = specified(Parameter(
        "settling", "s", 0.1, 0.0, inf, "Force control: time constant of the error", above_low=True, label="Settling",
        note="Longer than the foam's oscillation"))
    period: float = specified(Parameter(
        "period", "s", 1e-3, 0.0, inf, "Force control: sampling period of the sensor", above_low=True))
    # fmt: on
    leader: int | None = None

    def check(self, name: str) -> None:
        """Raise :class:`ParameterError` for the first value of the drive of body `name` that has no meaning."""
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
