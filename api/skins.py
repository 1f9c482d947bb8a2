# SPDX-License-Identifier: GPL-3.0-or-later
"""Magnetic skins: sensors whose texels carry magnets over magnetometers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from . import arguments

if TYPE_CHECKING:
    from ..core.response.magnetic_skin import MagneticSkin
    from .sensors import Sensor

FULL_SCALE = 50e-3
"""T: range of usual three-axis Hall chips."""


def magnetic_skin(
    sensor: Sensor,
    magnets: ArrayLike,
    moments: ArrayLike,
    magnetometers: ArrayLike,
    thickness: float,
    full_scale: float = FULL_SCALE,
    axes: ArrayLike | None = None,
    offset: ArrayLike = 0.0,
) -> MagneticSkin:
    """Return a compliant layer with magnets that move with a sensor's texels, over magnetometers.

    Parameters
    ----------
    sensor : Sensor
        Its texels are the surface of the layer. All places are in the frame of its texels.
    magnets, moments : (m, 3) float, m and A·m²
        Places at rest and dipole moments. One moment may stand for all.
    magnetometers : (k, 3) float, m
        Below the layer, which has a rigid base.
    thickness : float, m
        Of the layer.
    full_scale : float, T
        What exceeds it is clipped.
    axes : (k, 3, 3) float, optional
        Unit vectors of each magnetometer's x, y and z axis. Default: those of the frame.
    offset : (k, 3) float, T, or a number
        What the axes show without magnets.

    Returns
    -------
    MagneticSkin
        For ``Recording.channels(skin)``; ``readings(displacement)`` takes displacements (T, n, 3) in metres.

    Raises
    ------
    PalpateError
        Shapes do not agree, a magnet is outside of the layer, or a magnetometer is inside of a magnet's reach.
    """
    from ..core.response import magnetic_skin as core

    place = arguments.numbers(magnets, (-1, 3), "magnets")
    chips = arguments.numbers(magnetometers, (-1, 3), "magnetometers")
    shape = (3,) if np.ndim(moments) == 1 else place.shape
    moment = np.broadcast_to(arguments.numbers(moments, shape, "moments"), place.shape)
    directions = np.tile(np.eye(3), (len(chips), 1, 1)) if axes is None else arguments.numbers(axes, (len(chips), 3, 3), "axes")
    zero = np.broadcast_to(arguments.numbers(offset, () if np.ndim(offset) == 0 else chips.shape, "offset"), chips.shape)
    own = core.Magnetometers(chips, directions, arguments.number(full_scale, "full_scale", True), zero)
    return core.magnetic_skin(sensor.texels, core.Magnets(place, moment), own, arguments.number(thickness, "thickness", True))
