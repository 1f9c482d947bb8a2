# SPDX-License-Identifier: GPL-3.0-or-later
"""Bind the texels of a laid sensor to a surface that changes its shape, and transfer painted values to new texels.

Each texel is bound to the nearest triangle of the surface: to a point in the triangle, plus an offset along the triangle's
first edge, across this edge, and along the normal. Geometry nodes move the texels, so that the 3D view shows what is computed,
also in a Blender without Palpate.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree
from mathutils.interpolate import poly_3d_calc

from ..display import materials
from ..properties import parameter_properties
from ..scene import deforming_objects, mesh_arrays, participants, scene_fingerprint, sensor_regions
from ..session import transforms

MODIFIER = NODES = "Palpate Cling"
"""Name of the modifier and of its node group; stored in .blend files."""
CORNER_ATTRIBUTES = ("palpate_corner_a", "palpate_corner_b", "palpate_corner_c")
WEIGHTS, OFFSET = "palpate_shares", "palpate_offset"
"""Attributes of the texels: the triangle's vertices, barycentric coordinates of a point in it, and the offset from that."""


def is_needed(carrier) -> bool:
    """Return True when a surface may change its shape other than by its scale, which its children follow anyway."""
    if not deforming_objects.may_deform(carrier):
        return False
    data, moved_by = carrier.data, carrier.parent_type in {"ARMATURE", "LATTICE"}
    keys = getattr(data, "shape_keys", None) is not None
    without_scale = bool(carrier.modifiers) or keys or data.animation_data is not None or moved_by
    return without_scale or not deforming_objects.has_animated_scale(carrier)


def is_bound(sensor) -> bool:
    """Return True when the texels of a laid sensor are bound to its carrier."""
    modifier = sensor.modifiers.get(MODIFIER)
    return modifier is not None and modifier.node_group is not None and sensor.parent in scene_fingerprint.node_inputs(modifier)


def bind(context, sensor, carrier) -> None:
    """Bind the texels of a laid sensor to its carrier in their present shapes, if the carrier's shape may change."""
    modifier = sensor.modifiers.get(MODIFIER)
    if modifier is not None:
        sensor.modifiers.remove(modifier)
    mesh_arrays.remove_attributes(sensor.data, (*CORNER_ATTRIBUTES, WEIGHTS, OFFSET))
    if is_needed(carrier):
        _store_bound_positions(context, sensor, carrier)
        modifier = sensor.modifiers.new(MODIFIER, "NODES")
        modifier.node_group = bpy.data.node_groups.get(NODES) or _binding_nodes()
        _set_surface(modifier, carrier)
        modifier.show_expanded = False
        sensor.update_tag()


def _set_surface(modifier, carrier) -> None:
    """Set the surface of the nodes. Blender 5.2 and later has properties for inputs, older versions custom properties."""
    items = modifier.node_group.interface.items_tree
    key = next(item.identifier for item in items if item.in_out == "INPUT" and item.socket_type == "NodeSocketObject")
    if hasattr(modifier, "properties"):
        getattr(modifier.properties.inputs, key).value = carrier
    else:
        modifier[key] = carrier


def _store_bound_positions(context, sensor, carrier) -> None:
    """Store, in attributes of the texels, where each of them is on the surface."""
    arrays, _ = mesh_arrays.sensor_arrays(carrier, participants.depsgraph_of(context.scene))
    to_carrier = np.linalg.inv(transforms.as_array(carrier.matrix_world)) @ transforms.as_array(sensor.matrix_world)
    points = mesh_arrays.vertices(sensor.data) @ to_carrier[:3, :3].T + to_carrier[:3, 3]
    surface = PaintedMesh(arrays.vertices, arrays.triangles.tolist(), {}, {})
    corners, weights = (np.array(part) for part in zip(*_nearest_points(surface, points), strict=True))
    a, b, c = (arrays.vertices[corners[:, i]] for i in range(3))
    foot = np.einsum("nk,nkj->nj", weights, np.stack([a, b, c], axis=1))
    along = _unit(b - a)
    normal = _unit(np.cross(b - a, c - a))
    axes = np.stack([along, np.cross(normal, along), normal], axis=1)
    offset = np.einsum("nij,nj->ni", axes, points - foot)
    for name, values in zip(CORNER_ATTRIBUTES, corners.T, strict=True):
        mesh_arrays.store(sensor.data, name, values, kind="INT")
    for name, table in ((WEIGHTS, weights), (OFFSET, offset)):
        mesh_arrays.store(sensor.data, name, table)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _binding_nodes():
    """Return new geometry nodes that move points to where :func:`_store_bound_positions` has bound them."""
    tree = bpy.data.node_groups.new(NODES, "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Surface", in_out="INPUT", socket_type="NodeSocketObject")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    add = materials.NodeAdder(tree)
    given = add.end("NodeGroupInput").outputs
    surface = add("GeometryNodeObjectInfo", {"Object": given["Surface"]}, "Geometry", transform_space="RELATIVE")
    where = {"Geometry": surface, "Value": add("GeometryNodeInputPosition")}
    corners = [
        add("GeometryNodeSampleIndex", {**where, "Index": add.attribute(name, "INT")}, data_type="FLOAT_VECTOR", domain="POINT")
        for name in CORNER_ATTRIBUTES
    ]
    placed = {"Geometry": given["Geometry"], "Position": _bound_position(add, *corners)}
    add.end("NodeGroupOutput", {0: add("GeometryNodeSetPosition", placed)})
    return tree


