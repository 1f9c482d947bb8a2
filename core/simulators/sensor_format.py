# SPDX-License-Identifier: GPL-3.0-or-later
"""What a format of sensors is."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import FileError
from ..geometry.mesh import TriangleMesh, checked_mesh
from ..geometry.plausible_size import require_sensor_size
from ..geometry.texels import texels_with_normals
from ..model.effect import Effect
from ..model.sensor import Sensor
from ..model.sensor_parameters import SensorParameters
from .sensor_on_mesh import SensorOnMesh


@dataclass(frozen=True)
class Written:
    """What was written of some sensors.

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


Write = Callable[[Sequence[SensorOnMesh], Path], Written]
Read = Callable[[str | os.PathLike], list[FoundSensor]]
Holds = Callable[[str | os.PathLike], bool]


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
        Takes the sensors and an empty folder, and returns the files that it wrote, in that folder or in a folder in it.
    read : callable or None
        Takes the path of a file and returns its sensors; raises FileError for a file that is damaged.
    holds : callable or None
        Tells whether a file is of this format, by its ending and its content. It raises FileError for a file that cannot be
        read.
    """

    name: str
    title: str
    description: str
    write: Write | None = None
    read: Read | None = None
    holds: Holds | None = None
