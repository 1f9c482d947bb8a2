# SPDX-License-Identifier: GPL-3.0-or-later
"""Formats of sensors: their registry, and helpers for reading and writing them."""

from __future__ import annotations

import importlib
import os
import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..errors import FileError, PalpateError, SensorError
from ..geometry.mesh import TriangleMesh, checked_mesh
from ..geometry.texels import texels_with_normals
from ..io.bake_folder import folder_names
from ..io.file_writing import atomic_write, writable_folder
from ..io.hidden_folder import FileList
from ..io.input_files import require_xml_text
from ..model.sensor import Effect, Sensor
from ..model.sensor_parameters import SensorParameters
from .sensor_on_mesh import SensorOnMesh, identifiers

LARGEST_SENSOR, SMALLEST_SENSOR = 3.0, 2e-4
"""Metres. The largest sensors are mats and floors of 2 m; the smallest, on tips of catheters, have 1 mm."""
LARGEST_PITCH, SMALLEST_PITCH = 0.3, 1e-6
"""Metres between neighbouring texels: cells of floors have 0.1 to 0.2 m, nanofibre arrays micrometres."""
UNITS = {"millimetres": 1e-3, "centimetres": 1e-2, "micrometres": 1e-6, "inches": 0.0254}


def require_sensor_size(points: np.ndarray, name: str) -> None:
    """Raise SensorError if a sensor, or the distance between its texels, cannot be as large as its coordinates in metres say.

    Parameters
    ----------
    points : (n, 3) float, metres
        Places of its texels.
    name : str
    """
    from scipy.spatial import cKDTree

    if len(points) < 2:
        return
    span = float(np.ptp(points, axis=0).max())
    distance = cKDTree(points).query(points, 2)[0][:, 1]
    pitch = float(np.median(distance[distance > 0.0])) if (distance > 0.0).any() else 0.0
    spans = SMALLEST_SENSOR <= span <= LARGEST_SENSOR
    if spans and SMALLEST_PITCH <= pitch <= LARGEST_PITCH:
        return
    size = f"of texels {pitch:.3g} m apart" if spans else f"{span:.3g} m across"
    possible = [word for word, metres in UNITS.items() if SMALLEST_SENSOR <= span * metres <= LARGEST_SENSOR / 3.0]
    asked = f"are its coordinates in {possible[0]}? Scale it by {UNITS[possible[0]]:g}" if possible else "give metres"
    raise SensorError(f"The sensor '{name}' would be {size}, and lengths are metres: {asked}.")


DIGITS = 9
"""Digits of a number: nine make every float32 its own, and simulators store meshes as float32."""


def numbers(values: np.ndarray | list[float] | tuple[float, ...] | float, digits: int = DIGITS) -> str:
    """Return numbers side by side as text; minus zero is written as zero."""
    flat = np.ravel(np.asarray(values))
    if flat.dtype.kind in "iu":
        return " ".join(map(str, flat.tolist()))
    return " ".join(f"{value:.{digits}g}" for value in (flat + 0.0).tolist())


def add(parent: ElementTree.Element, tag: str, **attributes: str) -> ElementTree.Element:
    """Add an element; an attribute `class_` stands for ``class``. Raises FileError for a name that XML cannot hold."""
    for value in attributes.values():
        require_xml_text(value)
    return ElementTree.SubElement(parent, tag, {key.rstrip("_"): value for key, value in attributes.items()})


def comment(parent: ElementTree.Element, text: str) -> None:
    """Add a comment. XML allows no two hyphens side by side in it."""
    require_xml_text(text)
    while "--" in text:
        text = text.replace("--", "- -")
    parent.append(ElementTree.Comment(f" {text} "))


def write_xml(path: Path, root: ElementTree.Element) -> None:
    """Write an element as an indented file."""
    ElementTree.indent(root)
    text = b'<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, encoding="utf-8") + b"\n"
    with atomic_write(path) as temporary:
        temporary.write_bytes(text)


@dataclass(frozen=True)
class Written:
    """Files of some sensors that were written, and notes on them.

    Attributes
    ----------
    files : list of Path
    notes : list of str
        One sentence each: what the format or its simulator cannot express.
    """

    files: list[Path]
    notes: list[str]


