# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects as arrays: their evaluated meshes, and the vertices of a sensor's region."""

from __future__ import annotations

import hashlib
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import numpy as np

from ...core.errors import MeshError, PaintedError, RegionError, SensorError
from ..properties import painted_maps
from ..session import units

PAINTED = ("k", "friction", "gain")
"""Multipliers that can be painted; each has a `…_map` and a `…_factor` among the object's properties."""
OLD_MATERIAL = ".palpate_old_material"
"""Face attribute of a baked sensor: material index before the heat map; −1 on faces that were not touched."""
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
    corner = corners(mesh)
    quads = corner[start[sides == 4, None] + np.arange(4)]
    return Arrays(vertices(mesh), triangles.reshape(-1, 3).astype(np.int64), quads.astype(np.int64))


def vertices(mesh) -> np.ndarray:
    """(nv, 3) float."""
    return places(mesh).astype(float).reshape(-1, 3)


def places(mesh) -> np.ndarray:
    """(3 · nv,) float32: places of the vertices.

    Attributes are copied at once, properties one by one, which takes ten times as long and more.
    """
    found = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    attribute = mesh.attributes.get("position")
    if attribute is None or 3 * len(attribute.data) != len(found):  # empty in Edit Mode
        mesh.vertices.foreach_get("co", found)
    else:
        attribute.data.foreach_get("vector", found)
    return found


def corners(mesh) -> np.ndarray:
    """(nc,) int32: vertex of each corner of the faces."""
    found = np.empty(len(mesh.loops), dtype=np.int32)
    attribute = mesh.attributes.get(".corner_vert")
    if attribute is None or len(attribute.data) != len(found):
        mesh.loops.foreach_get("vertex_index", found)
    else:
        attribute.data.foreach_get("value", found)
    return found


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
        What the region goes by does not exist.
    """
    own = obj.palpate
    return region_by(
        obj,
        count,
        region=own.region,
        vertex_group=own.vertex_group,
        material=own.material,
        face_set=own.face_set,
        threshold=own.threshold,
    )


def region_by(
    obj, count: int, region: str, vertex_group: str = "", material: str = "", face_set: int = 1, threshold: float = 0.5
) -> np.ndarray:
    """(nv,) bool: vertices of a region that is not, or not yet, the object's own; errors as those of :func:`region`."""
    if region == "MESH":
        return np.ones(count, dtype=bool)
    if region == "GROUP":
        group = obj.vertex_groups.get(vertex_group)
        if group is None:
            there = f"has no vertex group '{vertex_group}' (was it renamed?)" if vertex_group else "names no vertex group yet"
            raise RegionError(f"Sensor '{obj.name}' {there}: choose one in its Region panel or paint one.")
        return weights(obj.data, group.index) >= max(threshold, 1e-6)
    return corners_of(obj.data, _faces_of_material(obj, material) if region == "MATERIAL" else _faces_of_set(obj, face_set))


def _faces_of_material(obj, name: str) -> np.ndarray:
    """(nf,) bool: faces that wear a material, or did before a heat map covered them."""
    slots = [index for index, slot in enumerate(obj.material_slots) if slot.material is not None and slot.material.name == name]
    if not slots:
        raise RegionError(f"Sensor '{obj.name}' wears no material '{name}': choose one in its Region panel (was it renamed?).")
    index = np.empty(len(obj.data.polygons), dtype=np.int32)
    obj.data.polygons.foreach_get("material_index", index)
    covered = obj.data.attributes.get(OLD_MATERIAL)
    if covered is not None and len(covered.data) == len(index):
        before = np.empty(len(index), dtype=np.int32)
        covered.data.foreach_get("value", before)
        index = np.where(before >= 0, before, index)
    return np.isin(index, slots)


def face_sets(mesh) -> np.ndarray:
    """(nf,) int: face set of each face; all are in set 1 while none was drawn."""
    attribute = mesh.attributes.get(".sculpt_face_set")
    sets = np.ones(len(mesh.polygons), dtype=np.int32)
    if attribute is not None:
        attribute.data.foreach_get("value", sets)
    return sets


def _faces_of_set(obj, number: int) -> np.ndarray:
    faces = face_sets(obj.data) == number
    if not faces.any():
        there = ", ".join(str(found) for found in np.unique(face_sets(obj.data))[:8])
        raise RegionError(f"Sensor '{obj.name}' has no face set {number}: choose one of {there} in its Region panel.")
    return faces


def corners_of(mesh, faces: np.ndarray) -> np.ndarray:
    """(nv,) bool: vertices of the faces that (nf,) bool chooses."""
    corner = np.empty(len(mesh.loops), dtype=np.int32)
    sides = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corner)
    mesh.polygons.foreach_get("loop_total", sides)
    chosen = np.zeros(len(mesh.vertices), dtype=bool)
    chosen[corner[np.repeat(faces, sides)]] = True
    return chosen


def multipliers(obj, key: str) -> np.ndarray | None:
    """(nv,) float: what a parameter is multiplied by at each vertex, from the group or attribute that is painted for it.

    Parameters
    ----------
    key : str
        "k", "friction" or "gain".

    Returns
    -------
    (nv,) float or None
        None when nothing is painted.

    Raises
    ------
    PaintedError
        The group or attribute does not exist, or holds what cannot be a factor.
    """
    name, factor = getattr(obj.palpate, f"{key}_map"), getattr(obj.palpate, f"{key}_factor")
    if not name:
        return None
    group = obj.vertex_groups.get(name)
    if group is not None:
        return 1.0 + (units.as_typed(factor) - 1.0) * weights(obj.data, group.index).astype(float)
    attribute = obj.data.attributes.get(name)
    if attribute is None or not painted_maps.is_map(attribute):
        what = obj.palpate.bl_rna.properties[f"{key}_map"].name
        raise PaintedError(
            f"Sensor '{obj.name}' has no vertex group or attribute '{name}' any more, which its {what} names: "
            "choose another one there, or empty the field."
        )
    values = np.empty(len(obj.data.vertices), dtype=np.float32)
    attribute.data.foreach_get("value", values)
    if not (np.isfinite(values).all() and (values >= 0).all()):
        raise PaintedError(f"Attribute '{name}' of '{obj.name}' holds a negative or NaN factor: make all of them zero or more.")
    return values.astype(float)


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
    return fingerprint_of(places(mesh), corners(mesh), region_bytes(obj))


def fingerprint_of(places: np.ndarray, corners: np.ndarray, region: bytes) -> str:
    """Return the hash of :func:`places`, :func:`corners` and :func:`region_bytes`."""
    digest = hashlib.blake2b(digest_size=16)
    for part in (places, corners, region):
        digest.update(part)
    return digest.hexdigest()


def region_bytes(obj) -> bytes:
    """Return what a sensor's or pad's own mesh says beside its shape: region, what is painted, the map of its images."""
    if obj.type != "MESH" or obj.palpate.role not in ("SENSOR", "PAD"):
        return b""
    parts = []
    with suppress(SensorError):  # it is said when the scene is read
        parts.append(np.packbits(region(obj, len(obj.data.vertices))).tobytes())
        for key in PAINTED:
            values = multipliers(obj, key)
            parts.append(b"" if values is None else values.tobytes())
    if obj.palpate.image_layout == "UV":
        for layer in obj.data.uv_layers:
            uv = np.empty(2 * len(layer.uv), dtype=np.float32)
            layer.uv.foreach_get("vector", uv)
            parts.append(layer.name.encode("utf-8", "surrogatepass") + uv.tobytes())
    return b"".join(parts)
