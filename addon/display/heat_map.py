# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat map on the faces of a sensor's region: UV map, vertex attributes, material slot, and their removal."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.figures.quantities import Scale
from ...core.geometry.texels import Texels
from ...core.geometry.texture_maps import UVLayout
from ..scene import mesh_arrays, stored_names
from ..scene.stored_names import HEAT_MAP_MODIFIER, OLD_MATERIAL, UV_MAP
from . import materials, played_table
from .baked_sensor import BakedSensor

EMPTY_SLOT = "palpate_empty_slot"
"""Custom property of a mesh that had no material slot before."""


def apply(sensor: BakedSensor, image, scale: Scale) -> None:
    """Show a quantity of a bake on its sensor; it replaces the heat map of an earlier bake.

    Parameters
    ----------
    sensor : BakedSensor
    image : Image
        From :func:`.materials.load_sequence`.
    scale : Scale
    """
    obj, texels = sensor.obj, sensor.texels
    clear(obj, keep_image=True)
    if not scale.quantity.is_in(sensor.readings):
        return
    uid, mesh, layout = obj.palpate.uid, obj.data, texels.layout
    frames = int(sensor.frames[0]), int(sensor.frames[-1])
    is_in_image = scale.quantity.channel == materials.IMAGE_CHANNEL
    user_map = is_in_image and isinstance(layout, UVLayout) and layout.map_name
    uv = None if user_map else _one_uv_per_texel(texels)
    coordinates, smooth = (user_map, not layout.nearest) if user_map else (UV_MAP, False)
    if uv is not None and is_in_image:
        _write_uv(mesh, texels, uv)
    elif not user_map:
        attribute = materials.attribute_of(scale.quantity)
        group = materials.empty_node_group(uid, obj.name)
        add = materials.NodeAdder(group)
        start = add("NodeGroupInput")
        if uv is not None:
            pictures = _pictures(sensor, scale)
            column, _ = _table_attributes(uid)
            mesh_arrays.store(mesh, column, np.column_stack([uv, np.zeros(len(uv))]), texels.vertex)
            value = pictures.place(add, add.attribute(column))
            image, coordinates = pictures.image, attribute
        elif is_in_image:
            mesh_arrays.store(mesh, materials.TEXEL_UV, np.column_stack([layout.uv(), np.zeros(len(texels))]), texels.vertex)
            color = materials.add_image_lookup(add, image, frames)
            value, image = add("FunctionNodeSeparateColor", {"Color": color}, materials.IMAGE_OUTPUT), None
        else:
            value, image = _table(sensor, scale).lookup(add), None
        shown = add.stored(start, attribute, value, "FLOAT" if image is None else "FLOAT_VECTOR")
        add.end("NodeGroupOutput", {0: shown})
        modifier = obj.modifiers.new(HEAT_MAP_MODIFIER, "NODES")
        modifier.node_group = group
        obj.modifiers.move(len(obj.modifiers) - 1, 0)  # before modifiers that would change the vertices
    material = materials.heat_map_material(uid, obj.name, image, frames, scale, coordinates, smooth)
    _assign(obj, texels, material)


def _table(sensor: BakedSensor, scale: Scale) -> played_table.PlayedTable:
    """Return a table of what a scale shows of a sensor."""
    obj, texels = sensor.obj, sensor.texels
    rows = scale.values(
        sensor.readings.part(slice(None, None, played_table.frame_step(len(sensor.frames), len(texels)))), texels
    )
    attributes = _table_attributes(obj.palpate.uid)
    return played_table.PlayedTable.packed(*_names(obj, scale), obj.data, texels.vertex, rows, sensor.frames, attributes)


def _pictures(sensor: BakedSensor, scale: Scale) -> played_table.PlayedPictures:
    """Return the tactile images of what a scale shows of a sensor."""
    texels, layout = sensor.texels, sensor.texels.layout
    step = played_table.frame_step(len(sensor.frames), 3 * layout.shape[0] * layout.shape[1])
    rows = scale.values(sensor.readings.part(slice(None, None, step)), texels)
    pictures = np.moveaxis(layout.image(rows.T), -1, 0)
    return played_table.PlayedPictures.packed(*_names(sensor.obj, scale), pictures, sensor.frames, step)


def _names(obj, scale: Scale) -> tuple[str, str]:
    """Return the mark and the name of the image of a sensor's values."""
    return f"{obj.palpate.uid}:{materials.TABLE}", f"Palpate {obj.name} {scale.quantity.name}"


def _table_attributes(uid: str) -> tuple[str, str]:
    """Return the names of a table's attributes. They hold the sensor's identity, because several sensors may share a mesh."""
    return f"palpate_value_column:{uid}", f"palpate_value_channel:{uid}"


