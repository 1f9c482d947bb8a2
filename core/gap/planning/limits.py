# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a planned experiment may go. Unless the user says otherwise, no deeper and no longer than the recordings went."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import ParameterError
from ..forward.predictor import Predictor

FASTEST = 0.99
"""Quantile of the speeds of a recording that counts as its fastest: single samples of a noisy pose are faster."""
LONGEST_PRESS, LONGEST_TRAVEL = 1.0, 5.0
"""A probe that moved slowly or never is planned to need this long to the full depth, and along the whole sensor, s."""
PLACE_MARGIN = 1e-9
"""Metres by which a place may lie outside the area."""


@dataclass(frozen=True)
class Limits:
    """Limits of a planned trajectory.

    Attributes
    ----------
    depth : float
        How far the probe moves beyond the first contact, m; the load where rigs know forces, N.
    speed : float
        m/s, sideways as well as up and down; N/s where rigs know forces.
    duration : float, s
    area : (float, float, float, float) or None, m
        Least and largest x, least and largest y of the places, in the sensor's frame; None is the whole sensor.
    """

    depth: float
    speed: float
    duration: float
    area: tuple[float, float, float, float] | None = None

    def __post_init__(self) -> None:
        for name in ("depth", "speed", "duration"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ParameterError(f"The limit of the {name} is {value:g}: give a positive number.")
        if self.area is not None and not (self.area[0] <= self.area[1] and self.area[2] <= self.area[3]):
            raise ParameterError("The area of the places is empty: give its least and largest x, then its least and largest y.")

    def holds(self, places: np.ndarray) -> np.ndarray:
        """Return which of some places (m, 3), in metres, lie inside the area, (m,) bool."""
        if self.area is None:
            return np.ones(len(places), bool)
        x0, x1, y0, y1 = self.area
        low, high = np.array([x0, y0]) - PLACE_MARGIN, np.array([x1, y1]) + PLACE_MARGIN
        inside: np.ndarray = ((places[:, :2] >= low) & (places[:, :2] <= high)).all(axis=1)
        return inside


def limits_of(
    predictors: Sequence[Predictor],
    depth: float | None = None,
    speed: float | None = None,
    duration: float | None = None,
    area: tuple[float, float, float, float] | None = None,
) -> Limits:
    """Return the limits that some recordings kept, or those that are given.

    Parameters
    ----------
    predictors : sequence of Predictor
    depth, speed, duration : float, optional
    area : (float, float, float, float), optional

    Raises
    ------
    ParameterError
        A given limit is not positive, or the recordings never touched the sensor and no depth is given.
    """
    if depth is None:
        depth = max(float(p.stimulus.load.max(initial=0.0)) for p in predictors if _is_like(p, predictors[0]))
        if depth <= 0.0:
            raise ParameterError("The recordings never touched the sensor: give the limit of the depth.")
        if predictors[0].trial.stimulus == "force":
            depth = max(float(np.max(p.trial.level)) for p in predictors if p.trial.level is not None)
    if speed is None:
        recorded = max(_speed(p) for p in predictors if _is_like(p, predictors[0]))
        speed = max(recorded, depth / LONGEST_PRESS, _extent(predictors[0]) / LONGEST_TRAVEL)
    if duration is None:
        duration = max(float(np.ptp(p.trial.time)) for p in predictors)
    return Limits(depth, speed, duration, area)


def _is_like(one: Predictor, other: Predictor) -> bool:
    return one.trial.stimulus == other.trial.stimulus


def _extent(predictor: Predictor) -> float:
    """Length of the sensor, m; 0 where no place is known."""
    place = predictor.rig.texels.position
    return float(np.ptp(place, axis=0).max()) if predictor.trial.stimulus == "pose" else 0.0


def _speed(predictor: Predictor) -> float:
    """Fastest motion of a recording, m/s or N/s."""
    trial = predictor.trial
    path = trial.position if trial.stimulus == "pose" else trial.level
    assert path is not None
    moved = np.diff(path.reshape(len(path), -1), axis=0)
    speeds = np.linalg.norm(moved, axis=1) / np.diff(trial.time)
    moving = speeds[speeds > 1e-3 * speeds.max(initial=0.0)]
    return float(np.quantile(moving, FASTEST)) if len(moving) else 0.0
