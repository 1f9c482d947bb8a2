# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's meshes as arrays."""

from __future__ import annotations

import hashlib
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np

from ...core.errors import MeshError, SensorError
from ..properties import parameter_properties
from ..session import transforms
from . import sensor_regions
from .stored_names import MODIFIERS, REST_POSITION


@dataclass(frozen=True)
class MeshArrays:
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
def evaluated_mesh(obj, depsgraph):
    """Yield an object's mesh with modifiers and shape keys applied; curves, text and metaballs are converted.

    The indentation that shows a bake is left out.
    """
    source = obj.evaluated_get(depsgraph)
    mesh = source.to_mesh()
    try:
        if mesh is None:
            raise MeshError(f"'{obj.name}' has no surface: use an object that has faces.")
        if REST_POSITION in mesh.attributes and len(mesh.vertices) >= len(obj.data.vertices):
            _undo_indentation(mesh, obj.data)
        yield mesh
    finally:
        source.to_mesh_clear()


def _undo_indentation(mesh, base) -> None:
    """Give an indented mesh the vertices and faces of the object's own mesh, and the places that these had before."""
    rest = transforms.values_of(mesh.attributes[REST_POSITION].data, "vector", width=3)
    mesh.clear_geometry()
    mesh.vertices.add(len(base.vertices))
    mesh.vertices.foreach_set("co", rest[: 3 * len(base.vertices)])
    mesh.loops.add(len(base.loops))
    mesh.loops.foreach_set("vertex_index", corner_vertices(base))
    mesh.polygons.add(len(base.polygons))
    mesh.polygons.foreach_set("loop_start", face_numbers(base, "loop_start"))
    mesh.update(calc_edges=True)


def read_arrays(mesh) -> MeshArrays:
    """Copy the arrays of a mesh."""
    mesh.calc_loop_triangles()
    triangles = transforms.values_of(mesh.loop_triangles, "vertices", np.int32, 3)
    first_corners = face_numbers(mesh, "loop_start")[face_numbers(mesh, "loop_total") == 4]
    quads = corner_vertices(mesh)[first_corners[:, None] + np.arange(4)]
    return MeshArrays(vertices(mesh), triangles.reshape(-1, 3).astype(np.int64), quads.astype(np.int64))


def vertices(mesh) -> np.ndarray:
    """Return the positions of the vertices, (nv, 3) float."""
    return positions(mesh).astype(float).reshape(-1, 3)


def positions(mesh) -> np.ndarray:
    """Return the positions of the vertices in one row, (3 · nv,) float32.

    Blender copies an attribute at once, but properties one by one, which takes at least ten times as long.
    """
    attribute = mesh.attributes.get("position")
    if attribute is None or len(attribute.data) != len(mesh.vertices):  # the attribute is empty in Edit Mode
        return transforms.values_of(mesh.vertices, "co", width=3)
    return transforms.values_of(attribute.data, "vector", width=3)


def corner_vertices(mesh) -> np.ndarray:
    """Return the vertex of each corner of the faces, (nc,) int32."""
    attribute = mesh.attributes.get(".corner_vert")
    if attribute is None or len(attribute.data) != len(mesh.loops):
        return transforms.values_of(mesh.loops, "vertex_index", np.int32)
    return transforms.values_of(attribute.data, "value", np.int32)


def face_numbers(mesh, name: str) -> np.ndarray:
    """Return a property of the faces, as ``material_index``, (nf,) int32."""
    return transforms.values_of(mesh.polygons, name, np.int32)


def store(mesh, name: str, values: np.ndarray, vertices: np.ndarray | None = None, kind: str = "FLOAT_VECTOR") -> None:
    """Give the vertices of a mesh an attribute; with `vertices` the values are those of these, and the others have zero."""
    table = values
    if vertices is not None:
        table = np.zeros((len(mesh.vertices), *values.shape[1:]), dtype=np.float32)
        table[vertices] = values
    attribute = mesh.attributes.get(name) or mesh.attributes.new(name, kind, "POINT")
    key = "vector" if kind == "FLOAT_VECTOR" else "value"
    attribute.data.foreach_set(key, table.astype(np.int32 if kind == "INT" else np.float32).ravel())


def point_vectors(mesh, name: str) -> np.ndarray | None:
    """Return a vector attribute of the vertices, (nv, 3) float; None where the mesh has none of the name."""
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.domain != "POINT" or attribute.data_type != "FLOAT_VECTOR":
        return None
    return transforms.values_of(attribute.data, "vector", width=3).astype(float).reshape(-1, 3)


