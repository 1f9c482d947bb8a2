# SPDX-License-Identifier: GPL-3.0-or-later
"""All formats of sensors: every module of :mod:`.formats` defines a ``FORMAT``."""

from __future__ import annotations

import importlib
import os
import pkgutil
from collections.abc import Sequence
from functools import cache

import numpy as np

from ..errors import FileError, PalpateError
from ..io.file_list import FileList
from ..io.file_writing import require_space, writable_folder
from .sensor_format import FoundSensor, SensorFormat, Written
from .sensor_on_mesh import SensorOnMesh

FORMATS = f"{__package__}.formats"
"""The package of the formats."""
BYTES_PER_VERTEX = 1000
"""Estimate from above of what a vertex of a mesh, its share of the faces and a texel on it take in a text file; a URDF with a
frame for each texel has 700."""


@cache
def formats() -> dict[str, SensorFormat]:
    """Return every format by its name, in alphabetical order."""
    package = importlib.import_module(FORMATS)
    names = sorted(module.name for module in pkgutil.iter_modules(package.__path__))
    found = [importlib.import_module(f"{FORMATS}.{name}").FORMAT for name in names]
    return {item.name: item for item in found}


def written_formats() -> dict[str, SensorFormat]:
    """Return the formats that sensors can be written in."""
    return {name: item for name, item in formats().items() if item.write is not None}


def export_sensors(sensors: Sequence[SensorOnMesh], kind: str, folder: str | os.PathLike) -> Written:
    """Write sensors in a format of another simulator.

    Parameters
    ----------
    sensors : sequence of SensorOnMesh
    kind : str
        Name of a format, as "mjcf".
    folder : path
        Created if it is missing, with the folders above it.

    Returns
    -------
    Written
        The files take the place of those that an earlier export of this format left, which stay as they are until all new
        ones are complete (:mod:`..io.file_list`).

    Raises
    ------
    PalpateError
        The format is unknown, there is no sensor, the disk has too little space, or a file cannot be written.
    """
    known = written_formats()
    write = known[kind].write if kind in known else None
    if write is None:
        raise PalpateError(f"Sensors are not written as '{kind}': choose from {', '.join(known)}.")
    if not sensors:
        raise PalpateError("There is no sensor to write: make one with Physics › Palpate › Make Sensor.")
    vertices = sum(len(item.mesh.vertices) + len((item.surface or item.mesh).vertices) for item in sensors)
    require_space(folder, BYTES_PER_VERTEX * vertices, "The export")
    folder = writable_folder(folder, create=True)
    files = FileList(folder)
    with files.new_files("sensor") as new:
        written = write(sensors, new)
        return Written(files.replace(new, {f"sensor {kind}": written.files}), written.notes)


def import_sensors(path: str | os.PathLike) -> tuple[SensorFormat, list[FoundSensor]]:
    """Read the sensors of a file of another program.

    Returns
    -------
    format : SensorFormat
        That of the file.
    sensors : list of FoundSensor
        At least one.

    Raises
    ------
    FileError
        There is no such file, it is damaged, or it holds no sensor of a known format.
    """
    readable = [item for item in formats().values() if item.read is not None and item.holds is not None]
    for item in readable:
        if item.holds is not None and item.read is not None and item.holds(path):
            found = item.read(path)
            for sensor in found:
                _require_finite(path, sensor)
            return item, found
    titles = ", ".join(item.title for item in readable)
    raise FileError(f"'{path}' holds no sensor that can be read: give a file of one of these, {titles}.")


def _require_finite(path: str | os.PathLike, sensor: FoundSensor) -> None:
    """Raise FileError for a sensor with a number that is none: a reader of another program may let it pass."""
    for name, value in vars(sensor).items():
        if isinstance(value, np.ndarray) and value.dtype.kind == "f" and not np.isfinite(value).all():
            what = name.replace("_", " ")
            raise FileError(f"The {what} of sensor '{sensor.name}' in '{path}' is NaN or infinite: correct the file.")
