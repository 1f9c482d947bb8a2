# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects as arrays: their evaluated meshes, and the vertices of a sensor's region."""

from __future__ import annotations

import hashlib
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from ..core.errors import MeshError, SensorError

KINDS = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Object types that have or become a mesh."""


@dataclass(frozen=True)
class Arrays:
    """A mesh in object coordinates and Blender units.

    Attributes
    ----------
    vertices : (nv, 3) float
    triangles : (nt, 3) int
    quads : (nq, 4) int
    """

    vertices: np.ndarray
    triangles: np.ndarray
    quads: np.ndarray


@contextmanager
def evaluated(obj, depsgraph):
    """Yield an object's evaluated mesh: with modifiers and shape keys; curves, text and metaballs converted."""
    source = obj.evaluated_get(depsgraph)
    mesh = source.to_mesh()
    try:
        if mesh is None:
            raise MeshError(f"'{obj.name}' has no surface: use an object that has faces.")
        yield mesh
    finally:
        source.to_mesh_clear()


def read(mesh) -> Arrays:
    """Copy a mesh's arrays."""
    mesh.calc_loop_triangles()
    triangles = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    sides = np.empty(len(mesh.polygons), dtype=np.int32)
    start = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", sides)
    mesh.polygons.foreach_get("loop_start", start)
    corner = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corner)
    quads = corner[start[sides == 4, None] + np.arange(4)]
    return Arrays(vertices(mesh), triangles.reshape(-1, 3).astype(np.int64), quads.astype(np.int64))


def vertices(mesh) -> np.ndarray:
    """(nv, 3) float."""
    found = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", found)
    return found.astype(float).reshape(-1, 3)


def target_arrays(obj, depsgraph) -> Arrays:
    """Return what a target is made of: its evaluated mesh."""
    with evaluated(obj, depsgraph) as mesh:
        return read(mesh)


def sensor_arrays(obj, depsgraph) -> tuple[Arrays, list[str]]:
    """Return what a sensor is made of: its own vertices, where the modifiers put them.

    Texels stand on vertices that the user can select and paint, so modifiers that make other vertices are left out, with a
    warning.
    """
    if obj.type != "MESH":
        raise SensorError(f"'{obj.name}' is no mesh: convert it with Object › Convert › Mesh before it becomes a sensor.")
    if obj.mode == "EDIT":
        obj.update_from_editmode()
    base = read(obj.data)
    with evaluated(obj, depsgraph) as mesh:
        final = read(mesh)
    if len(final.vertices) == len(base.vertices):
        return final, []
    return base, [
        f"A modifier changes the number of vertices of sensor '{obj.name}': texels stand on the vertices without modifiers, "
        "apply it to have them on the new ones."
    ]


def region(obj, count: int) -> np.ndarray:
    """(nv,) bool: which vertices belong to the sensor.

    Raises
    ------
    SensorError
        The vertex group does not exist.
    """
    settings = obj.palpate
    if settings.region == "MESH":
        return np.ones(count, dtype=bool)
    group = obj.vertex_groups.get(settings.vertex_group)
    if group is None:
        raise SensorError(
            f"Sensor '{obj.name}' has no vertex group '{settings.vertex_group}': choose one in its Region panel or paint one."
        )
    return weights(obj.data, group.index) >= max(settings.threshold, 1e-6)


def weights(mesh, group_index: int) -> np.ndarray:
    """(nv,) float: weight of each vertex in a vertex group, zero outside it."""
    result = np.zeros(len(mesh.vertices), dtype=np.float32)
    for vertex in mesh.vertices:
        for element in vertex.groups:
            if element.group == group_index:
                result[vertex.index] = element.weight
    return result


def fingerprint(obj, depsgraph) -> str:
    """Return a hash of everything about an object's geometry that forces depend on."""
    with evaluated(obj, depsgraph) as mesh:
        return _fingerprint(obj, mesh)


def own_fingerprint(obj) -> str:
    """Return the same for the mesh without modifiers and animation; curves, text and metaballs have none."""
    return _fingerprint(obj, obj.data) if obj.type == "MESH" else ""


def _fingerprint(obj, mesh) -> str:
    digest = hashlib.blake2b(digest_size=16)
    digest.update(vertices(mesh).tobytes())
    corner = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corner)
    digest.update(corner.tobytes())
    settings = obj.palpate
    if settings.role in ("SENSOR", "PAD") and settings.region == "GROUP":
        group = obj.vertex_groups.get(settings.vertex_group)
        if group is not None:
            digest.update(np.packbits(weights(obj.data, group.index) >= settings.threshold).tobytes())
    return digest.hexdigest()
