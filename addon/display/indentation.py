# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface of a baked sensor is displaced by its baked penetration, so that the object in contact does not cut into it.

Geometry nodes subdivide the sensor's faces and move their vertices inwards. They read the penetration from an image that is
packed into the .blend, with a row for each frame, so that the surface plays in any Blender and without the files of the bake.
Between the texels the penetration is the surface of Catmull and Clark, which Blender's node for subdivision makes
(:mod:`....core.geometry.smooth_depth`). The user's mesh keeps its vertices.

What reads a scene must not take the indented surface for the sensor's shape: :func:`.mesh_arrays.evaluated_mesh` gives the mesh
without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.geometry.smooth_depth import NEIGHBOUR_WEIGHT, SHARPENINGS
from ..scene import mesh_arrays
from ..scene.display_names import INDENTATION_MODIFIER, MODIFIERS, REST_POSITION
from ..session import transforms
from . import materials
from .baked_sensor import BakedSensor

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
MOST_PIXELS = 4_000_000
"""Pixels of the image at most, 64 MB of memory; of longer bakes every second, third, … frame is kept."""


@dataclass(frozen=True)
class _Names:
    """Names of a sensor's attributes. They hold its identity, because several sensors may share a mesh."""

    uid: str

    @property
    def inward(self) -> str:
        """Vector on vertices: displacement per metre of depth, object's frame, Blender units; zero where never touched."""
        return f"palpate_inward:{self.uid}"

    @property
    def column(self) -> str:
        """Vector on vertices whose x is the image's texture coordinate u."""
        return f"palpate_column:{self.uid}"

    @property
    def channel(self) -> str:
        """Vector on vertices: one for the channel of the image that holds the vertex, zero for the other two."""
        return f"palpate_channel:{self.uid}"


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
    step = _frame_step(len(sensor.frames), int(touched.sum()))
    image = _depth_image(uid, obj.name, sensor.readings.depth[::step], touched)
    _store_attributes(obj.data, _Names(uid), sensor, touched, image.size[0])
    modifier = obj.modifiers.new(INDENTATION_MODIFIER, "NODES")
    play = _Play(image, int(sensor.frames[0]), int(sensor.frames[-1]), step)
    modifier.node_group = _nodes(uid, obj.name, play, levels_of(len(obj.data.vertices)), factor)


def clear(obj) -> None:
    """Remove the indentation of a sensor with its image, nodes and attributes."""
    if obj.type != "MESH":
        return
    modifier, uid = obj.modifiers.get(INDENTATION_MODIFIER), obj.palpate.uid
    if modifier is not None:
        obj.modifiers.remove(modifier)
    names = _Names(uid)
    for name in (names.inward, names.column, names.channel):
        attribute = obj.data.attributes.get(name)
        if attribute is not None:
            obj.data.attributes.remove(attribute)
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


@dataclass(frozen=True)
class _Play:
    """An image of depths, its first and last frame, and the frames from one of its rows to the next."""

    image: object
    first: int
    last: int
    step: int


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