def new_mesh(name: str, vertices: np.ndarray, faces):
    """Return a new data-block of a mesh; `faces` are sequences of numbers of vertices."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces)
    return mesh


def remove_attributes(mesh, names) -> None:
    """Remove the attributes of these names, as far as the mesh has them."""
    for name in names:
        attribute = mesh.attributes.get(name)
        if attribute is not None:
            mesh.attributes.remove(attribute)


def target_arrays(obj, depsgraph) -> MeshArrays:
    """Return the surface of a target: its evaluated mesh."""
    with evaluated_mesh(obj, depsgraph) as mesh:
        return read_arrays(mesh)


def sensor_arrays(obj, depsgraph) -> tuple[MeshArrays, list[str]]:
    """Return the surface of a sensor, and warnings: its own vertices, where the modifiers put them.

    Texels stand on vertices that the user can select and paint. If modifiers change the number of vertices, the mesh without
    modifiers is returned, with a warning.
    """
    if obj.type != "MESH":
        raise SensorError(f"'{obj.name}' is not a mesh: convert it with Object › Convert › Mesh before it becomes a sensor.")
    if obj.mode == "EDIT":
        obj.update_from_editmode()
    base = read_arrays(obj.data)
    with evaluated_mesh(obj, depsgraph) as mesh:
        final = read_arrays(mesh)
    if len(final.vertices) == len(base.vertices):
        return final, []
    own = [modifier.name for modifier in obj.modifiers if modifier.show_viewport and modifier.name not in MODIFIERS]
    names = ", ".join(f"'{name}'" for name in own)
    return base, [
        f"A modifier ({names}) changes the number of vertices of sensor '{obj.name}': texels stand on the vertices without "
        "modifiers, apply it to have them on the new ones."
    ]


def evaluated_fingerprint(obj, depsgraph) -> str:
    """Return a hash of an object's evaluated geometry, of everything in it that forces depend on."""
    with evaluated_mesh(obj, depsgraph) as mesh:
        return _fingerprint(obj, mesh)


def own_fingerprint(obj) -> str:
    """Return the hash of an object's own mesh, without modifiers and animation; empty for curves, text and metaballs."""
    return _fingerprint(obj, obj.data) if obj.type == "MESH" else ""


def _fingerprint(obj, mesh) -> str:
    """Return the hash of a mesh of an object."""
    return arrays_fingerprint(positions(mesh), corner_vertices(mesh), region_bytes(obj))


def arrays_fingerprint(positions: np.ndarray, corners: np.ndarray, region: bytes) -> str:
    """Return the hash of positions and corners of a mesh (:mod:`.mesh_arrays`) and of :func:`region_bytes`."""
    digest = hashlib.blake2b(digest_size=16)
    for part in (positions, corners, region):
        digest.update(part)
    return digest.hexdigest()


def region_bytes(obj) -> bytes:
    """Return region, painted values and UV maps of images that the mesh of a sensor or pad holds, as bytes."""
    if obj.type != "MESH" or obj.palpate.role not in ("SENSOR", "PAD"):
        return b""
    parts = []
    with suppress(SensorError):  # reading the scene reports it
        parts.append(np.packbits(sensor_regions.region_vertices(obj)).tobytes())
        for key in parameter_properties.PAINTED_PARAMETERS:
            values = sensor_regions.painted_multipliers(obj, key)
            parts.append(b"" if values is None else values.tobytes())
    if obj.palpate.image_layout == "UV":
        for layer in obj.data.uv_layers:
            uv = transforms.values_of(layer.uv, "vector", width=2)
            parts.append(layer.name.encode("utf-8", "surrogatepass") + uv.tobytes())
    return b"".join(parts)


# Evaluated meshes as they were read last.
#
# Most meshes are the same at the next frame. Comparing two meshes takes less time than to compute a fingerprint and positions
# in the body's frame again.


@dataclass
class MeshSnapshot:
    """An evaluated mesh as it was read.

    Attributes
    ----------
    positions : (3 · nv,) float32, Blender units, in the object's frame
    corners : (nc,) int32
        Vertex of each corner of the faces.
    fingerprint : str
        Empty until it is asked for.
    """

    positions: np.ndarray
    corners: np.ndarray
    fingerprint: str = ""

    @cached_property
    def vertices(self) -> np.ndarray:
        """Positions of the vertices, (nv, 3) float."""
        return self.positions.astype(float).reshape(-1, 3)


class MeshSnapshots:
    """Snapshots of the objects of a run. Each mesh is read once per frame."""

    def __init__(self):
        self._snapshots: dict[int, MeshSnapshot] = {}
        self._regions: dict[int, bytes] = {}
        self._read: set[int] = set()

    def begin_frame(self) -> None:
        """Note that the scene stands at another frame, so that every mesh has to be read again."""
        self._read.clear()

    def snapshot(self, obj, depsgraph) -> MeshSnapshot:
        """Return the snapshot of an object; the identical one while positions and number of corners stay the same."""
        key = obj.session_uid
        if key not in self._read:
            with evaluated_mesh(obj, depsgraph) as mesh:
                now, before = positions(mesh), self._snapshots.get(key)
                if before is None or len(mesh.loops) != len(before.corners) or not _same_bits(now, before.positions):
                    self._snapshots[key] = MeshSnapshot(now, corner_vertices(mesh))
            self._read.add(key)
        return self._snapshots[key]

    def fingerprint(self, obj, depsgraph) -> str:
        """Return an object's :func:`evaluated_fingerprint`, with its region as at the first call."""
        key, snapshot = obj.session_uid, self.snapshot(obj, depsgraph)
        if key not in self._regions:
            self._regions[key] = region_bytes(obj)
        if not snapshot.fingerprint:
            snapshot.fingerprint = arrays_fingerprint(snapshot.positions, snapshot.corners, self._regions[key])
        return snapshot.fingerprint


def _same_bits(one: np.ndarray, other: np.ndarray) -> bool:
    """Return True when two arrays of 32-bit values have the same bits."""
    return len(one) == len(other) and np.array_equal(one.view(np.int32), other.view(np.int32))
