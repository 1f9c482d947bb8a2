# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface of a baked sensor is displaced by its baked penetration, so that the object in contact does not cut into it.

Geometry nodes subdivide the sensor's faces and move their vertices inwards. They read the penetration from an image that is
packed into the .blend, with a row for each frame, so that the surface plays in any Blender and without the files of the bake.
Between the texels the penetration is the surface of Catmull and Clark, which Blender's node for subdivision makes
(:mod:`....core.geometry.grid_layout`). The user's mesh keeps its vertices.

What reads a scene must not take the indented surface for the sensor's shape: :func:`.mesh_arrays.evaluated_mesh` gives the mesh
without it.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ...core.geometry.grid_layout import NEIGHBOUR_WEIGHT, SHARPENINGS
from ..scene import mesh_arrays
from ..scene.stored_names import INDENTATION_MODIFIER, MODIFIERS, REST_POSITION
from ..session import transforms
from . import materials, played_table
from .baked_sensor import BakedSensor
from .played_table import PlayedTable

MARK = "indentation"
"""What follows the sensor's identity in the marks of the image and the node group."""
FACTOR_LABEL = "Displacement / penetration"
"""Label of the node that holds the factor."""
MOST_VERTICES = 12_000
"""Vertices of a subdivided sensor at most; Blender 4.5 takes about 35 ms per frame for half as many on a busy core."""
MOST_LEVELS = 3
"""A cell of a coarse grid becomes 8 × 8 faces, on which the outline of a ball looks round."""
MOST_CORNERS = 8
"""Corners of a face that is subdivided as it is; larger ones are cut into triangles first. The sample "gel" has a face with 160
corners below: Blender 4.5 subdivides it in 4 s per frame, and its triangles in 0.05 s."""


def _attributes(uid: str) -> tuple[str, str, str]:
    """Return the names of a sensor's attributes. They hold its identity, because several sensors may share a mesh.

    The first is a vector on vertices: displacement per metre of depth, object's frame, Blender units; zero where never touched.
    The others are those of :class:`.PlayedTable`.
    """
    return f"palpate_inward:{uid}", f"palpate_column:{uid}", f"palpate_channel:{uid}"


def show(sensors: Sequence[BakedSensor], factor: float | None) -> None:
    """Let the surfaces of sensors follow their bakes; it replaces their earlier indentation.

    Nothing is done where nothing ever touched the sensor, where modifiers change the number of its vertices, and where it is
    laid onto the surface of another object, below which it would disappear.

    Parameters
    ----------
    sensors : sequence of BakedSensor
    factor : float, optional
        Displacement over penetration; without it, indentation is only removed.
    """
    for sensor in sensors:
        clear(sensor.obj)
    if factor is None:
        return
    touched = [_touched(sensor) for sensor in sensors]
    # asked for all of them before the first is changed: Blender evaluates the scene again after a change
    depsgraph = bpy.context.evaluated_depsgraph_get()
    follows = [own.any() and may_indent(sensor.obj, depsgraph) for sensor, own in zip(sensors, touched, strict=True)]
    for sensor, own, is_indented in zip(sensors, touched, follows, strict=True):
        if is_indented:
            _apply(sensor, own, factor)


def _apply(sensor: BakedSensor, touched: np.ndarray, factor: float) -> None:
    obj, uid = sensor.obj, sensor.obj.palpate.uid
    vertices, mark = sensor.texels.vertex[touched], f"{uid}:{MARK}"
    inward_name, *attributes = _attributes(uid)
    inward = -sensor.texels.normal[touched] @ np.linalg.inv(_body_from_object(sensor)).T
    mesh_arrays.store(obj.data, inward_name, inward, vertices)
    step = played_table.frame_step(len(sensor.frames), len(vertices))
    depth = np.maximum(sensor.readings.depth[::step][:, touched], 0.0)
    play = PlayedTable.packed(mark, f"Palpate {obj.name} depth", obj.data, vertices, depth, sensor.frames, attributes)
    obj.data.update()
    modifier = obj.modifiers.new(INDENTATION_MODIFIER, "NODES")
    modifier.node_group = _nodes(uid, obj.name, play, levels_of(len(obj.data.vertices)), factor)


def clear(obj) -> None:
    """Remove the indentation of a sensor with its image, nodes and attributes."""
    if obj.type != "MESH":
        return
    modifier, uid = obj.modifiers.get(INDENTATION_MODIFIER), obj.palpate.uid
    if modifier is not None:
        obj.modifiers.remove(modifier)
    mesh_arrays.remove_attributes(obj.data, _attributes(uid))
    for blocks in (bpy.data.node_groups, bpy.data.images):
        block = materials.find_block(blocks, f"{uid}:{MARK}")
        if block is not None:
            blocks.remove(block)


