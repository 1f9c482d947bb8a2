# SPDX-License-Identifier: GPL-3.0-or-later
"""A rigid body."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ParameterError
from .parameter import Parameter, specifications, specified


@dataclass(frozen=True)
class Motion:
    """Poses of the frame of a body over time. :attr:`.Scenario.interpolation` says how they are interpolated.

    Attributes
    ----------
    times : (m,) float, seconds, increasing
    positions : (m, 3) float, metres, world frame
    quaternions : (m, 4) float, unit, (w, x, y, z), body to world
    """

    times: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray

    @classmethod
    def at_rest(cls, position: ArrayLike = (0.0, 0.0, 0.0), quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> Motion:
        """Return the motion of a body that stays where it is."""
        return cls(np.zeros(1), np.atleast_2d(np.array(position, float)), np.atleast_2d(np.array(quaternion, float)))

    def extended(self, time: float, position: np.ndarray, quaternion: np.ndarray) -> Motion:
        """Return this motion with one more sample at its end. The timeline reads poses frame by frame."""
        return Motion(
            np.append(self.times, time), np.vstack([self.positions, position]), np.vstack([self.quaternions, quaternion])
        )


@dataclass(frozen=True)
class Signal:
    """A number over time: linear between samples, and constant before the first and after the last.

    Attributes
    ----------
    times : (m,) float, seconds, increasing
    values : (m,) float
    """

    times: np.ndarray
    values: np.ndarray

    @classmethod
    def constant(cls, value: float) -> Signal:
        """Return the signal that never changes."""
        return cls(np.zeros(1), np.array([float(value)]))

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the (n,) values at (n,) times."""
        return np.interp(times, self.times, self.values)

    def extended(self, time: float, value: float) -> Signal:
        """Return this signal with one more sample at its end."""
        return Signal(np.append(self.times, time), np.append(self.values, value))


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
        See the specifications below. `settling` is the time constant of :class:`.actuators.GripControl`.
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


class Mode(IntEnum):
    """Motion of a body: by its animation, by forces, or by its animation and an actuator along an axis.

    What follows from it in the solver is in :mod:`palpate.core.solver.dynamics.modes`.
    """

    KEYFRAMED = 0
    FREE = 1
    DRIVEN = 2


@dataclass(frozen=True)
class Body:
    """A rigid body: free when forces move it, driven when it has a drive, else keyframed.

    Attributes
    ----------
    name : str
    motion : Motion
        The path of a keyframed body, or the path of a driven body without the displacement by its drive. The first sample is
        the start of a free body.
    free : bool
        True when forces move it, False when `motion` does.
    drive : Drive or None
    mass : float, kg
    center_of_mass : (3,) float, metres, body frame
    inertia : (3, 3) float, kg·m², about the centre of mass, body axes
    velocity, angular_velocity : (3,) float, m/s and rad/s, world frame
        Of a free body at the start.
    """

    name: str
    motion: Motion
    free: bool = False
    mass: float = 1.0
    center_of_mass: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray = field(default_factory=lambda: np.eye(3))
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    angular_velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    drive: Drive | None = None

    @property
    def mode(self) -> Mode:
        """Animation, forces, or animation and an actuator."""
        return Mode.FREE if self.free else Mode.DRIVEN if self.drive is not None else Mode.KEYFRAMED

    @property
    def moved_by_forces(self) -> bool:
        """True when forces change the path of the body: it is free or driven."""
        return self.mode != Mode.KEYFRAMED
