# SPDX-License-Identifier: GPL-3.0-or-later
"""Magnetic skins: sensors whose texels carry magnets over magnetometers."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from . import arguments
from .arguments import ArgumentError
from .drawings import shown_in_notebooks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..core.model.recording import VectorReadings
    from ..core.skins.magnetic_skin import MagneticSkin
    from .sensors import Sensor


def magnetic_skin(
    sensor: Sensor,
    magnets: ArrayLike | str,
    moments: ArrayLike | None = None,
    magnetometers: ArrayLike | None = None,
    thickness: float | None = None,
    full_scale: float = 50e-3,
    axes: ArrayLike | None = None,
    offset: ArrayLike = 0.0,
) -> MagneticSkin:
    """Return a compliant layer with magnets that move with a sensor's texels, over magnetometers.

    Parameters
    ----------
    sensor : Sensor
        Its texels are the surface of the layer. All places are in the frame of its texels.
    magnets, moments : (m, 3) float, m and A·m²
        Places at rest and dipole moments. One moment may stand for all. For `magnets` also the name of a skin as they are
        built, "uskin", "eflesh" or "anyskin", which gives the rest as well, as far as it is left out.
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
    from ..core.skins import magnetic_skin as core
    from ..core.skins import skin_presets

    if isinstance(magnets, str):
        named = skin_presets.preset_named(magnets)
        own_magnets, own_chips = skin_presets.placed(named, sensor.texels)
        magnets = own_magnets.place
        axes = own_chips.axes if axes is None and magnetometers is None else axes
        moments = own_magnets.moment if moments is None else moments
        magnetometers = own_chips.place if magnetometers is None else magnetometers
        thickness = named.thickness if thickness is None else thickness
    if moments is None or magnetometers is None or thickness is None:
        named_skins = ", ".join(skin_presets.PRESETS)
        raise ArgumentError(
            f"A skin needs moments, magnetometers and a thickness: give them, or magnets as one of {named_skins}."
        )
    place = arguments.numbers(magnets, (-1, 3), "magnets")
    chips = arguments.numbers(magnetometers, (-1, 3), "magnetometers")
    shape = (3,) if np.ndim(moments) == 1 else place.shape
    moment = np.broadcast_to(arguments.numbers(moments, shape, "moments"), place.shape)
    directions = np.tile(np.eye(3), (len(chips), 1, 1)) if axes is None else arguments.numbers(axes, (len(chips), 3, 3), "axes")
    zero = np.broadcast_to(arguments.numbers(offset, () if np.ndim(offset) == 0 else chips.shape, "offset"), chips.shape)
    own = core.Magnetometers(chips, directions, arguments.number(full_scale, "full_scale", True), zero)
    return core.magnetic_skin(sensor.texels, core.Magnets(place, moment), own, arguments.number(thickness, "thickness", True))


def draw_channels(skin: MagneticSkin, seen: VectorReadings, frames: Sequence[int] = (-1,), rest: int = 0) -> Figure:
    """Return vector images of some frames: how the readings of each magnetometer have changed.

    Arrows show the change along x and y, colours that along z: blue below zero, red above it.

    Parameters
    ----------
    skin : MagneticSkin
    seen : VectorReadings
        What ``Recording.channels(skin)`` returned.
    frames : sequence of int
        One image for each, side by side and on one scale.
    rest : int
        The frame from which changes count.

    Raises
    ------
    PalpateError
        There is no such frame, or the readings are of another skin.
    """
    from ..core.figures.vector_image import vector_figure

    count = len(seen.values)
    for frame in (*frames, rest):
        if isinstance(frame, bool) or not isinstance(frame, int | np.integer) or not -count <= frame < count:
            raise ArgumentError(f"frame {arguments.brief(frame)} is none of the {count} of the recording: give a whole number.")
    images = [1e3 * (seen.values[frame] - seen.values[rest]) for frame in frames]
    titles = [f"frame {int(frame) % count}" for frame in frames]
    return shown_in_notebooks(vector_figure(skin.magnetometers.flat, images, titles, f"m{seen.unit}"))


def save_channels(seen: VectorReadings, folder: str | os.PathLike[str], rows: int, columns: int) -> list[Path]:
    """Write what the magnetometers show as OpenEXR images, one for each frame, with the vector layer ``field`` (X, Y, Z).

    Parameters
    ----------
    seen : VectorReadings
        What ``Recording.channels(skin)`` returned.
    folder : path
        Is made if it is not there.
    rows, columns : int
        Of the magnetometers, which stand row by row, the row with the least y first.

    Returns
    -------
    list of path

    Raises
    ------
    PalpateError
        There are not as many magnetometers, or a file cannot be written.
    """
    from ..core.io.tactile_exr import write_vector_exrs

    shape = arguments.count(rows, "rows"), arguments.count(columns, "columns")
    return write_vector_exrs(Path(folder), seen.values, shape, seen.unit)
