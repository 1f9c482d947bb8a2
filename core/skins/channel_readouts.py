# SPDX-License-Identifier: GPL-3.0-or-later
"""Readouts of several channels: the field of magnets that its texels carry, or a linear map of its forces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import SensorError
from ..geometry.texels import Texels
from ..model.recording import AXES, Recording, SensorArrays, VectorReadings
from .magnetic_skin import MagneticSkin, texel_displacements


@dataclass(frozen=True)
class ReadoutMatrix:
    """A linear map from loads of texels to channels.

    Attributes
    ----------
    matrix : (c, n·q) float
        Channel per load, the q loads of a texel side by side.
    offset : (c,) float or float
    """

    matrix: np.ndarray
    offset: np.ndarray | float = 0.0

    def channels(self, loads: np.ndarray) -> np.ndarray:
        """Return the channels, (c,) float, of the loads (n, q) of the texels at one frame."""
        found: np.ndarray = (self.matrix @ loads.reshape(1, -1).T).T[0] + self.offset
        return found


@dataclass(frozen=True)
class MagneticReadout:
    """Magnetometers below a sensor's texels: three channels each.

    Attributes
    ----------
    skin : MagneticSkin
    texels : Texels
        Of the sensor.
    shear_stiffness : float, N/m
        Of one texel: its surface moves by its shear divided by it.
    """

    skin: MagneticSkin
    texels: Texels
    shear_stiffness: float

    def __post_init__(self) -> None:
        """Raise SensorError if the skin is one of other texels."""
        own = self.skin.weights.shape[1]
        if own != len(self.texels):
            raise SensorError(f"The skin has {own} texels and its sensor {len(self.texels)}: make the skin for this sensor.")

    def no_frames(self) -> VectorReadings:
        """Return the channels of a recording without frames."""
        place = self.skin.magnetometers.place
        return VectorReadings(np.zeros((0, len(place), 3)), np.zeros((0, len(place), 3), bool), place=place)

    def channels(self, recorded: SensorArrays) -> VectorReadings:
        """Return the readings of the magnetometers; a magnet that is pressed into one counts as clipped."""
        moved = texel_displacements(self.texels, recorded.depth, recorded.shear, self.shear_stiffness)
        return self.skin.readings(moved, refuses_near=False)


@dataclass(frozen=True)
class LinearReadout:
    """Channels that are linear in the forces of the texels.

    Attributes
    ----------
    readout : ReadoutMatrix
        Of k·c channels from n·3 loads: each texel's normal force and its shear along x and y, N.
    place : (k, 3) float, m
        Of each group of c channels.
    names : (c,) tuple of str
    unit : str
    """

    readout: ReadoutMatrix
    place: np.ndarray
    names: tuple[str, ...] = AXES
    unit: str = "N"

    def no_frames(self) -> VectorReadings:
        """Return the channels of a recording without frames."""
        shape = 0, len(self.place), len(self.names)
        return VectorReadings(np.zeros(shape), np.zeros(shape, bool), self.unit, self.names, self.place)

    def channels(self, recorded: SensorArrays) -> VectorReadings:
        """Return the channels, which have no range."""
        loads = np.concatenate([recorded.normal_force[..., None], recorded.shear], axis=2)
        none = self.no_frames()
        values = np.array([self.readout.channels(one) for one in loads]).reshape(-1, *none.values.shape[1:])
        return replace(none, values=values, clipped=np.zeros(values.shape, bool))


def net_force_of(texels: Texels) -> LinearReadout:
    """Return the read-out of a pad on a load cell in the middle of its texels: the sum of their forces along x, y and z of its
    body. A pressed texel is pushed against its normal.
    """
    directions = np.stack([-texels.normal, texels.tangent, np.cross(texels.normal, texels.tangent)], axis=1)
    return LinearReadout(ReadoutMatrix(directions.reshape(-1, 3).T), texels.position.mean(axis=0)[None])


def with_clipping_warnings(recording: Recording) -> Recording:
    """Return a recording with a warning for each sensor whose channels were beyond their range."""
    found = []
    for name, sensor in recording.sensors.items():
        if sensor.channels is not None:
            parts = (part.sensors[name].channels for part in recording.blocks())
            clipped = np.concatenate([part.clipped for part in parts if part is not None])
            sentence = replace(sensor.channels, values=clipped, clipped=clipped).said()
            found += [f"Sensor '{name}', {sentence}"] if sentence else []
    return replace(recording, warnings=(*recording.warnings, *found)) if found else recording