def _frame_step(frames: int, texels: int) -> int:
    """Return the least distance of kept frames at which the image has no more than :data:`MOST_PIXELS`."""
    return max(1, -(-frames * -(-texels // 3) // MOST_PIXELS))


def levels_of(vertices: int) -> int:
    """Return how often the faces are subdivided; each time their number becomes fourfold."""
    return next((level for level in range(MOST_LEVELS, 0, -1) if vertices * 4**level <= MOST_VERTICES), 0)


def _depth_image(uid: str, name: str, depth: np.ndarray, touched: np.ndarray):
    """Return an image with a row for each frame and three touched texels in each of its pixels, packed into the .blend."""
    width = -(-int(touched.sum()) // 3)
    image = bpy.data.images.new(f"Palpate {name} depth", width, len(depth), alpha=False, float_buffer=True, is_data=True)
    image[materials.SENSOR_KEY] = f"{uid}:{MARK}"
    pixels = np.zeros((len(depth), width, 4), dtype=np.float32)
    pixels[..., 3] = 1.0
    (texels,) = np.nonzero(touched)
    for channel in range(3):
        chosen = texels[channel::3]
        pixels[:, : len(chosen), channel] = np.maximum(depth[:, chosen], 0.0)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def _store_attributes(mesh, names: _Names, sensor: BakedSensor, touched: np.ndarray, width: int) -> None:
    place = np.cumsum(touched) - 1
    rows = sensor.texels.vertex[touched]
    columns = {
        names.inward: -sensor.texels.normal[touched] @ np.linalg.inv(_body_from_object(sensor)).T,
        names.column: np.outer((place[touched] // 3 + 0.5) / width, (1.0, 0.0, 0.0)),
        names.channel: np.eye(3)[place[touched] % 3],
    }
    for name, values in columns.items():
        table = np.zeros((len(mesh.vertices), 3), dtype=np.float32)
        table[rows] = values
        mesh.attributes.new(name, "FLOAT_VECTOR", "POINT").data.foreach_set("vector", table.ravel())
    mesh.update()


def _body_from_object(sensor: BakedSensor) -> np.ndarray:
    """(3, 3) float, which takes the object's vectors (Blender units) to the body's frame (metres)."""
    body, own = (transforms.as_array(item.matrix_world) for item in (sensor.body, sensor.obj))
    turn = transforms.rotation(transforms.decompose(body)[1])
    return sensor.scale * turn.T @ own[:3, :3]


def _nodes(uid: str, name: str, play: _Play, levels: int, factor: float):
    """Return geometry nodes that look up each texel's depth, spread it smoothly over finer faces, and move them inwards."""
    group = materials.empty_node_group(f"{uid}:{MARK}", f"{name} indentation")
    add, names, depth_name = materials.NodeAdder(group), _Names(uid), f"palpate_depth:{uid}"
    rest = _stored(add, add("NodeGroupInput").outputs[0], REST_POSITION, _out(add, "GeometryNodeInputPosition"), "FLOAT_VECTOR")
    coarse = _stored(add, rest, depth_name, _depth(add, names, play), "FLOAT")
    fine, depth = _subdivided(add, coarse, _attribute(add, depth_name, "FLOAT"), levels)
    depth = _math(add, "MAXIMUM", depth, 0.0)
    inward = _out(add, "ShaderNodeVectorMath", {0: _attribute(add, names.inward), "Scale": depth}, operation="SCALE")
    moved = _out(add, "ShaderNodeVectorMath", {0: inward, "Scale": factor}, operation="SCALE", label=FACTOR_LABEL)
    move = _out(add, "GeometryNodeSetPosition", {"Geometry": fine, "Offset": moved})
    group.links.new(move, add("NodeGroupOutput").inputs[0])
    return group


def _subdivided(add, geometry, values, levels: int):
    """Return the sockets of a mesh whose faces are cut evenly, and of the smooth surface of values through its vertices.

    The node for subdivision smooths places and nothing else, so it is given a mesh whose places are the values. What it takes
    from them is added to them beforehand.
    """
    if not levels:
        return geometry, values
    is_large = _math(add, "GREATER_THAN", _out(add, "GeometryNodeInputMeshFaceNeighbors"), float(MOST_CORNERS))
    geometry = _out(add, "GeometryNodeTriangulate", {"Mesh": geometry, "Selection": is_large})
    sharp = values
    for _ in range(SHARPENINGS):
        blurred = {"Value": sharp, "Iterations": 1, "Weight": NEIGHBOUR_WEIGHT}
        lost = _math(add, "SUBTRACT", values, _out(add, "GeometryNodeBlurAttribute", blurred, data_type="FLOAT"))
        sharp = _math(add, "ADD", sharp, lost)
    place = _out(add, "ShaderNodeCombineXYZ", {"X": sharp})
    graph = _out(add, "GeometryNodeSetPosition", {"Geometry": geometry, "Position": place})
    smooth = _out(add, "GeometryNodeSubdivisionSurface", {"Mesh": graph, "Level": levels})
    even = _out(add, "GeometryNodeSubdivideMesh", {"Mesh": geometry, "Level": levels})
    position, index = _out(add, "GeometryNodeInputPosition"), _out(add, "GeometryNodeInputIndex")
    given = {"Geometry": smooth, "Value": position, "Index": index}
    found = _out(add, "GeometryNodeSampleIndex", given, data_type="FLOAT_VECTOR", domain="POINT")
    return even, _out(add, "ShaderNodeSeparateXYZ", {0: found})


def _depth(add, names: _Names, play: _Play):
    """Return the socket of the depth at each texel, metres, between two frames in between."""
    frame = _out(add, "GeometryNodeInputSceneTime", output="Frame")
    frame = _out(add, "ShaderNodeClamp", {"Value": frame, "Min": play.first, "Max": play.last})
    rows = play.image.size[1]
    last_row = play.first + play.step * (rows - 1)
    ends = {"From Min": play.first, "From Max": max(last_row, play.first + 1), "To Min": 0.5 / rows, "To Max": 1.0 - 0.5 / rows}
    row = _out(add, "ShaderNodeMapRange", {"Value": frame, **ends}, clamp=True)
    column = _out(add, "ShaderNodeSeparateXYZ", {0: _attribute(add, names.column)})
    given = {"Image": play.image, "Vector": _out(add, "ShaderNodeCombineXYZ", {"X": column, "Y": row})}
    color = _out(add, "GeometryNodeImageTexture", given, interpolation="Linear", extension="EXTEND")
    chosen = {0: color, 1: _attribute(add, names.channel)}
    return _out(add, "ShaderNodeVectorMath", chosen, output="Value", operation="DOT_PRODUCT")


def _out(add, kind: str, given: dict | None = None, output: int | str = 0, **settings):
    """Return an output of a new node; `given` are the sockets that lead to its inputs, or their values."""
    node = add(kind, **settings)
    for place, value in (given or {}).items():
        if isinstance(value, bpy.types.NodeSocket):
            add.tree.links.new(value, node.inputs[place])
        else:
            node.inputs[place].default_value = value
    return node.outputs[output]


def _math(add, operation: str, first, second):
    return _out(add, "ShaderNodeMath", {0: first, 1: second}, operation=operation)


def _stored(add, geometry, name: str, value, data_type: str):
    """Return the socket of a geometry with an attribute on its points."""
    given = {"Geometry": geometry, "Name": name, "Value": value}
    return _out(add, "GeometryNodeStoreNamedAttribute", given, data_type=data_type, domain="POINT")


def _attribute(add, name: str, data_type: str = "FLOAT_VECTOR"):
    """Return the socket of a named attribute."""
    return _out(add, "GeometryNodeInputNamedAttribute", {"Name": name}, data_type=data_type)
