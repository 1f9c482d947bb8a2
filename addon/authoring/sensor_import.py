# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors from files of other programs: MuJoCo, URDF, USD, probe lists, OpenRAVE, and GenTact's .blend files."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import FileError, SceneError
from ...core.geometry.mesh import TriangleMesh, vertex_normals
from ...core.simulators.sensor_format import FoundSensor, import_sensors, require_sensor_size
from ..properties import effect_stack
from ..scene import mesh_arrays
from ..scene.stored_names import STATED_NORMAL
from ..session import transforms
from . import exchange, sensors

FLAG, POSITION, NORMAL = "is_sensor", "sensor_pos", "sensor_normal"
"""Attributes of points in GenTact's files."""
SAME_NORMAL = 0.1
"""Degrees; a smaller difference between a file's normals and those of the surface through its texels is not kept."""


def import_file(context, path, names=()) -> tuple[list, list[str]]:
    """Make the sensors of a file in the scene.

    Parameters
    ----------
    path : str or Path
    names : sequence of str
        Of sensors in the file. Without names: all.

    Returns
    -------
    objects : list of Object
        Those that are new, and those that got parameters.
    notes : list of str
        The parts that are not imported, one sentence each.

    Raises
    ------
    PalpateError
        The file is damaged or holds no sensor. Nothing was changed then.
    """
    found = _read_gentact(context, path) if Path(path).suffix.lower() == ".blend" else import_sensors(path)[1]
    for name in names:
        if name not in [item.name for item in found]:
            known = ", ".join(f"'{item.name}'" for item in found)
            raise SceneError(f"There is no sensor '{name}' in '{Path(path).name}': choose from {known}.")
    chosen = [item for item in found if not names or item.name in names]
    owners = [_owner(context, item) if item.position is None else None for item in chosen]
    for item in chosen:
        item.parameters.check(item.name)
        if item.position is not None:
            require_sensor_size(item.position, item.name)
    objects, notes = [], []
    for item, owner in zip(chosen, owners, strict=True):
        notes += item.notes
        if owner is None:
            owner = _new_sensor(context, item)
            _keep_normals(owner, item)
        exchange.put_parameters(owner, item.parameters)
        if item.effects:
            effect_stack.put_stack(owner, item.effects)
        objects.append(owner)
    return objects, notes


def _owner(context, item):
    """Return the sensor that gets the parameters of a file without texels: the one of its name, else the active one."""
    obj = {one.name: one for one in context.scene.objects}.get(item.name)
    obj = obj if obj is not None and obj.palpate.role in {"SENSOR", "PAD"} else context.object
    if obj is None or obj.palpate.role not in {"SENSOR", "PAD"}:
        raise SceneError(f"The file has no texels of '{item.name}': make the sensor that gets its parameters active first.")
    return obj


def _new_sensor(context, item):
    """Return a new object whose mesh is the texels, on the surface that carries them where the file has it."""
    scale = 1.0 / transforms.metres_per_unit(context.scene)
    obj = _new_object(context, item.name, item.position * scale, item.faces)
    top = obj
    if item.surface is not None:
        top = _new_object(context, f"{item.name} Surface", item.surface.vertices * scale, item.surface.triangles)
        obj.parent, obj.palpate.body = top, "PARENT"
    top.location = item.frame_position * scale
    top.rotation_mode, top.rotation_quaternion = "QUATERNION", item.frame_quaternion
    sensors.make_sensor(obj, "MESH")
    context.view_layer.update()
    sensors.choose_alone(context, obj)
    return obj


def _new_object(context, name: str, vertices: np.ndarray, faces: np.ndarray):
    obj = bpy.data.objects.new(name, mesh_arrays.new_mesh(name, vertices, faces.tolist()))
    context.collection.objects.link(obj)
    return obj


def _keep_normals(obj, item) -> None:
    """Keep the file's normals on the vertices if they are not those of the surface through the texels."""
    own = vertex_normals(TriangleMesh(np.asarray(item.position, float), np.asarray(item.faces)))
    angle = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", own, item.normal), -1.0, 1.0)).max())
    if not angle <= SAME_NORMAL:
        mesh_arrays.store(obj.data, STATED_NORMAL, np.asarray(item.normal))


