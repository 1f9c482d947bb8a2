# SPDX-License-Identifier: GPL-3.0-or-later
"""Quantities over time: the pose of a body and a number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


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