def clear(obj, keep_image: bool = False) -> None:
    """Remove the heat map of a sensor: its faces get their materials back, and nothing of the heat map remains."""
    if obj.type != "MESH":
        return
    mesh, uid = obj.data, obj.palpate.uid
    _unassign(obj)
    modifier = obj.modifiers.get(HEAT_MAP_MODIFIER)
    if modifier is not None:
        obj.modifiers.remove(modifier)
    names = _table_attributes(uid)
    if _slot_of(mesh) is None:
        names += materials.TEXEL_UV, stored_names.FORCE, "palpate_area"  # the last one of Palpate 0.1.0
        layer = mesh.uv_layers.get(UV_MAP)
        if layer is not None:
            mesh.uv_layers.remove(layer)
    mesh_arrays.remove_attributes(mesh, names)
    materials.remove_blocks(uid, keep_image)


def _one_uv_per_texel(texels: Texels) -> np.ndarray | None:
    """(n, 2) UV coordinates of the texels; None if a texel has different ones in different triangles."""
    layout = texels.layout
    uv = layout.uv()
    return uv if np.allclose(layout.corner_uv, uv[layout.triangles], atol=1e-9) else None


def _write_uv(mesh, texels: Texels, uv: np.ndarray) -> None:
    layer = mesh.uv_layers.get(UV_MAP)
    if layer is None:
        active = mesh.uv_layers.active_index
        layer = mesh.uv_layers.new(name=UV_MAP, do_init=False)
        if active >= 0:
            mesh.uv_layers.active_index = active
    table = np.zeros((len(mesh.vertices), 2))
    table[texels.vertex] = uv
    corner = mesh_arrays.corner_vertices(mesh)
    layer.data.foreach_set("uv", table[corner].astype(np.float32).ravel())


def region_faces(mesh, texels: Texels) -> np.ndarray:
    """(nf,) bool: faces whose corners are all texels."""
    inside = np.zeros(len(mesh.vertices), dtype=bool)
    inside[texels.vertex] = True
    return np.logical_and.reduceat(inside[mesh_arrays.corner_vertices(mesh)], mesh_arrays.face_numbers(mesh, "loop_start"))


def _assign(obj, texels: Texels, material) -> None:
    """Assign the material to the region's faces, in a slot of the object, because its mesh may have other users."""
    mesh = obj.data
    index = mesh_arrays.face_numbers(mesh, "material_index")
    faces = region_faces(mesh, texels)
    old = mesh.attributes.get(OLD_MATERIAL)
    if old is None:
        if not len(mesh.materials):
            mesh.materials.append(None)  # faces outside the region continue to have no material
            mesh[EMPTY_SLOT] = 1
        mesh.materials.append(None)
        slot = len(mesh.materials) - 1
        old = mesh.attributes.new(OLD_MATERIAL, "INT", "FACE")
        old.data.foreach_set("value", np.where(faces, index, -1).astype(np.int32))
        mesh.polygons.foreach_set("material_index", np.where(faces, slot, index).astype(np.int32))
        mesh.update()
    else:  # another object with this mesh already shows a heat map in this slot
        slot = _slot_of(mesh)
        if slot is None:  # it showed that of its original, whose new bake has removed it; the faces still point at the slot
            slot = int(np.bincount(index[faces]).argmax())
    obj.material_slots[slot].link = "OBJECT"
    obj.material_slots[slot].material = material


def _shown_slot(obj) -> int | None:
    """Return the index of the slot in which an object shows its heat map; None if it shows none.

    The slot is found by the custom property of the material, since the user may have changed slots and faces.
    """
    for number, slot in enumerate(obj.material_slots):
        if slot.link == "OBJECT" and slot.material is not None and materials.SENSOR_KEY in slot.material:
            return number
    return None


def _slot_of(mesh) -> int | None:
    """Return the index of the heat maps' slot on a mesh; None if no object with this mesh shows one."""
    shown = (_shown_slot(obj) for obj in bpy.data.objects if obj.data == mesh)
    return next((slot for slot in shown if slot is not None), None)


def _unassign(obj) -> None:
    """Give the faces their materials back, except faces to which the user has assigned another one since."""
    mesh = obj.data
    attribute, slot = mesh.attributes.get(OLD_MATERIAL), _slot_of(mesh)
    if attribute is None and slot is None:
        return
    if _shown_slot(obj) is not None:
        obj.material_slots[slot].material = None
        obj.material_slots[slot].link = "DATA"
    if _slot_of(mesh) is not None:
        return
    index = mesh_arrays.face_numbers(mesh, "material_index")
    old = np.zeros_like(index)
    if attribute is not None:  # Remesh and similar tools remove the attribute
        attribute.data.foreach_get("value", old)
        mesh.attributes.remove(attribute)
    if slot is not None:
        index = np.where((old >= 0) & (index == slot), old, index).astype(np.int32)
        mesh.polygons.foreach_set("material_index", index)
        mesh.materials.pop(index=slot)  # Blender also corrects the indices of the following slots on the faces
    if EMPTY_SLOT in mesh:
        del mesh[EMPTY_SLOT]
        if not any(mesh.materials):
            mesh.materials.clear()
    if not index.any() and "material_index" in mesh.attributes:  # a missing attribute means index zero everywhere
        mesh.attributes.remove(mesh.attributes["material_index"])
    mesh.update()
