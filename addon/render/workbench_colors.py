# SPDX-License-Identifier: GPL-3.0-or-later
"""Heat maps for Workbench, which ignores the nodes of materials: vertex colours on copies of the meshes while it renders.

Workbench draws vertex colours opaque. A transparent object gets no vertex colours, so that Workbench draws it in the object's
colour, which may be transparent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ...core.figures import color_maps
from ...core.figures.figure_style import FigureStyle
from ...core.geometry.texels import Texels
from ...core.io.bake_reader import Bake, frame_index
from ..display import heat_map, materials
from ..scene import mesh_arrays

COLOR_ATTRIBUTE = "Palpate Colour"
DEFAULT_COLOR = (0.8, 0.8, 0.8, 1.0)
"""Colour of faces without material, scene-linear."""
TRANSPARENT_NODES = {"BSDF_TRANSPARENT", "BSDF_GLASS", "BSDF_REFRACTION"}
GLASS_OPACITY = 0.12
"""Opacity with which Workbench draws glass."""


@contextmanager
def workbench_colors(folders: dict, bake: Bake, style: FigureStyle) -> Iterator[Callable[[int], None]]:
    """Show sensors in heat-map colours and everything else in the viewport colours of its materials, then restore them.

    Parameters
    ----------
    folders : dict of Object to Path
        Folder of each sensor's bake.
    bake : Bake
    style : FigureStyle

    Yields
    ------
    callable
        Shows the frame whose number it is given.
    """
    names = {folder: name for name, folder in bake.folders.items()}
    sensors = {obj: names[folder] for obj, folder in folders.items() if folder in names}
    meshes_shown = [obj for obj in bpy.context.scene.objects if obj.type == "MESH" and len(obj.data.polygons)]
    before = {obj: (obj.data, tuple(obj.color)) for obj in meshes_shown}
    scale = style.scale(bake.recording, bake.texels)
    try:
        plain = {obj: _in_material_colours(obj) for obj in meshes_shown}
        regions = {obj: _corners_of_region(obj.data, bake.texels[name]) for obj, name in sensors.items()}

        def show(number: int) -> None:
            index = frame_index(bake.recording, number)
            for obj, name in sensors.items():
                texels = bake.texels[name]
                values = scale.values(bake.recording.sensors[name].at(index), texels)
                corners, texel = regions[obj]
                table = plain[obj].copy()
                table[corners, :3] = color_maps.linear(scale.colors(values))[texel]
                obj.data.attributes[COLOR_ATTRIBUTE].data.foreach_set("color", table.ravel())
                obj.data.update_tag()

        yield show
    finally:
        for obj, (mesh, color) in before.items():
            copy, obj.data, obj.color = obj.data, mesh, color
            if copy != mesh:
                bpy.data.meshes.remove(copy)


def _in_material_colours(obj) -> np.ndarray:
    """Give an object a copy of its mesh with a colour at each corner; return the colours, (nc, 4) float32."""
    obj.data = mesh = obj.data.copy()
    sides, material = (mesh_arrays.face_numbers(mesh, name) for name in ("loop_total", "material_index"))
    slots = [DEFAULT_COLOR if slot.material is None else tuple(slot.material.diffuse_color) for slot in obj.material_slots] or [
        DEFAULT_COLOR
    ]
    table = np.array(slots, dtype=np.float32)[np.clip(np.repeat(material, sides), 0, len(slots) - 1)]
    table[:, 3] = 1.0
    opacity = min(map(_opacity, obj.data.materials), default=1.0)
    if opacity < 1.0:
        for attribute in list(mesh.color_attributes):
            mesh.color_attributes.remove(attribute)
        obj.color = (*table[:, :3].mean(axis=0), opacity)
        return table
    attribute = mesh.attributes.new(COLOR_ATTRIBUTE, "FLOAT_COLOR", "CORNER")
    attribute.data.foreach_set("color", table.ravel())
    mesh.attributes.active_color_name = attribute.name
    mesh.attributes.render_color_index = mesh.color_attributes.find(attribute.name)
    return table


def _opacity(material) -> float:
    """Return 1 for an opaque material and less for glass and other transparent ones."""
    if material is None or materials.SENSOR_KEY in material:
        return 1.0
    found = [material.diffuse_color[3]]
    for node in material.node_tree.nodes if material.node_tree else ():
        if node.type in TRANSPARENT_NODES:
            found.append(GLASS_OPACITY)
        elif node.type == "BSDF_PRINCIPLED":
            alpha, clear = node.inputs["Alpha"], node.inputs["Transmission Weight"]
            found.append(1.0 if alpha.is_linked else max(alpha.default_value, 0.05))
            found.append(1.0 - (1.0 - GLASS_OPACITY) * (0.0 if clear.is_linked else clear.default_value))
    return min(found)


def _corners_of_region(mesh, texels: Texels) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the faces in a sensor's region, and the texel at each of these corners."""
    corner, sides = mesh_arrays.corner_vertices(mesh), mesh_arrays.face_numbers(mesh, "loop_total")
    number = np.full(len(mesh.vertices), -1)
    number[texels.vertex] = np.arange(len(texels))
    (chosen,) = np.nonzero(np.repeat(heat_map.region_faces(mesh, texels), sides))
    return chosen, number[corner[chosen]]
