# SPDX-License-Identifier: GPL-3.0-or-later
"""Exporters of a bake, and the arrays that all of them take from it."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import PalpateError
from ..figures.figure_style import FigureStyle
from ..geometry.grid_layout import GridLayout
from ..io.bake_reader import Bake
from ..io.file_writing import writable_folder
from ..io.hidden_folder import FileList
from ..jobs import Job, Progress
from ..model.recording import SENSOR_FIELDS, VectorReadings
from .format_table import FORMATS

UNITS = {
    "normal_force": "N",
    "shear": "N",
    "friction": "N",
    "depth": "m",
    "slip": "m/s",
    "net_force": "N",
    "net_torque": "N m",
    "centre_of_pressure": "m",
    "channels_place": "m",
    "texel_position": "m",
    "texel_area": "m2",
}
"""Units of the arrays of :func:`bake_arrays` that have one; `reading` has the sensor's own."""


@dataclass(frozen=True)
class Exporter:
    """A format that a bake can be written in.

    Attributes
    ----------
    name : str
        As on the command line, in lower case.
    write : callable
        Takes the bake, a folder that exists, and a style for colours. It yields :func:`sensor_progress` before each sensor is
        written, and returns the files that it wrote, in that folder or in a folder in it.
    """

    name: str
    write: Callable[[Bake, Path, FigureStyle], Job[list[Path]]]


def bake_arrays(bake: Bake, name: str) -> dict[str, np.ndarray]:
    """Return everything about one sensor as arrays: its recording, and its texels under names that begin with ``texel_``."""
    texels, recorded, channels = bake.texels[name], bake.recording.sensors[name], bake.recording.sensors[name].channels
    arrays = {key: getattr(recorded, key) for key in SENSOR_FIELDS}
    if channels is not None:
        arrays |= {"channels": channels.values, "channels_clipped": channels.clipped}
        if channels.place is not None:
            arrays["channels_place"] = channels.place
    arrays |= {f"texel_{key}": getattr(texels, key) for key in ("position", "normal", "tangent", "area", "vertex")}
    arrays["texel_uv"] = texels.layout.uv()
    if isinstance(texels.layout, GridLayout):
        arrays["texel_row"], arrays["texel_column"] = texels.layout.row, texels.layout.column
    return arrays


def channel_labels(channels: VectorReadings) -> list[str]:
    """Return a name for each channel of a sensor, place by place: the number of its place, its own name and its unit."""
    return [f"{i}_{name}_{channels.unit}" for i in range(channels.values.shape[-2]) for name in channels.names]


def sensor_progress(bake: Bake, name: str) -> Progress:
    """Return the progress of an export that is about to write a sensor."""
    names = list(bake.texels)
    return Progress(name, names.index(name) + 1, len(names))


def exporter_for(name: str) -> Exporter:
    """Return the exporter of a format, as "csv"; raise PalpateError if there is none."""
    if name not in FORMATS:
        raise PalpateError(f"There is no export to '{name}': choose from {', '.join(FORMATS)}.")
    found: Exporter = importlib.import_module(f"{__package__}.formats.{FORMATS[name].module}").EXPORTER
    return found


def export(bake: Bake, kind: str | Exporter, folder: str | os.PathLike, style: FigureStyle | None = None) -> Job[list[Path]]:
    """Write a bake in another format.

    Parameters
    ----------
    bake : Bake
    kind : str or Exporter
        Name of a format, as "csv", or an exporter that is not among them.
    folder : path
        Created if it is missing, with the folders above it.
    style : FigureStyle, optional
        Colours and their scale, for formats with pictures.

    Yields
    ------
    Progress
        Before each sensor is written; the stage is the sensor's name.

    Returns
    -------
    list of Path
        The written files, and folders that hold the others. They take the place of the files that an earlier export of
        this format left, which stay as they are until all new files are complete (:class:`.hidden_folder.FileList`).

    Raises
    ------
    PalpateError
        The format is unknown or needs a package that is not installed, or a file cannot be written, as on a full disk.
    """
    exporter = kind if isinstance(kind, Exporter) else exporter_for(kind)
    folder = writable_folder(folder, create=True)
    files = FileList(folder)
    with files.new_files("export") as new:
        written = yield from exporter.write(bake, new, style or FigureStyle())
        written = files.replace(new, {exporter.name: written})
    return list(dict.fromkeys(path if path.parent == folder else path.parent for path in written))