def _bound_position(add: materials.NodeAdder, a, b, c):
    """Return the socket of a texel's position: weighted corners of its triangle, plus the offset along the triangle's axes."""
    edge, other = add.vector("SUBTRACT", b, a), add.vector("SUBTRACT", c, a)
    along, normal = add.vector("NORMALIZE", edge), add.vector("NORMALIZE", add.vector("CROSS_PRODUCT", edge, other))
    axes = (along, add.vector("CROSS_PRODUCT", normal, along), normal)
    weights, offset = (add.end("ShaderNodeSeparateXYZ", {0: add.attribute(name)}).outputs for name in (WEIGHTS, OFFSET))
    total = None
    for source, factor in zip((a, b, c, *axes), (*weights, *offset), strict=True):
        scaled = add.vector("SCALE", source, Scale=factor)
        total = scaled if total is None else add.vector("ADD", total, scaled)
    return total


@dataclass(frozen=True)
class PaintedMesh:
    """A mesh and the values that are painted on it.

    Attributes
    ----------
    vertices : (n, 3) float
    faces : list of list of int
    groups, attributes : dict of str to (n,) float
        Weights of vertex groups, and values of float attributes, by name.
    """

    vertices: np.ndarray
    faces: list[list[int]]
    groups: dict[str, np.ndarray]
    attributes: dict[str, np.ndarray]


def painted_values(sensor) -> PaintedMesh:
    """Return the painted values of a laid sensor, with its mesh."""
    mesh = sensor.data
    return PaintedMesh(
        mesh_arrays.vertices(mesh),
        [list(face.vertices) for face in mesh.polygons],
        {group.name: sensor_regions.vertex_weights(mesh, group.index) for group in sensor.vertex_groups},
        {item.name: transforms.values_of(item.data, "value") for item in mesh.attributes if parameter_properties.is_map(item)},
    )


def transfer_painted_values(sensor, before: PaintedMesh) -> None:
    """Paint the new mesh of a laid sensor: each vertex gets the values of the nearest point on the mesh before."""
    found = _nearest_points(before, mesh_arrays.vertices(sensor.data))

    def interpolated(values: np.ndarray) -> np.ndarray:
        return np.array([values[corners] @ weights for corners, weights in found], dtype=np.float32)

    sensor.vertex_groups.clear()
    for name, values in before.groups.items():
        group = sensor.vertex_groups.new(name=name)
        for vertex, weight in enumerate(interpolated(values).tolist()):
            if weight > 1e-6:
                group.add([vertex], weight, "REPLACE")
    for name, values in before.attributes.items():
        mesh_arrays.store(sensor.data, name, interpolated(values), kind="FLOAT")


def _nearest_points(mesh: PaintedMesh, points: np.ndarray) -> list[tuple[list[int], np.ndarray]]:
    """Return, for each point, the corners of the nearest face and the weights that give the nearest point on it."""
    tree = BVHTree.FromPolygons(mesh.vertices.tolist(), mesh.faces)
    result = []
    for point in points:
        nearest, _, index, _ = tree.find_nearest(Vector(point))
        face = mesh.faces[index]
        result.append((face, np.array(poly_3d_calc([Vector(mesh.vertices[i]) for i in face], nearest))))
    return result
