# SPDX-License-Identifier: GPL-3.0-or-later
"""Making and unmaking sensors, targets and pads."""

from __future__ import annotations

import numpy as np

from ...core.errors import SensorError
from ..display import baked_scene
from ..scene import mesh_arrays, sensor_regions
from ..session import transforms

GROUP_NAME = "Palpate Sensor"
PENETRATION_SHARES = 0.05, 0.3
"""Least and largest maximum penetration as shares of the longest side of a region. Between them the default stays: 12 mm, that
of the foam of the paper's 44 mm pad. With a quarter, texels of a 2.7 m head acted through its chin."""


def automatic_source(obj, mode: str) -> str:
    """Return the source that AUTO stands for in a mode: selection in Edit Mode, group in Weight Paint, else the whole mesh."""
    if mode == "EDIT":
        obj.update_from_editmode()
        if selected_vertices(obj).any():
            return "SELECTION"
    if mode == "WEIGHT_PAINT" and obj.vertex_groups.active is not None:
        return "GROUP"
    return "MESH"


def choose_alone(context, obj) -> None:
    """Make an object the active one, and the only one that is selected."""
    for other in context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj


def selected_vertices(obj) -> np.ndarray:
    """Return which vertices were selected when the object was last updated from Edit Mode, (nv,) bool."""
    return transforms.values_of(obj.data.vertices, "select", bool)


def make_sensor(obj, source: str, role: str = "SENSOR") -> int:
    """Give a mesh object the role of a sensor, or of a pad, on a region.

    Parameters
    ----------
    source : {"SELECTION", "GROUP", "MATERIAL", "FACE_SET", "MESH"}
        SELECTION writes a vertex group; GROUP and MATERIAL take the active one, FACE_SET takes that of the active face.

    Returns
    -------
    int
        Number of vertices in the region.

    Raises
    ------
    SensorError
        The region has no vertices or no face. Nothing was changed then.
    """
    if obj.type != "MESH":
        raise SensorError(f"'{obj.name}' is not a mesh: convert it with Object › Convert › Mesh before it becomes a sensor.")
    chosen, region = _region(obj, source)
    _check(obj, chosen, source)
    if source == "SELECTION":
        group = obj.vertex_groups.get(GROUP_NAME) or obj.vertex_groups.new(name=GROUP_NAME)
        group.remove(range(len(chosen)))
        region["vertex_group"] = _fill(group, chosen)
        obj.vertex_groups.active_index = group.index
    elif source == "MESH":
        region["made_vertices"] = len(chosen)
    settings = obj.palpate
    for name, value in region.items():
        setattr(settings, name, value)
    settings.role = role
    return int(chosen.sum())


def follow_size(scene, obj) -> str:
    """Set a maximum penetration that nobody has set yet after the size of the region, where the default does not suit it.

    Returns
    -------
    str
        The properties that were set, as a sentence; empty if there are none.
    """
    settings = obj.palpate
    if settings.is_property_set("max_penetration") or not obj.is_editable:
        return ""
    try:
        chosen = mesh_arrays.positions(obj.data).reshape(-1, 3)[sensor_regions.region_vertices(obj)]
    except SensorError:
        return ""  # nothing is painted yet
    scale = np.abs(obj.matrix_world.to_scale()) * transforms.metres_per_unit(scene)
    size = float((np.ptp(chosen, axis=0) * scale).max()) if len(chosen) else 0.0
    least, most = (share * size for share in PENETRATION_SHARES)
    if not size or least <= settings.max_penetration <= most:
        return ""
    settings.max_penetration = float(f"{least if settings.max_penetration < least else most:.1g}")
    return (
        f"Its maximum penetration is {1e3 * settings.max_penetration:.3g} mm, after the size of the region, {1e3 * size:.3g} mm"
    )


def describe_region(obj, source: str) -> dict:
    """Return a lasting region as arguments of :func:`.sensor_regions.vertices_of_region`; a selection becomes a group.

    Parameters
    ----------
    source : {"OWN", "SELECTION", "GROUP", "MATERIAL", "FACE_SET", "MESH"}
        OWN is the region that the object has as a sensor.
    """
    if source == "OWN":
        return sensor_regions.region_of(obj)
    chosen, region = _region(obj, source)
    if source == "SELECTION":
        _check(obj, chosen, source)
        # a new group, because another laid sensor may have another selection
        region |= {"vertex_group": _fill(obj.vertex_groups.new(name=GROUP_NAME), chosen), "threshold": 1.0}
    elif source == "GROUP":
        region["threshold"] = transforms.as_typed(obj.palpate.threshold)
    return region


