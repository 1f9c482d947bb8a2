# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors: grids, regions of meshes, files; and their files for other simulators."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.effects.engine.registry import check, effect, from_dict
from ..core.errors import FileError, MeshError
from ..core.geometry.grid_layout import GridLayout
from ..core.geometry.mesh import TriangleMesh, checked_mesh
from ..core.geometry.rotations import quaternion_product, rotation_matrices
from ..core.geometry.texels import Texels, texels_from_region, texels_with_normals
from ..core.io.sensor_toml import SensorModel, write_sensor
from ..core.model.sensor import Effect
from ..core.model.sensor import Sensor as ModelSensor
from ..core.model.sensor_parameters import SensorParameters
from ..core.simulators.sensor_format import Written
from ..core.simulators.sensor_on_mesh import SensorOnMesh
from . import arguments
from .arguments import ArgumentError
from .bodies import Body
from .paths import LEVEL


@dataclass(frozen=True, eq=False, repr=False)
class Sensor(SensorOnMesh):
    """A tactile sensor, fixed in the world unless it is on a body.

    Make one with :meth:`grid`, :meth:`from_mesh` or :func:`read_sensor`.

    Attributes
    ----------
    sensor : core's sensor
        With `texels`, `parameters` and `effects`, which are also attributes of this object.
    mesh : TriangleMesh
    surface : TriangleMesh or None
    position, quaternion : (3,) float, metres, and (4,) float
        Of the frame of the texels in the world, or in the frame of the body.
    body : Body or None
        What carries it.
    """

    body: Body | None = None

    @classmethod
    def grid(
        cls,
        rows: int,
        columns: int,
        pitch: float | tuple[float, float],
        name: str = "pad",
        position: ArrayLike = (0.0, 0.0, 0.0),
        quaternion: ArrayLike = LEVEL,
        body: Body | None = None,
        **parameters: float | str,
    ) -> Sensor:
        """Return a flat grid, centred on the origin in the xy plane, with normals along +z.

        Parameters
        ----------
        rows, columns : int
            Rows run along +y and columns along +x.
        pitch : float or (float, float), metres
            Between texels, along x and along y.
        name : str
        position, quaternion : (3,) float, metres, and (4,) float, optional
        body : Body, optional
            What carries the sensor; position and quaternion are then in its frame.
        **parameters
            Of a texel (docs/python.md lists them), as ``k=1000.0``. `cn` follows from `k`, and `mud` from `mus`, where it is
            not given.

        Raises
        ------
        PalpateError
            An argument has a wrong type, shape or value.
        """
        from ..core.geometry.texel_arrays import pad_array

        number = (arguments.count(rows, "rows"), arguments.count(columns, "columns"))
        steps = arguments.numbers(np.tile(pitch, 2) if np.ndim(pitch) == 0 else pitch, (2,), "pitch")
        arguments.number(steps.min(), "pitch", above_zero=True)
        array = pad_array(*number, (float(steps[0]), float(steps[1])))
        arguments.size_checked(array.vertices, arguments.LARGEST_SENSOR, "pitch", f"sensor '{name}'")
        return cls._of(_mesh_of_faces(array.vertices, array.faces, name), None, name, parameters)._placed(  # noqa: SLF001
            position, quaternion, body
        )

    @classmethod
    def from_mesh(
        cls,
        mesh: Any,
        texels: int | None = None,
        region: ArrayLike | None = None,
        name: str | None = None,
        position: ArrayLike = (0.0, 0.0, 0.0),
        quaternion: ArrayLike = LEVEL,
        body: Body | None = None,
        **parameters: float | str,
    ) -> Sensor:
        """Return a sensor on the surface of a mesh.

        Parameters
        ----------
        mesh : path, (vertices, faces) or mesh of trimesh
            STL, PLY, OBJ or OFF; metres. Texels feel what comes from the side that its faces point to.
        texels : int, optional
            Spread so many over the region, evenly, with the normals of the surface. Default: one at each vertex.
        region : (nv,) bool or (m,) int, optional
            Vertices that are sensitive, by a mask or by their numbers. Default: all.
        name, position, quaternion, body, **parameters
            As of :meth:`grid`.

        Raises
        ------
        PalpateError
            An argument has a wrong type, shape or value, or the mesh is no surface.
        """
        own = arguments.name_from(mesh, name, "sensor")
        whole = arguments.mesh_of(mesh, "mesh", own)
        arguments.size_checked(whole.vertices, arguments.LARGEST_SENSOR, "mesh", f"sensor '{own}'")
        chosen = _chosen_vertices(region, len(whole.vertices))
        if texels is None:
            made = cls._of(whole, chosen, own, parameters)
        else:
            layout, normals = _spread(whole, chosen, arguments.count(texels, "texels"), own)
            model = ModelSensor(own, 0, texels_with_normals(layout, normals), arguments.parameters(parameters, own))
            made = cls(model, layout, whole)
        return made._placed(position, quaternion, body)

    @classmethod
    def _of(cls, mesh: TriangleMesh, region: np.ndarray | None, name: str, words: Mapping[str, Any]) -> Sensor:
        values = arguments.parameters(words, name)
        texels = texels_from_region(mesh, np.ones(len(mesh.vertices), bool) if region is None else region, name)
        return cls(ModelSensor(name, 0, texels, values), mesh)

    def _placed(self, position: ArrayLike, quaternion: ArrayLike, body: Body | None) -> Sensor:
        if body is not None and not isinstance(body, Body):
            raise ArgumentError(f"body is {arguments.brief(body)}: give a Body.")
        place, turn = arguments.numbers(position, (3,), "position"), arguments.quaternion(quaternion, "quaternion")
        return replace(self, position=place, quaternion=turn, body=body)

    def with_effects(self, *effects: str | Mapping[str, Any] | Effect) -> Sensor:
        """Return the same sensor with these effects instead of those that it has.

        Parameters
        ----------
        *effects : str or mapping
            The name of an effect (docs/effects.md), as ``"creep"``, or a mapping with its name and values, as
            ``{"name": "creep", "amount": 0.2}``.
        """
        gain, found = self.parameters.gain, []
        for item in effects:
            if isinstance(item, str):
                item = effect(item, gain=gain)
            elif isinstance(item, Mapping):
                item = from_dict(item, gain)
            elif not isinstance(item, Effect):
                raise ArgumentError(f"effects has {arguments.brief(item)}: give the name of an effect, or a mapping.")
            found.append(item)
        check(found, self.name, len(self.texels), gain)
        return replace(self, sensor=replace(self.sensor, effects=tuple(found)))

    @property
    def texels(self) -> Texels:
        """Positions (m), normals, tangents and areas (m²) in the frame of the sensor."""
        return self.sensor.texels

    @property
    def parameters(self) -> SensorParameters:
        """Of each texel."""
        return self.sensor.parameters

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Effects of a real sensor beyond the base model."""
        return self.sensor.effects

    def of_model(self, body: int) -> ModelSensor:
        """Return the sensor as core has it, on the body with this index; on a body of its own its pose is that of the body."""
        texels = self.texels
        if self.body is not None:
            turn = rotation_matrices(self.quaternion[None])[0]
            normal, tangent = texels.normal @ turn.T, texels.tangent @ turn.T
            texels = replace(texels, position=texels.position @ turn.T + self.position, normal=normal, tangent=tangent)
        return replace(self.sensor, body=body, texels=texels)

    def world_pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Return position (3,), metres, and quaternion (4,) of the sensor's frame in the world at the start."""
        if self.body is None:
            return self.position, self.quaternion
        turn = rotation_matrices(self.body.quaternion[None])[0]
        return self.body.position + turn @ self.position, quaternion_product(self.body.quaternion[None], self.quaternion[None])[
            0
        ]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write name, parameters and effects as a sensor.toml, and the shape where it is a grid of one pitch for each axis."""
        grid = _grid_words(self.texels)
        write_sensor(path, SensorModel(self.name, self.parameters, self.effects, {} if grid is None else {"grid": grid}))

    def __repr__(self) -> str:
        layout = self.texels.layout
        shape = f"{layout.rows} × {layout.columns}" if isinstance(layout, GridLayout) else str(len(self.texels))
        words = [f"{shape} texels", f"k {self.parameters.k:g} N/m", *(one.name for one in self.effects)]
        return f"<Sensor '{self.name}': {', '.join(words)}{f', on {self.body.name!r}' if self.body else ''}>"

    def _repr_html_(self) -> str:
        """Where the texels are, for notebooks."""
        from .drawings import layout_svg

        return f"<div>{escape(repr(self))}</div>{layout_svg(self.texels)}"


def read_sensor(path: str | os.PathLike[str], name: str | None = None) -> Sensor:
    """Read a sensor: a sensor.toml with a grid or a mesh, as ``palpate gap`` writes it, or a file of another simulator.

    Parameters
    ----------
    path : path
        .toml, or one of the formats of docs/simulators.md (probe list, MJCF, URDF, USD).
    name : str, optional
        Of the sensor, in a file of another simulator that has several.

    Raises
    ------
    PalpateError
        There is no such file, it is damaged, or it does not say where the texels are.
    """
    if FilePath(path).suffix.lower() == ".toml":
        return _sensor_of_toml(FilePath(path))
    from ..core.simulators.probe_list import is_probe_list, read_probe_list

    if is_probe_list(path):
        return _own(read_probe_list(path))
    from ..core.simulators.sensor_format import import_sensors

    sensors = import_sensors(path)[1]
    chosen = [one for one in sensors if name in (None, one.name)]
    if len(chosen) != 1 or chosen[0].position is None:
        known = ", ".join(repr(one.name) for one in sensors)
        raise FileError(f"'{path}' has the sensors {known}: give the name of one that has texels.")
    return _own(chosen[0].on_mesh())


def sensors_from_blend(
    blend: str | os.PathLike[str], *names: str, folder: str | os.PathLike[str] | None = None
) -> dict[str, Sensor]:
    """Return the sensors of a baked .blend by name, without Blender: texels, painted factors, parameters and effects.

    Parameters
    ----------
    blend : path
    *names : str
        Of sensors. Default: all of the bake; pads that are not read out are not in it.
    folder : path, optional
        The bake folder. Default: ``palpate-bake`` beside the .blend, which is also the default of scenes.

    Returns
    -------
    dict of str to Sensor
        Texels in the frame of the body that carries them, with the body's pose at the first frame.

    Raises
    ------
    PalpateError
        There is no .blend, bake or sensor of a name, the bake is damaged or not of this .blend, or the .blend was saved later
        with changes.
    """
    from ..core.simulators.baked_sensors import baked_sensors

    found = baked_sensors(blend, names or None, folder)
    return {item.name: _own(item) for item in found}


def _own(item: SensorOnMesh) -> Sensor:
    return Sensor(item.sensor, item.mesh, item.surface, item.position, item.quaternion)


def _sensor_of_toml(path: FilePath) -> Sensor:
    from ..core.io.sensor_toml import read_sensor as read_model

    model = read_model(path)
    if "grid" in model.shape:
        grid = model.shape["grid"]
        made = Sensor.grid(grid["rows"], grid["columns"], tuple(grid["pitch"]), model.name)
    elif "mesh" in model.shape:
        made = Sensor.from_mesh(path.parent / model.shape["mesh"], name=model.name)
    else:
        raise FileError(
            f"'{path}' does not say where the texels are: add grid = {{ rows, columns, pitch }} or mesh to [sensor]."
        )
    return replace(made, sensor=replace(made.sensor, parameters=model.parameters, effects=model.effects))


def _mesh_of_faces(vertices: np.ndarray, faces: list[tuple[int, ...]], name: str) -> TriangleMesh:
    """Return a mesh of faces with three or four corners."""
    quads = np.array([face for face in faces if len(face) == 4], int).reshape(-1, 4)
    triangles = np.array([face for face in faces if len(face) == 3], int).reshape(-1, 3)
    halves = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], triangles])
    return checked_mesh(vertices, halves, name, quads if len(quads) else None)[0]


def _chosen_vertices(region: ArrayLike | None, vertices: int) -> np.ndarray:
    """Return the mask (nv,) of a region."""
    if region is None:
        return np.ones(vertices, bool)
    found = np.asarray(region)
    if found.dtype == bool and found.shape == (vertices,):
        return found
    if found.dtype.kind in "iu" and found.ndim == 1 and len(found) and found.min() >= 0 and found.max() < vertices:
        return np.isin(np.arange(vertices), found)
    if found.dtype.kind in "iu" and found.ndim == 1 and len(found):
        outside = found[(found < 0) | (found >= vertices)][0]
        raise ArgumentError(f"region has vertex {outside}: the mesh has {vertices}, from 0 to {vertices - 1}.")
    raise ArgumentError(
        f"region has the shape {found.shape} and the type {found.dtype}: give a mask of {vertices} booleans, "
        "or numbers of vertices."
    )


def _spread(mesh: TriangleMesh, chosen: np.ndarray, texels: int, name: str) -> tuple[TriangleMesh, np.ndarray]:
    """Return a mesh whose vertices are so many texels, spread evenly over the region, and their normals."""
    from ..core.geometry.point_surface import triangles_between
    from ..core.geometry.scattered_points import even_points

    inside = chosen[mesh.triangles].all(axis=1)
    if not inside.any():
        raise MeshError(f"The region of sensor '{name}' has no face: choose all corners of at least one.")
    if texels < 3:
        raise ArgumentError(f"texels is {texels}: a sensor has three or more.")
    found = even_points(TriangleMesh(mesh.vertices, mesh.triangles[inside]), texels)
    if found.without:
        places = ", ".join("(" + ", ".join(f"{x:.3g}" for x in place) + ")" for place in found.without[:3])
        more = f" and {len(found.without) - 3} more" if len(found.without) > 3 else ""
        warnings.warn(
            f"Sensor '{name}' has no texel on {len(found.without)} islands of its surface, around {places}{more} m: "
            "ask for more texels, or choose a region.",
            stacklevel=4,
        )
    faces = triangles_between(found.position, found.normal, found.island)
    return checked_mesh(found.position, faces, name)[0], found.normal


def _grid_words(texels: Texels) -> dict[str, Any] | None:
    """Return the words of a file for a flat grid about the origin; None for any other shape."""
    layout = texels.layout
    if not isinstance(layout, GridLayout) or min(layout.shape) < 2:
        return None
    pitch = [float(np.ptp(texels.position[:, axis])) / (layout.shape[1 - axis] - 1) for axis in (0, 1)]
    middle = np.stack([layout.column, layout.row], axis=1) - 0.5 * (np.array(layout.shape[::-1]) - 1)
    if not np.allclose(texels.position, np.column_stack([middle * pitch, np.zeros(len(texels))]), atol=1e-9):
        return None
    return {"rows": layout.rows, "columns": layout.columns, "pitch": pitch}


def export_sensor(sensor: SensorOnMesh | Sequence[SensorOnMesh], kind: str, folder: str | os.PathLike[str]) -> Written:
    """Write a sensor, or several, for another simulator.

    Parameters
    ----------
    sensor : Sensor or list of Sensor
    kind : str
        "mjcf", "urdf", "usd", "probes", "contact" or "openrave" (docs/simulators.md).
    folder : path
        Created if it is missing.

    Returns
    -------
    Written
        `files`, and `notes` about what the format cannot express.

    Raises
    ------
    PalpateError
        The format is unknown, or a file cannot be written.
    """
    from ..core.simulators.sensor_format import export_sensors

    return export_sensors(arguments.as_list(sensor, SensorOnMesh, "sensor", "a Sensor"), kind, folder)