def factor_of(obj) -> float:
    """Return the displacement of an object's surface over its penetration; zero for an object that is not indented, or None."""
    modifier = None if obj is None else obj.modifiers.get(INDENTATION_MODIFIER)
    if modifier is None or not modifier.show_viewport or modifier.node_group is None:
        return 0.0
    node = next((node for node in modifier.node_group.nodes if node.label == FACTOR_LABEL), None)
    return 0.0 if node is None else node.inputs["Scale"].default_value


def _touched(sensor: BakedSensor) -> np.ndarray:
    """(n,) bool: texels with any penetration; a long recording is read in parts."""
    depth = sensor.readings.depth
    found = np.zeros(depth.shape[1], dtype=bool)
    for start in range(0, len(depth), 1000):
        found |= (depth[start : start + 1000] > 0.0).any(axis=0)
    return found


def may_indent(obj, depsgraph) -> bool:
    """Return True for a sensor with a surface of its own whose modifiers leave the number of its vertices as it is."""
    if obj.palpate.skin.method != "NONE":
        return False
    if all(modifier.name in MODIFIERS for modifier in obj.modifiers):
        return True
    with mesh_arrays.evaluated_mesh(obj, depsgraph) as mesh:
        return len(mesh.vertices) == len(obj.data.vertices)


def levels_of(vertices: int) -> int:
    """Return how often the faces are subdivided; each time their number becomes fourfold."""
    return next((level for level in range(MOST_LEVELS, 0, -1) if vertices * 4**level <= MOST_VERTICES), 0)


def _body_from_object(sensor: BakedSensor) -> np.ndarray:
    """(3, 3) float, which takes the object's vectors (Blender units) to the body's frame (metres)."""
    body, own = (transforms.as_array(item.matrix_world) for item in (sensor.body, sensor.obj))
    turn = transforms.rotation(transforms.decompose(body)[1])
    return sensor.scale * turn.T @ own[:3, :3]


def _nodes(uid: str, name: str, play: PlayedTable, levels: int, factor: float):
    """Return geometry nodes that look up each texel's depth, spread it smoothly over finer faces, and move them inwards."""
    group = materials.empty_node_group(f"{uid}:{MARK}", f"{name} indentation")
    add, depth_name = materials.NodeAdder(group), f"palpate_depth:{uid}"
    rest = add.stored(add("NodeGroupInput"), REST_POSITION, add("GeometryNodeInputPosition"), "FLOAT_VECTOR")
    coarse = add.stored(rest, depth_name, play.lookup(add), "FLOAT")
    fine, depth = _subdivided(add, coarse, add.attribute(depth_name, "FLOAT"), levels)
    depth = add.math("MAXIMUM", depth, 0.0)
    inward = add.vector("SCALE", add.attribute(_attributes(uid)[0]), Scale=depth)
    moved = add("ShaderNodeVectorMath", {0: inward, "Scale": factor}, operation="SCALE", label=FACTOR_LABEL)
    move = add("GeometryNodeSetPosition", {"Geometry": fine, "Offset": moved})
    add.end("NodeGroupOutput", {0: move})
    return group


def _subdivided(add, geometry, values, levels: int):
    """Return the sockets of a mesh whose faces are cut evenly, and of the smooth surface of values through its vertices.

    The node for subdivision smooths places and nothing else, so it is given a mesh whose places are the values. What it takes
    from them is added to them beforehand.
    """
    if not levels:
        return geometry, values
    is_large = add.math("GREATER_THAN", add("GeometryNodeInputMeshFaceNeighbors"), float(MOST_CORNERS))
    geometry = add("GeometryNodeTriangulate", {"Mesh": geometry, "Selection": is_large})
    sharp = values
    for _ in range(SHARPENINGS):
        blurred = {"Value": sharp, "Iterations": 1, "Weight": NEIGHBOUR_WEIGHT}
        lost = add.math("SUBTRACT", values, add("GeometryNodeBlurAttribute", blurred, data_type="FLOAT"))
        sharp = add.math("ADD", sharp, lost)
    place = add("ShaderNodeCombineXYZ", {"X": sharp})
    graph = add("GeometryNodeSetPosition", {"Geometry": geometry, "Position": place})
    smooth = add("GeometryNodeSubdivisionSurface", {"Mesh": graph, "Level": levels})
    even = add("GeometryNodeSubdivideMesh", {"Mesh": geometry, "Level": levels})
    position, index = add("GeometryNodeInputPosition"), add("GeometryNodeInputIndex")
    given = {"Geometry": smooth, "Value": position, "Index": index}
    found = add("GeometryNodeSampleIndex", given, data_type="FLOAT_VECTOR", domain="POINT")
    return even, add("ShaderNodeSeparateXYZ", {0: found})
