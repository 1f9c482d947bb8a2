# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors of MJCF files: ``tactile``, whose mesh has the texels for vertices, and the plugin ``touch_grid``."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..errors import FileError
from ..geometry.mesh import TriangleMesh, checked_mesh, vertex_normals
from ..geometry.point_surface import triangles_between
from ..io.sensor_toml import MOST_TEXELS
from ..io.xml_file import read_xml
from .sensor_format import FoundSensor
from .xml_reading import mesh_beside, numbers_in, quaternion_of, vector_in

SITE_SIZE = 0.005
"""Metres: MuJoCo's default size of a site."""
PLUGIN = "mujoco.sensor.touch_grid"
DEEPEST_BODY = 200
"""Bodies inside each other; a deeper file is refused, because it is read by recursion."""


@dataclass
class _Model:
    """What is needed of an MJCF file: its meshes, and geoms and sites with their frames in the world."""

    path: str | os.PathLike
    mesh_folder: str = ""
    degrees: bool = True
    meshes: dict[str, ElementTree.Element] = field(default_factory=dict)
    placed: dict[tuple[str, str], tuple[ElementTree.Element, np.ndarray]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def is_mjcf(path: str | os.PathLike) -> bool:
    """Return True if a file is XML with <mujoco>; raises FileError if it cannot be read."""
    return Path(path).suffix.lower() in (".xml", ".mjcf") and read_xml(path, "a model").find("mujoco") is not None


def read_mjcf(path: str | os.PathLike) -> list[FoundSensor]:
    """Return the tactile sensors of a file.

    Raises
    ------
    FileError
        It is damaged or holds no tactile sensor, or a mesh is missing.
    """
    root = read_xml(path, "a model").find("mujoco")
    assert root is not None
    model = _Model(path)
    if root.find(".//include") is not None:
        model.notes.append("Files that it includes were not read.")
    for compiler in root.iter("compiler"):
        model.mesh_folder = compiler.get("meshdir", compiler.get("assetdir", model.mesh_folder))
        model.degrees = compiler.get("angle", "degree") != "radian"
    for mesh in root.iterfind("asset/mesh"):
        model.meshes[mesh.get("name") or Path(mesh.get("file", "")).stem] = mesh
    for world in root.iterfind("worldbody"):
        _place(model, world, np.eye(4), 0)
    found = [_tactile(model, item, number) for number, item in enumerate(root.iterfind("sensor/tactile"))]
    grids = [item for item in root.iterfind("sensor/plugin") if item.get("plugin") == PLUGIN]
    found += [_touch_grid(model, item, number) for number, item in enumerate(grids)]
    if not found:
        raise FileError(f"'{path}' has no <tactile> and no {PLUGIN} in its <sensor>: give a file that has one.")
    return found


def _place(model: _Model, parent: ElementTree.Element, frame: np.ndarray, depth: int) -> None:
    """Note the frames of all geoms and sites below a body."""
    if depth > DEEPEST_BODY:
        raise FileError(f"'{model.path}' nests more than {DEEPEST_BODY} bodies: a robot has fewer.")
    for child in parent:
        if child.tag in ("geom", "site", "body", "frame"):
            own = frame @ _pose(model, child)
            if child.tag in ("geom", "site"):
                model.placed[child.tag, child.get("name", "")] = child, own
            else:
                _place(model, child, own, depth + 1)


def _pose(model: _Model, element: ElementTree.Element) -> np.ndarray:
    """Return the matrix of an element's frame in its parent's."""
    from scipy.spatial.transform import Rotation

    matrix = np.eye(4)
    matrix[:3, 3] = vector_in(model.path, element, "pos", "0 0 0")
    turn = Rotation.identity()
    try:
        if element.get("quat") is not None:
            turn = Rotation.from_quat(np.roll(vector_in(model.path, element, "quat", "", 4), -1))
        elif element.get("euler") is not None:  # about the turned axes, in the default order
            turn = Rotation.from_euler("XYZ", vector_in(model.path, element, "euler", ""), degrees=model.degrees)
        elif element.get("axisangle") is not None:
            *axis, angle = vector_in(model.path, element, "axisangle", "", 4)
            turn = Rotation.from_rotvec((np.radians(angle) if model.degrees else angle) * np.array(axis) / np.linalg.norm(axis))
        elif element.get("xyaxes") is not None or element.get("zaxis") is not None:
            model.notes.append(
                f"The rotation of <{element.tag} name='{element.get('name', '')}'> by its axes was not imported."
            )
    except ValueError as error:  # a quaternion of length zero
        raise FileError(f"The rotation of <{element.tag}> in '{model.path}' is none ({error}): correct it.") from error
    matrix[:3, :3] = turn.as_matrix()
    return matrix


def _tactile(model: _Model, sensor: ElementTree.Element, number: int) -> FoundSensor:
    """Return the sensor of a <tactile>."""
    name = sensor.get("name") or f"tactile {number + 1}"
    mesh = model.meshes.get(sensor.get("mesh", ""))
    if mesh is None:
        raise FileError(f"Sensor '{name}' in '{model.path}' names the mesh '{sensor.get('mesh', '')}', which is not there.")
    place = model.placed.get(("geom", sensor.get("geom", "")))
    if place is None:
        raise FileError(f"Sensor '{name}' in '{model.path}' names the geom '{sensor.get('geom', '')}', which is not there.")
    position, normal, faces = _mesh_arrays(model, mesh, name)
    notes = [*model.notes, f"'{name}': MuJoCo's geoms, contact and joints were not imported; parameters have their defaults."]
    frame = place[1]
    return FoundSensor(
        name, position, normal, faces, frame_position=frame[:3, 3], frame_quaternion=quaternion_of(frame[:3, :3]), notes=notes
    )


def _mesh_arrays(model: _Model, mesh: ElementTree.Element, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the vertices, normals and faces of a mesh in its file's frame."""
    path = model.path
    if mesh.get("builtin") is not None or mesh.find("plugin") is not None:
        raise FileError(f"The mesh of '{name}' in '{path}' is made by MuJoCo: save the model from MuJoCo, which writes it out.")
    if mesh.get("file") is not None:
        loaded = mesh_beside(path, mesh.get("file", ""), model.mesh_folder)
        loaded = TriangleMesh(loaded.vertices * vector_in(path, mesh, "scale", "1 1 1"), loaded.triangles)
        return loaded.vertices, vertex_normals(loaded), loaded.triangles
    values = numbers_in(path, mesh, "vertex")
    if len(values) % 3 or not 9 <= len(values) <= 3 * MOST_TEXELS:
        raise FileError(
            f"The mesh of '{name}' in '{path}' has {len(values)} coordinates: give three for each of 3 to {MOST_TEXELS}."
        )
    position = values.reshape(-1, 3) * vector_in(path, mesh, "scale", "1 1 1") - vector_in(path, mesh, "refpos", "0 0 0")
    corners, normals = numbers_in(path, mesh, "face", ""), numbers_in(path, mesh, "normal", "")
    if len(corners) % 3 or (corners % 1).any():
        raise FileError(f"The faces of '{name}' in '{path}' are not triples of whole numbers: correct them.")
    per_vertex = len(normals) // len(values) if len(normals) % len(values) == 0 else 0
    if len(normals) and per_vertex not in (1, 3):
        raise FileError(f"The mesh of '{name}' in '{path}' has {len(normals) // 3} normals for {len(position)} vertices.")
    normal = normals.reshape(len(position), -1)[:, :3] if len(normals) else np.zeros((0, 3))
    if len(corners):
        shape, _ = checked_mesh(position, corners.reshape(-1, 3).astype(int), name)
        faces = shape.triangles
        normal = normal if len(normal) else vertex_normals(shape)
    else:
        if not len(normal):
            raise FileError(f"The mesh of '{name}' in '{path}' has neither faces nor normals: add one of them.")
        faces = triangles_between(position, normal)
    return position, normal, faces


def _touch_grid(model: _Model, sensor: ElementTree.Element, number: int) -> FoundSensor:
    """Return the sensor of a touch_grid: its bins of directions, on a sphere around the site."""
    name, path = sensor.get("name") or f"touch grid {number + 1}", model.path
    place = model.placed.get(("site", sensor.get("objname", "")))
    if place is None:
        raise FileError(f"Sensor '{name}' in '{path}' names the site '{sensor.get('objname', '')}', which is not there.")
    settings = {item.get("key"): item for item in sensor.iterfind("config")}
    missing = next((key for key in ("size", "fov") if key not in settings), None)
    if missing:
        raise FileError(f"Sensor '{name}' in '{path}' has no <config key=\"{missing}\">: add it.")
    columns, rows = vector_in(path, settings["size"], "value", "", 2)
    if min(columns, rows) < 2 or columns * rows > MOST_TEXELS or columns % 1 or rows % 1:
        raise FileError(
            f"Sensor '{name}' in '{path}' has {columns:g} × {rows:g} bins: two each way and {MOST_TEXELS} at most are read."
        )
    fov = vector_in(path, settings["fov"], "value", "", 2)
    gamma = vector_in(path, settings["gamma"], "value", "", 1)[0] if "gamma" in settings else 0.0
    azimuth, elevation = (_bin_middles(int(n), limit, gamma) for n, limit in zip((columns, rows), fov))
    y, x = np.meshgrid(elevation, azimuth, indexing="ij")
    direction = np.stack([np.cos(y) * np.sin(x), np.sin(y), -np.cos(y) * np.cos(x)], axis=-1).reshape(-1, 3)
    sizes = numbers_in(path, place[0], "size", str(SITE_SIZE))
    if not len(sizes) or sizes[0] <= 0.0:
        raise FileError(f"The site of sensor '{name}' in '{path}' has no size above zero: correct it.")
    radius = float(sizes[0])
    row, column = (index.ravel() for index in np.indices((int(rows), int(columns))))
    notes = [
        *model.notes,
        f"'{name}': a touch_grid has directions and no surface; its texels are on a sphere of the site's size, {radius:g} m.",
        f"'{name}': MuJoCo's geoms, contact and joints were not imported; parameters have their defaults.",
    ]
    grid = np.arange(len(row)).reshape(int(rows), int(columns))
    corners = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    frame = place[1]
    turn = quaternion_of(frame[:3, :3])
    return FoundSensor(
        name, radius * direction, direction, faces, row, column, frame_position=frame[:3, 3], frame_quaternion=turn, notes=notes
    )


def _bin_middles(count: int, limit: float, gamma: float) -> np.ndarray:
    """Return the middles of a touch_grid's bins, radians; `limit` is half its field of view, degrees (touch_grid.cc)."""
    edges = np.linspace(-1.0, 1.0, count + 1)
    share = min(max(gamma, 0.0), 1.0)
    edges = np.radians(limit) * (share * edges**5 + (1.0 - share) * edges)
    middles: np.ndarray = (edges[1:] + edges[:-1]) / 2.0
    return middles
