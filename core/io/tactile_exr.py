# SPDX-License-Identifier: GPL-3.0-or-later
"""Tactile images in the OpenEXR format: three channels that Blender's image nodes read directly, and all others beside them.

``docs/files.md`` lists the channels. Row 0 of the layout is the bottom of the picture.

Images of readings with three signed channels (:func:`write_vector_exrs`) have one layer with the channels X, Y and Z, which
image programs, Blender's among them, show as one vector, in the unit of the readings.
"""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from ..errors import FileError, ParameterError
from ..geometry.grid_layout import GridLayout, grid_of_places
from ..geometry.texels import Texels
from ..geometry.texture_maps import UVLayout
from ..model.recording import Frame, SensorFrame, VectorReadings
from ..model.sensor import Sensor
from .file_writing import atomic_write, writable_folder
from .hidden_folder import FileList

# Images are written by OpenEXR, from PyPI. In a Blender that is linked against an OpenEXR of its own, the dynamic linker would
# mix the symbols of the two, and the first file written would end the process (seen in Debian's Blender 4.3). There the images
# go through OpenImageIO, which Blender brings along. Pixels, names and attributes are the same; each library writes equal
# images as equal bytes.


@cache
def library() -> str:
    """Return the module that writes images in this process, OpenEXR or OpenImageIO."""
    # Symbols of an OpenEXR may be where those of a module that is loaded later are looked up. Modules of Python, such as bpy,
    # keep their libraries to themselves, and so do all on Windows and macOS.
    is_linked = sys.platform == "linux" and hasattr(ctypes.CDLL(None), "exr_start_read")
    return "OpenImageIO" if is_linked else "OpenEXR"


def write_image(path: str | os.PathLike, channels: Mapping[str, np.ndarray], attributes: Mapping[str, str]) -> None:
    """Write an image, ZIP-compressed; equal images give equal bytes.

    Parameters
    ----------
    path : path
    channels : mapping of str to (height, width) float32
        The first row is the top of the picture.
    attributes : mapping of str to str
        Added to the header.

    Raises
    ------
    OSError, FileError
        The file cannot be written.
    """
    texts = {name: value.encode("utf-8", "replace").decode() for name, value in attributes.items()}
    if library() == "OpenEXR":
        import OpenEXR

        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **texts}
        try:
            OpenEXR.File(header, {name: np.ascontiguousarray(one) for name, one in channels.items()}).write(os.fspath(path))
        except RuntimeError as error:
            raise _os_error(str(error)) from error
        return
    try:
        import OpenImageIO as oiio
    except ImportError as error:
        raise FileError("This Blender's Python has no OpenImageIO: install it, on Debian as python3-openimageio.") from error
    height, width = next(iter(channels.values())).shape
    spec = oiio.ImageSpec(width, height, len(channels), "float")
    spec.channelnames = tuple(channels)
    # Without a date OpenImageIO would write the present time, and equal images would differ.
    for name, value in {"compression": "zip", "DateTime": "1980:01:01 00:00:00", **texts}.items():
        spec.attribute(name, value)
    image = oiio.ImageOutput.create("image.exr")
    pixels = np.stack(list(channels.values()), axis=-1)
    if not (image.open(os.fspath(path), spec) and image.write_image(pixels) and image.close()):
        raise _os_error(image.geterror())


def _os_error(message: str) -> OSError:
    """Return the error of the system that a library's message names, as in "Failed to write. No space left on device."."""
    number = next((number for number in errno.errorcode if os.strerror(number) in message), None)
    return OSError(errno.EIO, " ".join(message.split())) if number is None else OSError(number, os.strerror(number))


CHANNELS = ("R", "G", "B", "reading", "depth", "slip", "contact")
CHANNEL_LAYER = "channels"
"""Name of the vector layer that images of a sensor with several channels have besides."""
UNITS = {"R": "N", "G": "N", "B": "N", "depth": "m", "slip": "m/s", "contact": "1"}
"""Units of the channels; that of ``reading`` is the sensor's."""


def _pictures(layout: GridLayout | UVLayout, frame: SensorFrame, nearest: np.ndarray | None) -> dict[str, np.ndarray]:
    """(height, width) float32 of each channel of a frame by its name, from the top."""
    columns = {name: getattr(frame, name) for name in CHANNELS[3:]}
    columns = {"R": frame.normal_force, "G": frame.shear[:, 0], "B": frame.shear[:, 1], **columns}
    if nearest is not None:
        assert frame.channels is not None  # of a sensor that has them in all frames
        columns |= dict(zip(layer_names(frame.channels), frame.channels.values[nearest].T, strict=True))
    names, table = list(columns), np.array(list(columns.values()), dtype=float)  # (channels, texels)
    bad = ~(np.abs(table) <= np.finfo(np.float32).max)  # NaN compares false
    if bad.any():
        channel, texel = np.argwhere(bad)[0]
        raise ValueError(f"channel '{names[channel]}' of texel {texel} is {table[channel, texel]}: no 32-bit number")
    image = layout.image(table.T)
    contact = names.index("contact")
    image[:, :, contact] = image[:, :, contact] >= 0.5
    return dict(zip(names, np.ascontiguousarray(np.moveaxis(image[::-1], 2, 0), dtype=np.float32)))


