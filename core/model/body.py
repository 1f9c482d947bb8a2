# SPDX-License-Identifier: GPL-3.0-or-later
"""A rigid body."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from .drive import Drive
from .motion import Motion


class Mode(IntEnum):
    """What moves a body: its animation; forces; or its animation together with an actuator along an axis.

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
        """What moves the body."""
        return Mode.FREE if self.free else Mode.DRIVEN if self.drive is not None else Mode.KEYFRAMED

    @property
    def moved_by_forces(self) -> bool:
        """True when forces change the path of the body: it is free or driven."""
        return self.mode != Mode.KEYFRAMED
