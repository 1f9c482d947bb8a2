# SPDX-License-Identifier: GPL-3.0-or-later
"""The vertices that belong to a sensor, and the values that are painted on them."""

from __future__ import annotations

import numpy as np

from ...core.errors import PaintedError, RegionError
from ..properties import parameter_properties
from ..session import transforms
from . import stored_names


def region_vertices(obj) -> np.ndarray:
    """Return which vertices belong to a sensor, (nv,) bool.

    Raises
    ------
    SensorError
        The vertex group, material or face set of the region does not exist.
    """
    return vertices_of_region(obj, **region_of(obj))


def region_of(obj) -> dict:
    """Return the region that an object has as a sensor, as arguments of :func:`vertices_of_region`."""
    own = obj.palpate
    values = {name: getattr(own, name) for name in ("region", "vertex_group", "material", "face_set")}
    return {**values, "threshold": transforms.as_typed(own.threshold)}


def vertices_of_region(
    obj, region: str, vertex_group: str = "", material: str = "", face_set: int = 1, threshold: float = 0.5
) -> np.ndarray:
    """Return the vertices of any region on an object, (nv,) bool; parameters are those in its settings, errors as in
    :func:`region_vertices`.
    """
    if region == "MESH":
        return np.ones(len(obj.data.vertices), dtype=bool)
    if region == "GROUP":
        group = obj.vertex_groups.get(vertex_group)
        if group is None:
            there = f"has no vertex group '{vertex_group}' (was it renamed?)" if vertex_group else "names no vertex group yet"
            raise RegionError(f"Sensor '{obj.name}' {there}: choose one in its Region panel or paint one.")
        return vertex_weights(obj.data, group.index) >= max(threshold, 1e-6)
    return vertices_of_faces(
        obj.data, _faces_of_material(obj, material) if region == "MATERIAL" else _faces_of_set(obj, face_set)
    )


def _faces_of_material(obj, name: str) -> np.ndarray:
    """Return which faces have a material, or had it before a heat map replaced it, (nf,) bool."""
    slots = [index for index, slot in enumerate(obj.material_slots) if slot.material is not None and slot.material.name == name]
    if not slots:
        raise RegionError(f"Sensor '{obj.name}' has no material '{name}': choose one in its Region panel (was it renamed?).")
    index = transforms.values_of(obj.data.polygons, "material_index", np.int32)
    covered = obj.data.attributes.get(stored_names.OLD_MATERIAL)
    if covered is not None and len(covered.data) == len(index):
        before = transforms.values_of(covered.data, "value", np.int32)
        index = np.where(before >= 0, before, index)
    return np.isin(index, slots)


def face_sets(mesh) -> np.ndarray:
    """Return the face set of each face, (nf,) int; all faces are in set 1 while the user has made none."""
    attribute = mesh.attributes.get(".sculpt_face_set")
    sets = np.ones(len(mesh.polygons), dtype=np.int32)
    if attribute is not None:
        attribute.data.foreach_get("value", sets)
    return sets


def _faces_of_set(obj, number: int) -> np.ndarray:
    """Return which faces are in a face set, (nf,) bool."""
    faces = face_sets(obj.data) == number
    if not faces.any():
        there = ", ".join(str(found) for found in np.unique(face_sets(obj.data))[:8])
        raise RegionError(f"Sensor '{obj.name}' has no face set {number}: choose one of {there} in its Region panel.")
    return faces


def vertices_of_faces(mesh, faces: np.ndarray) -> np.ndarray:
    """Return the vertices of the faces that are True in `faces`, (nf,) bool, as (nv,) bool."""
    corner = transforms.values_of(mesh.loops, "vertex_index", np.int32)
    sides = transforms.values_of(mesh.polygons, "loop_total", np.int32)
    chosen = np.zeros(len(mesh.vertices), dtype=bool)
    chosen[corner[np.repeat(faces, sides)]] = True
    return chosen


def painted_multipliers(obj, key: str) -> np.ndarray | None:
    """Return the factor of a parameter at each vertex, from the vertex group or attribute that is painted for it.

    Parameters
    ----------
    key : str
        One of :data:`.parameter_properties.PAINTED_PARAMETERS`.

    Returns
    -------
    (nv,) float or None
        None when nothing is painted for it.

    Raises
    ------
    PaintedError
        The group or attribute does not exist, or holds a value that is no factor.
    """
    name, factor = getattr(obj.palpate, f"{key}_map"), getattr(obj.palpate, f"{key}_factor")
    if not name:
        return None
    group = obj.vertex_groups.get(name)
    if group is not None:
        return 1.0 + (transforms.as_typed(factor) - 1.0) * vertex_weights(obj.data, group.index).astype(float)
    attribute = obj.data.attributes.get(name)
    if attribute is None or not parameter_properties.is_map(attribute):
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


def vertex_weights(mesh, group_index: int) -> np.ndarray:
    """Return the weight of each vertex in a vertex group, (nv,) float; zero outside the group."""
    result = np.zeros(len(mesh.vertices), dtype=np.float32)
    for vertex in mesh.vertices:
        for element in vertex.groups:
            if element.group == group_index:
                result[vertex.index] = element.weight
    return result