def _read_gentact(context, path) -> list:
    """Return the sensors of a .blend of GenTact: each object with points that are flagged as sensors."""
    found = []
    with _linked_objects(context, path) as objects:
        depsgraph = context.evaluated_depsgraph_get()
        for obj in objects:
            if obj.type != "MESH":
                continue
            with mesh_arrays.evaluated_mesh(obj, depsgraph) as mesh:
                points = _flagged_points(mesh, obj.name)
                if points is None:
                    continue
            position, normal, faces, notes = points
            place, turn, stretch = transforms.decompose(transforms.as_array(obj.evaluated_get(depsgraph).matrix_world))
            scale = transforms.metres_per_unit(context.scene)
            normal = normal @ np.linalg.inv(stretch)
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            where, at = position @ stretch.T * scale, place * scale
            found.append(FoundSensor(obj.name, where, normal, faces, frame_position=at, frame_quaternion=turn, notes=notes))
    if not found:
        raise FileError(
            f"'{path}' has no object with three or more points flagged by the attribute '{FLAG}': see GenTact's guide."
        )
    return found


def _flagged_points(mesh, name: str):
    """Return position, normal, faces and notes of a mesh's flagged points, in its own units; None if there are not three."""
    from ...core.geometry.point_surface import triangles_between

    flag = mesh.attributes.get(FLAG)
    if flag is None or flag.domain != "POINT" or flag.data_type not in ("BOOLEAN", "INT", "FLOAT"):
        return None
    kind = {"BOOLEAN": bool, "INT": np.int32, "FLOAT": np.float32}[flag.data_type]
    values = transforms.values_of(flag.data, "value", kind)
    position, normal = (mesh_arrays.point_vectors(mesh, name) for name in (POSITION, NORMAL))
    notes = [f"'{name}': the kind and the radius of GenTact's sensors were not imported; parameters have their defaults."]
    if position is None:
        position = mesh_arrays.vertices(mesh)
    if normal is None:
        normal = np.array([tuple(item.vector) for item in mesh.vertex_normals])
        notes.append(f"'{name}' has no attribute '{NORMAL}': the normals of its vertices were taken.")
    chosen = np.flatnonzero(values.astype(bool))
    if len(chosen) < 3:
        return None
    if not (np.isfinite(position[chosen]).all() and np.isfinite(normal[chosen]).all()):
        raise FileError(f"A sensor of '{name}' has a position or normal that is NaN or infinite: apply its modifier again.")
    _, first = np.unique(position[chosen], axis=0, return_index=True)
    if len(first) < len(chosen):
        notes.append(f"'{name}': {len(chosen) - len(first)} sensors at the place of another were left out.")
        chosen = chosen[np.sort(first)]
    length = np.linalg.norm(normal[chosen], axis=1, keepdims=True)
    if length.min() == 0.0:
        raise FileError(f"Sensor {int(length.argmin())} of '{name}' has no normal: set the attribute '{NORMAL}'.")
    normal = normal[chosen] / length
    return position[chosen], normal, triangles_between(position[chosen], normal), notes


@contextmanager
def _linked_objects(context, path):
    """Yield the objects of another .blend, linked into the scene for as long as they are looked at; no Python of it runs."""
    before = set(bpy.data.libraries)
    collection = bpy.data.collections.new("Palpate Import")
    context.scene.collection.children.link(collection)
    try:
        try:
            with bpy.data.libraries.load(str(path), link=True) as (source, wanted):
                wanted.objects = list(source.objects)
        except OSError as error:
            raise FileError(f"'{path}' cannot be opened by Blender: check its name, or save it again.") from error
        objects = [obj for obj in wanted.objects if obj is not None]
        for obj in objects:
            collection.objects.link(obj)
        context.view_layer.update()
        yield objects
    finally:
        bpy.data.collections.remove(collection)
        for library in set(bpy.data.libraries) - before:
            bpy.data.libraries.remove(library)
