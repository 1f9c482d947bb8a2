# SPDX-License-Identifier: GPL-3.0-or-later
"""Heat maps for Workbench, which draws no materials' nodes: colours of vertices, on copies of the meshes, while it renders."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ..core import colormaps
from ..core.bakes import Bake, frame_index
from ..core.figures import Look
from ..core.texels import Texels
from . import heatmap, meshes

NAME = "Palpate Colour"
PLAIN = (0.8, 0.8, 0.8, 1.0)
"""Linear colour of what has no material."""


@contextmanager
def painted(places: dict, bake: Bake, look: Look) -> Iterator[Callable[[int], None]]:
    """Put sensors in colours and everything else in its materials' viewport colours, and take them off again.

    Parameters
    ----------
    places : dict of Object to Path
        Folder of each sensor's bake.
    bake : Bake
    look : Look

    Yields
    ------
    function
        That shows a frame, by its number.
    """
    names = {place: name for name, place in bake.folders.items()}
    worn = {obj: names[place] for obj, place in places.items() if place in names}
    before = {obj: obj.data for obj in bpy.context.scene.objects if obj.type == "MESH" and len(obj.data.polygons)}
    top = look.top(bake.recording, bake.texels)
    try:
        plain = {obj: _in_material_colours(obj) for obj in before}
        looks = {obj: _corners_of_region(obj.data, bake.texels[name]) for obj, name in worn.items()}

        def show(number: int) -> None:
            index = frame_index(bake.recording, number)
            for obj, name in worn.items():
                texels = bake.texels[name]
                values = look.values(bake.recording.sensors[name].at(index), texels)
                corners, texel = looks[obj]
                table = plain[obj].copy()
                table[corners, :3] = colormaps.linear(colormaps.colors(look.colour_map, values / top))[texel]
                obj.data.attributes[NAME].data.foreach_set("color", table.ravel())
                obj.data.update_tag()

        yield show
    finally:
        for obj, mesh in before.items():
            copy, obj.data = obj.data, mesh
            if copy != mesh:
                bpy.data.meshes.remove(copy)


def _in_material_colours(obj) -> np.ndarray:
    """Give an object a mesh of its own with a colour at each corner; returns these, (nc, 4) float32."""
    obj.data = mesh = obj.data.copy()
    sides, material = np.empty(len(mesh.polygons), dtype=np.int32), np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", sides)
    mesh.polygons.foreach_get("material_index", material)
    slots = [PLAIN if slot.material is None else tuple(slot.material.diffuse_color) for slot in obj.material_slots] or [PLAIN]
    table = np.array(slots, dtype=np.float32)[np.clip(np.repeat(material, sides), 0, len(slots) - 1)]
    table[:, 3] = 1.0
    attribute = mesh.attributes.new(NAME, "FLOAT_COLOR", "CORNER")
    attribute.data.foreach_set("color", table.ravel())
    mesh.attributes.active_color_name = attribute.name
    mesh.attributes.render_color_index = mesh.color_attributes.find(attribute.name)
    return table


def _corners_of_region(mesh, texels: Texels) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the faces that a sensor's texels span, and the texel of each."""
    corner, sides = meshes.corners(mesh), np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", sides)
    number = np.full(len(mesh.vertices), -1)
    number[texels.vertex] = np.arange(len(texels))
    (chosen,) = np.nonzero(np.repeat(heatmap.region_faces(mesh, texels), sides))
    return chosen, number[corner[chosen]]