@dataclass(frozen=True)
class FoundSensor:
    """A sensor that was found in a file of another program.

    Attributes
    ----------
    name : str
    position, normal : (n, 3) float, metres, and unit vectors, or None
        Of the texels, in the frame of the sensor. None where the file has parameters only.
    faces : (m, 3) int or None
        Texels at the corners of triangles; those of the file, or made from the points.
    row, column : (n,) int or None
        Where the texels form a grid.
    tangent : (n, 3) float or None
        Unit vectors of the texels' x axes, and
    area : (n,) float, square metres, or None
        of each texel, where the file states them.
    surface : TriangleMesh or None
        What carries the texels, where the file has it.
    parameters : SensorParameters
        Those that the file does not hold have their defaults.
    effects : tuple of Effect
    frame_position, frame_quaternion : (3,) float, metres, and (4,) float
        Of the sensor's frame in the world of the file.
    notes : list of str
        What could not be taken over, one sentence each.
    """

    name: str
    position: np.ndarray | None = None
    normal: np.ndarray | None = None
    faces: np.ndarray | None = None
    row: np.ndarray | None = None
    column: np.ndarray | None = None
    tangent: np.ndarray | None = None
    area: np.ndarray | None = None
    surface: TriangleMesh | None = None
    parameters: SensorParameters = field(default_factory=SensorParameters)
    frame_position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    frame_quaternion: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    effects: tuple[Effect, ...] = ()
    notes: list[str] = field(default_factory=list)

    def on_mesh(self) -> SensorOnMesh:
        """Return it as a sensor whose mesh is the texels and the triangles between them; its normals are those of the file.

        Raises
        ------
        PalpateError
            The file has parameters only, or they, the texels or their sizes are not valid.
        """
        if self.position is None or self.normal is None or self.faces is None:
            raise FileError(f"'{self.name}' has parameters and no texels.")
        require_sensor_size(self.position, self.name)
        self.parameters.check(self.name)
        mesh = checked_mesh(self.position, self.faces, self.name)[0]
        grid = None if self.row is None or self.column is None else (self.row, self.column)
        texels = texels_with_normals(mesh, self.normal, self.tangent, self.area, grid)
        sensor = Sensor(self.name, 0, texels, self.parameters, effects=self.effects)
        return SensorOnMesh(sensor, mesh, self.surface, self.frame_position, self.frame_quaternion)


@dataclass(frozen=True)
class SensorFormat:
    """A format that sensors can be written in, read from, or both.

    Attributes
    ----------
    name : str
        As on the command line, in lower case.
    title, description : str
        As in Blender's menus.
    write : callable or None
        Takes a sensor, the path of its files without their ending, and an identifier; returns the files that it wrote. No two
        sensors of an export have the same path, or the same identifier, which is a word of ASCII letters, digits and ``_``.
    read : callable or None
        Takes the path of a file and returns its sensors; raises FileError for a file that is damaged.
    holds : callable or None
        Tells whether a file is of this format, by its ending and its content. It raises FileError for a file that cannot be
        read.
    blank : str
        What a blank in the name of a sensor becomes in the names of its files.
    """

    name: str
    title: str
    description: str
    write: Callable[[SensorOnMesh, Path, str], Written] | None = None
    read: Callable[[str | os.PathLike], list[FoundSensor]] | None = None
    holds: Callable[[str | os.PathLike], bool] | None = None
    blank: str = " "


@cache
def formats() -> dict[str, SensorFormat]:
    """Return every format by its name, in alphabetical order."""
    package = importlib.import_module(f"{__package__}.formats")
    names = sorted(module.name for module in pkgutil.iter_modules(package.__path__))
    found = [importlib.import_module(f"{package.__name__}.{name}").FORMAT for name in names]
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
        ones are complete (:class:`.hidden_folder.FileList`).

    Raises
    ------
    PalpateError
        The format is unknown, there is no sensor, two have the same name, or a file cannot be written.
    """
    known = written_formats()
    write = known[kind].write if kind in known else None
    if write is None:
        raise PalpateError(f"Sensors are not written as '{kind}': choose from {', '.join(known)}.")
    if not sensors:
        raise PalpateError("There is no sensor to write: make one with Physics › Palpate › Make Sensor.")
    stems, words = folder_names((item.name for item in sensors), known[kind].blank), identifiers(item.name for item in sensors)
    if len(stems) < len(sensors):
        raise PalpateError("Two of the sensors have the same name, and so would their files: rename one.")
    folder = writable_folder(folder, create=True)
    files = FileList(folder)
    with files.new_files("sensor") as new:
        written = [write(item, new / stems[item.name], words[item.name]) for item in sensors]
        made = files.replace(new, {f"sensor {kind}": [file for one in written for file in one.files]})
        return Written(made, [note for one in written for note in one.notes])


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
    titles = []
    for item in formats().values():
        if item.read is not None and item.holds is not None:
            if item.holds(path):
                found = item.read(path)
                for sensor in found:
                    _require_finite(path, sensor)
                return item, found
            titles.append(item.title)
    raise FileError(f"'{path}' holds no sensor that can be read: give a file of one of these, {', '.join(titles)}.")


def _require_finite(path: str | os.PathLike, sensor: FoundSensor) -> None:
    """Raise FileError for a sensor with a number that is none: a reader of another program may let it pass."""
    for name, value in vars(sensor).items():
        if isinstance(value, np.ndarray) and value.dtype.kind == "f" and not np.isfinite(value).all():
            what = name.replace("_", " ")
            raise FileError(f"The {what} of sensor '{sensor.name}' in '{path}' is NaN or infinite: correct the file.")
