# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor with its part of a bake: what heat maps, markers and arrows are made of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.geometry.texels import Texels
from ...core.model.recording import SensorRecording
from ...core.model.sensor_parameters import Painted, SensorParameters
from ..session import transforms


@dataclass(frozen=True)
class BakedSensor:
    """A sensor with its part of a bake.

    Attributes
    ----------
    obj : Object
        The sensor.
    body : Object
        The object that moves it: itself, unless it is part of another one.
    texels : Texels
    painted : Painted
    parameters : SensorParameters
    readings : SensorRecording
        F frames.
    frames : (F,) int
    poses : (F, 7) float
        Position (m) and quaternion of its body.
    scale : float
        Metres per Blender unit.
    folder : Path
        Folder of the sensor's bake.
    """

    obj: object
    body: object
    texels: Texels
    painted: Painted
    parameters: SensorParameters
    readings: SensorRecording
    frames: np.ndarray
    poses: np.ndarray
    scale: float
    folder: Path

    @property
    def size(self) -> float:
        """Longest side of the sensor, Blender units."""
        return float(np.ptp(self.texels.position, axis=0).max()) / self.scale

    @property
    def in_contact(self) -> np.ndarray:
        """(F,) bool: frames in which any texel is touched."""
        return self.readings.contact.any(axis=1)

    def reactions(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the force with which the sensor pushes back, frame by frame.

        Returns
        -------
        points : (F, 3) float, Blender units, world
            Centre of pressure.
        forces : (F, 3) float, N, world
            The negative of the net force on the sensor.
        """
        points = self.poses[:, :3] + self.to_world(self.readings.centre_of_pressure)
        return points / self.scale, -self.to_world(self.readings.net_force)

    def to_world(self, vectors: np.ndarray) -> np.ndarray:
        """(F, 3) float: vectors in the body's frame, turned into the world's at each frame."""
        return np.einsum("fij,fj->fi", transforms.rotation(self.poses[:, 3:]), vectors)