def _region(obj, source: str) -> tuple[np.ndarray, dict]:
    """Return the vertices of a source, (nv,) bool, and the properties that name it; a selection has no group yet."""
    if source == "SELECTION":
        return selected_vertices(obj), {"region": "GROUP"}
    if source == "GROUP":
        group = obj.vertex_groups.active
        if group is None:
            raise SensorError(f"'{obj.name}' has no vertex group: paint one, or use the whole mesh.")
        weights = sensor_regions.vertex_weights(obj.data, group.index)
        return weights >= max(obj.palpate.threshold, 1e-6), {"region": source, "vertex_group": group.name}
    if source == "MATERIAL":
        material = obj.active_material
        if material is None:
            raise SensorError(f"'{obj.name}' has no active material: give the sensor's faces one in the Material tab.")
        faces = mesh_arrays.face_numbers(obj.data, "material_index") == obj.active_material_index
        chosen = sensor_regions.vertices_of_faces(obj.data, faces)
        return chosen, {"region": source, "material": material.name}
    if source == "FACE_SET":
        sets, active = sensor_regions.face_sets(obj.data), obj.data.polygons.active
        number = int(sets[active]) if 0 <= active < len(sets) else obj.palpate.face_set
        return sensor_regions.vertices_of_faces(obj.data, sets == number), {"region": source, "face_set": number}
    return np.ones(len(obj.data.vertices), dtype=bool), {"region": "MESH"}


def _fill(group, chosen: np.ndarray) -> str:
    """Give the chosen vertices full weight in a vertex group; return its name."""
    group.add(np.flatnonzero(chosen).tolist(), 1.0, "REPLACE")
    return group.name


def set_full_weight_brush(tools) -> None:
    """Set weight and strength of the weight brush to 1, and switch normalising against other groups off."""
    tools.use_auto_normalize = False
    paint = tools.weight_paint
    brush = paint.brush if paint is not None else None
    shared = getattr(paint, "unified_paint_settings", None) or getattr(tools, "unified_paint_settings", None)
    for part in ("weight", "strength"):  # shared by all brushes where the user has it so
        if shared is not None and getattr(shared, f"use_unified_{part}"):
            setattr(shared, part, 1.0)
        elif brush is not None:
            setattr(brush, part, 1.0)


def _check(obj, chosen: np.ndarray, source: str) -> None:
    """Raise SensorError when the chosen vertices make no sensor."""
    reason = {
        "SELECTION": "Nothing is selected",
        "GROUP": f"No vertex has a weight of {obj.palpate.threshold:g} or more in the active vertex group",
        "MATERIAL": "No face has the active material",
        "FACE_SET": "No face is in that face set",
        "MESH": "There are no vertices",
    }[source]
    if not chosen.any():
        raise SensorError(f"{reason} on '{obj.name}': a sensor needs at least one face.")
    if not any(all(chosen[vertex] for vertex in face.vertices) for face in obj.data.polygons):
        raise SensorError(
            f"The {int(chosen.sum())} chosen vertices of '{obj.name}' span no face: choose all corners of at least one face."
        )


def remove_role(scene, obj) -> None:
    """Remove an object's role and its part of a bake. Parameters and vertex groups stay."""
    if obj.palpate.is_baked:
        baked_scene.clear_object(scene, obj)
    obj.palpate.role = "NONE"


def group_to_paint(obj):
    """Return the vertex group in which a sensor's region is painted: its own, else a new, empty one."""
    settings = obj.palpate
    group = obj.vertex_groups.get(settings.vertex_group) if settings.vertex_group else None
    if group is None:
        group = obj.vertex_groups.get(GROUP_NAME) or obj.vertex_groups.new(name=GROUP_NAME)
    obj.vertex_groups.active_index = group.index
    settings.region, settings.vertex_group = "GROUP", group.name
    if settings.role == "NONE":
        settings.role = "SENSOR"
    return group
