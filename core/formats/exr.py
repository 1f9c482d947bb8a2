# SPDX-License-Identifier: GPL-3.0-or-later
"""Tactile images as OpenEXR: what Blender's image nodes read directly, and every other channel beside it.

``R`` is the normal force and ``G``, ``B`` the shear along the texel's x and y axes, all in newtons; ``reading`` is in
the sensor's unit, ``depth`` in metres, ``slip`` in metres per second, ``contact`` 0 or 1. All are 32-bit floats; pixels
that show no texel are 0. Row 0 of the layout is the bottom of the picture.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import FileError
from ..layout import GridLayout, UVLayout
from ..recording import Frame, SensorFrame
from ..scenario import Sensor
from . import openexr
from .files import written

CHANNELS = ("R", "G", "B", "reading", "depth", "slip", "contact")
"""Names of the channels, in the order in which :func:`read_exr` returns them."""

UNITS = {"R": "N", "G": "N", "B": "N", "depth": "m", "slip": "m/s", "contact": "1"}
"""Units of the channels; that of ``reading`` is the sensor's."""

_PREFIX = "palpate."  # OpenEXR has header attributes of its own, some with a type ("name", "owner", "type")


def exr_channels(layout: GridLayout | UVLayout, frame: SensorFrame) -> dict[str, np.ndarray]:
    """Return the pictures of a frame by channel name, each (height, width) float32 with row 0 at the bottom.

    Raises
    ------
    ValueError
        A value is not finite or too large for 32 bits (a fault of the program, not of the user).
    """
    values = {
        "R": frame.normal_force,
        "G": frame.shear[:, 0],
        "B": frame.shear[:, 1],
        "reading": frame.reading,
        "depth": frame.depth,
        "slip": frame.slip,
        "contact": frame.contact,
    }
    table = np.column_stack([np.asarray(values[name], float) for name in CHANNELS])
    bad = ~(np.abs(table) <= np.finfo(np.float32).max)  # NaN compares false
    if bad.any():
        texel, channel = np.argwhere(bad)[0]
        raise ValueError(f"channel '{CHANNELS[channel]}' of texel {texel} is {table[texel, channel]}: no 32-bit number")
    image = layout.image(table)
    image[..., CHANNELS.index("contact")] = image[..., CHANNELS.index("contact")] >= 0.5
    return {name: image[..., i].astype(np.float32) for i, name in enumerate(CHANNELS)}


def describe(sensor: Sensor, frame: Frame, digest: str) -> dict[str, str]:
    """Return the metadata of a tactile image: whose it is, when, in which units, and what it was made from.

    ``unit.R``, ``unit.depth``, … are the units of the channels; ``parameters`` is a hash of the sensor's parameters, of what is
    painted on it and of its effects, ``digest`` one of everything that the forces depend on.
    """
    about = {
        "sensor": sensor.name,
        "frame": str(frame.frame),
        "time": repr(float(frame.time)),
        "unit": sensor.parameters.unit,
        "digest": digest,
        "parameters": sensor.settings_digest,
    }
    about |= {f"unit.{channel}": UNITS.get(channel, sensor.parameters.unit) for channel in CHANNELS}
    if isinstance(sensor.texels.layout, UVLayout) and sensor.texels.layout.map_name:
        about["map"] = sensor.texels.layout.map_name
    return about


def write_exr(
    path: str | os.PathLike,
    layout: GridLayout | UVLayout,
    frame: SensorFrame,
    metadata: Mapping[str, str],
    at_once: bool = True,
) -> None:
    """Write one frame of one sensor.

    Parameters
    ----------
    path : path
    layout : GridLayout or UVLayout
        Of the sensor's texels.
    frame : SensorFrame
    metadata : mapping of str to str
        Becomes header attributes named ``palpate.<key>``, see :func:`describe`.
    at_once : bool
        See :func:`.files.written`.

    Raises
    ------
    FileError
        The file cannot be written.
    ValueError
        See :func:`exr_channels`; nothing is written then.
    """
    pictures = exr_channels(layout, frame)
    from_top = {name: picture[::-1] for name, picture in pictures.items()}
    attributes = {_PREFIX + key: str(value) for key, value in metadata.items()}
    with written(path, at_once) as place:
        openexr.write(place, from_top, attributes)


def read_exr(path: str | os.PathLike) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Read the channels and the metadata of a tactile image.

    Returns
    -------
    channels : dict of str to (height, width) float32
        Row 0 at the bottom; those of :data:`CHANNELS` first, others after them.
    metadata : dict of str to str
        As given to :func:`write_exr`.

    Raises
    ------
    FileError
        There is no such file, or it is damaged or not an OpenEXR image.
    """
    if not Path(path).is_file():
        raise FileError(f"'{path}' does not exist: bake first, or choose another file.")
    try:
        pictures, attributes = openexr.read(path)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise FileError(f"'{path}' could not be read ({reason}): check its permissions.") from error
    except openexr.FormatError as error:
        raise FileError(f"'{path}' is damaged or not an OpenEXR image ({error}): bake again.") from error
    found = {name: picture[::-1].astype(np.float32) for name, picture in pictures.items()}
    order = [name for name in CHANNELS if name in found] + [name for name in found if name not in CHANNELS]
    metadata = {key.removeprefix(_PREFIX): value for key, value in attributes.items() if key.startswith(_PREFIX)}
    return {name: found[name] for name in order}, metadata