def describe(sensor: Sensor, frame: Frame, digest: str) -> dict[str, str]:
    """Return the metadata of a tactile image, as ``docs/files.md`` lists them; `digest` is that of the scenario."""
    about = {
        "sensor": sensor.name,
        "frame": str(frame.frame),
        "time": repr(float(frame.time)),
        "unit": sensor.parameters.unit,
        "digest": digest,
        "parameters": sensor.settings_digest,
    }
    about |= {f"unit.{channel}": UNITS.get(channel, sensor.parameters.unit) for channel in CHANNELS}
    channels = frame.sensors[sensor.name].channels
    if channels is not None:
        about |= dict.fromkeys((f"unit.{name}" for name in layer_names(channels)), channels.unit)
    if isinstance(sensor.texels.layout, UVLayout) and sensor.texels.layout.map_name:
        about["map"] = sensor.texels.layout.map_name
    return about


def write_exr(
    path: str | os.PathLike,
    layout: GridLayout | UVLayout,
    frame: SensorFrame,
    metadata: Mapping[str, str],
    nearest: np.ndarray | None = None,
) -> None:
    """Write a frame of one sensor as an image, whole or not at all.

    Parameters
    ----------
    path : path
    layout : GridLayout or UVLayout
        Of the sensor's texels.
    frame : SensorFrame
    metadata : mapping of str to str
        Become header attributes named ``palpate.<key>``, see :func:`describe`.
    nearest : (n,) int, optional
        Of a sensor with several channels: the place whose channels the layer shows at each texel (:func:`nearest_places`).

    Raises
    ------
    FileError
        The file cannot be written.
    ValueError
        A value is not finite or too large for 32 bits (a fault of the program, not of the user). Nothing is written then.
    """
    pictures = _pictures(layout, frame, nearest)
    with atomic_write(path) as temporary:
        # The prefix is for attributes that OpenEXR has itself, some with a type ("name", "owner", "type").
        write_image(temporary, pictures, {f"palpate.{key}": str(value) for key, value in metadata.items()})


def layer_names(channels: VectorReadings) -> list[str]:
    """Return the names that the channels of a sensor have in images."""
    return [f"{CHANNEL_LAYER}.{name.upper()}" for name in channels.names]


def nearest_places(texels: Texels, channels: VectorReadings | None) -> np.ndarray | None:
    """Return for each texel the place, of those where channels are measured, that is nearest to it, (n,) int; None without."""
    if channels is None:
        return None
    if channels.place is None:
        return np.zeros(len(texels), int)
    apart = [np.sum((texels.position - place) ** 2, axis=1) for place in channels.place]
    return np.argmin(apart, axis=0)


def channel_layout(texels: Texels, channels: VectorReadings) -> GridLayout:
    """Return rows and columns of the places where a sensor's channels are measured, seen onto the middle of its texels."""
    count = channels.values.shape[-2]
    if channels.place is None:
        return GridLayout(1, count, np.zeros(count, int), np.arange(count))
    middle = np.argmin(np.sum((texels.position - texels.position.mean(axis=0)) ** 2, axis=1))
    along, normal = texels.tangent[middle], texels.normal[middle]
    return grid_of_places(channels.place, along, np.cross(normal, along))


LAYER, AXES = "field", "XYZ"
"""Name of the layer, and of its channels."""


def write_vector_exrs(folder: Path, values: np.ndarray, shape: tuple[int, int], unit: str) -> list[Path]:
    """Write an image for each frame, ``field_0000.exr`` and so on, in the place of those of an earlier recording.

    Parameters
    ----------
    folder : path
        Is made if it is not there.
    values : (T, k, 3) float
        Of places row by row, the row with the least y first.
    shape : (int, int)
        Rows and columns, of which there are k places.
    unit : str
        Becomes the header attribute ``palpate.unit``.

    Raises
    ------
    ParameterError
        There are not as many places as rows times columns, or not three channels of each.
    FileError
        A file cannot be written.
    """
    rows, columns = shape
    if values.ndim != 3 or values.shape[1:] != (rows * columns, 3):
        channels = int(np.prod(values.shape[1:]))
        raise ParameterError(
            f"An image of {rows} × {columns} places has {3 * rows * columns} channels and these readings have {channels}: "
            "give the rows and columns of the magnetometers."
        )
    images = values.reshape(-1, rows, columns, 3)[:, ::-1].astype(np.float32)
    files = FileList(writable_folder(folder, create=True))
    with files.new_files(LAYER) as new:
        paths = [new / f"{LAYER}_{frame:04d}.exr" for frame in range(len(images))]
        for frame, (path, image) in enumerate(zip(paths, images)):
            pictures = {f"{LAYER}.{axis}": image[:, :, i] for i, axis in enumerate(AXES)}
            with atomic_write(path) as temporary:
                write_image(temporary, pictures, {"palpate.unit": unit, "palpate.frame": str(frame)})
        return files.replace(new, {LAYER: paths})
