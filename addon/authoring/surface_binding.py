# SPDX-License-Identifier: GPL-3.0-or-later
"""Laid texels go with a surface that changes its shape, and keep what was painted on them when they are laid anew.

Each is bound to the triangle under it: to a place in it, and to an offset along its edge, across that and along its normal.
Geometry nodes put it there, so that the 3D view shows what is computed and no add-on is needed to see it.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree
from mathutils.interpolate import poly_3d_calc

from ..properties import painted_maps
from ..scene import deforming_objects, mesh_arrays, participants, sensor_regions
from ..session import transforms

MODIFIER = NODES = "Palpate Cling"
CORNERS = ("palpate_corner_a", "palpate_corner_b", "palpate_corner_c")
SHARES, OFFSET = "palpate_shares", "palpate_offset"
"""Attributes of the texels: vertices of the surface, their shares in the place, and what is from there to the texel."""


def is_needed(carrier) -> bool:
    """Whether the surface may change its shape by itself; its scale reaches a child anyway."""
    return deforming_objects.may_deform(carrier) and not (
        deforming_objects.has_animated_scale(carrier) and not _has_own_cause(carrier)
    )


def _has_own_cause(carrier) -> bool:
    data = carrier.data
    keys = getattr(data, "shape_keys", None) is not None
    return bool(carrier.modifiers) or keys or data.animation_data is not None or carrier.parent_type in {"ARMATURE", "LATTICE"}


def is_bound(skin) -> bool:
    """Whether the texels go with the shape of what they lie on."""
    modifier = skin.modifiers.get(MODIFIER)
    return modifier is not None and modifier.node_group is not None and _carrier_of(modifier) == skin.parent


def bind(context, skin, carrier) -> None:
    """Bind the texels to the surface in the shape that both have now, where it may change."""
    unbind(skin)
    if is_needed(carrier):
        _bind(context, skin, carrier)
        modifier = skin.modifiers.new(MODIFIER, "NODES")
        modifier.node_group = bpy.data.node_groups.get(NODES) or _nodes()
        _hand(modifier, carrier)
        modifier.show_expanded = False
        skin.update_tag()


def unbind(skin) -> None:
    """Leave the texels where they are on the object, whatever its surface does."""
    modifier = skin.modifiers.get(MODIFIER)
    if modifier is not None:
        skin.modifiers.remove(modifier)
    for name in (*CORNERS, SHARES, OFFSET):
        attribute = skin.data.attributes.get(name)
        if attribute is not None:
            skin.data.attributes.remove(attribute)


def _socket(modifier) -> str:
    items = modifier.node_group.interface.items_tree
    return next(item.identifier for item in items if item.in_out == "INPUT" and item.socket_type == "NodeSocketObject")


def _hand(modifier, carrier) -> None:
    """Give the nodes the surface. Newer Blenders (5.2) have properties for inputs, older ones custom properties."""
    if hasattr(modifier, "properties"):
        getattr(modifier.properties.inputs, _socket(modifier)).value = carrier
    else:
        modifier[_socket(modifier)] = carrier


def _carrier_of(modifier):
    if hasattr(modifier, "properties"):
        return getattr(modifier.properties.inputs, _socket(modifier)).value
    return modifier.get(_socket(modifier))


def _bind(context, skin, carrier) -> None:
    """Note for each texel where it is on the surface."""
    arrays, _ = mesh_arrays.sensor_arrays(carrier, participants.depsgraph_of(context.scene))
    into = np.linalg.inv(transforms.as_array(carrier.matrix_world)) @ transforms.as_array(skin.matrix_world)
    points = mesh_arrays.vertices(skin.data) @ into[:3, :3].T + into[:3, 3]
    surface = PaintedMesh(arrays.vertices, arrays.triangles.tolist(), {}, {})
    corners, shares = (np.array(part) for part in zip(*_nearest(surface, points), strict=True))
    a, b, c = (arrays.vertices[corners[:, i]] for i in range(3))
    place = np.einsum("nk,nkj->nj", shares, np.stack([a, b, c], axis=1))
    along = _unit(b - a)
    normal = _unit(np.cross(b - a, c - a))
    axes = np.stack([along, np.cross(normal, along), normal], axis=1)
    offset = np.einsum("nij,nj->ni", axes, points - place)
    for name, values in zip(CORNERS, corners.T, strict=True):
        skin.data.attributes.new(name, "INT", "POINT").data.foreach_set("value", values.astype(np.int32))
    for name, table in ((SHARES, shares), (OFFSET, offset)):
        attribute = skin.data.attributes.new(name, "FLOAT_VECTOR", "POINT")
        attribute.data.foreach_set("vector", table.astype(np.float32).ravel())


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _nodes():
    """Return geometry nodes that put points where :func:`_bind` has bound them."""
    tree = bpy.data.node_groups.new(NODES, "GeometryNodeTree")
    for name, kind, way in (
        ("Geometry", "Geometry", "INPUT"),
        ("Surface", "Object", "INPUT"),
        ("Geometry", "Geometry", "OUTPUT"),
    ):
        tree.interface.new_socket(name, in_out=way, socket_type=f"NodeSocket{kind}")

    def node(kind, **settings):
        made = tree.nodes.new(kind)
        for key, value in settings.items():
            setattr(made, key, value)
        return made

    def vector(operation, *inputs):
        made = node("ShaderNodeVectorMath", operation=operation)
        for socket, source in zip([s for s in made.inputs if s.enabled], inputs, strict=False):
            tree.links.new(source, socket)
        return made.outputs["Vector"]

    def attribute(name, kind):
        made = node("GeometryNodeInputNamedAttribute", data_type=kind)
        made.inputs["Name"].default_value = name
        return next(socket for socket in made.outputs if socket.enabled and socket.name == "Attribute")

    def parts(source):
        made = node("ShaderNodeSeparateXYZ")
        tree.links.new(source, made.inputs[0])
        return made.outputs

    given = node("NodeGroupInput")
    surface = node("GeometryNodeObjectInfo", transform_space="RELATIVE")
    tree.links.new(given.outputs["Surface"], surface.inputs["Object"])
    position = node("GeometryNodeInputPosition")

    def corner(name):
        made = node("GeometryNodeSampleIndex", data_type="FLOAT_VECTOR", domain="POINT")
        tree.links.new(surface.outputs["Geometry"], made.inputs["Geometry"])
        tree.links.new(position.outputs[0], next(s for s in made.inputs if s.enabled and s.name == "Value"))
        tree.links.new(attribute(name, "INT"), made.inputs["Index"])
        return next(socket for socket in made.outputs if socket.enabled)

    a, b, c = (corner(name) for name in CORNERS)
    edge, other = vector("SUBTRACT", b, a), vector("SUBTRACT", c, a)
    along, normal = vector("NORMALIZE", edge), vector("NORMALIZE", vector("CROSS_PRODUCT", edge, other))
    axes = (along, vector("CROSS_PRODUCT", normal, along), normal)
    shares, offset = parts(attribute(SHARES, "FLOAT_VECTOR")), parts(attribute(OFFSET, "FLOAT_VECTOR"))
    total = None
    for source, factor in zip((a, b, c, *axes), (*shares, *offset), strict=True):
        scaled = vector("SCALE", source, factor)
        total = scaled if total is None else vector("ADD", total, scaled)
    put = node("GeometryNodeSetPosition")
    tree.links.new(given.outputs["Geometry"], put.inputs["Geometry"])
    tree.links.new(total, put.inputs["Position"])
    end = node("NodeGroupOutput")
    tree.links.new(put.outputs["Geometry"], end.inputs["Geometry"])
    return tree


@dataclass(frozen=True)
class PaintedMesh:
    """What is painted on a mesh: corners, faces, and by name the values of its vertex groups and float attributes."""

    corners: np.ndarray
    faces: list[list[int]]
    groups: dict[str, np.ndarray]
    attributes: dict[str, np.ndarray]


def painted_values(skin) -> PaintedMesh:
    """Return what is painted on a skin."""
    mesh = skin.data
    return PaintedMesh(
        mesh_arrays.vertices(mesh),
        [list(face.vertices) for face in mesh.polygons],
        {group.name: sensor_regions.vertex_weights(mesh, group.index) for group in skin.vertex_groups},
        {item.name: _values(item) for item in mesh.attributes if painted_maps.is_map(item)},
    )


def transfer_painted_values(skin, before: PaintedMesh) -> None:
    """Give the vertices of a skin's new mesh what was painted on the old one, at the nearest place on it."""
    found = _nearest(before, mesh_arrays.vertices(skin.data))

    def at_each(values: np.ndarray) -> np.ndarray:
        return np.array([values[corners] @ shares for corners, shares in found], dtype=np.float32)

    skin.vertex_groups.clear()
    for name, values in before.groups.items():
        group = skin.vertex_groups.new(name=name)
        for vertex, weight in enumerate(at_each(values).tolist()):
            if weight > 1e-6:
                group.add([vertex], weight, "REPLACE")
    for name, values in before.attributes.items():
        skin.data.attributes.new(name, "FLOAT", "POINT").data.foreach_set("value", at_each(values))


def _values(attribute) -> np.ndarray:
    values = np.empty(len(attribute.data), dtype=np.float32)
    attribute.data.foreach_get("value", values)
    return values


def _nearest(before: PaintedMesh, points: np.ndarray) -> list[tuple[list[int], np.ndarray]]:
    """For each point the corners of the nearest face and their shares in the place on it."""
    tree = BVHTree.FromPolygons(before.corners.tolist(), before.faces)
    result = []
    for point in points:
        place, _, index, _ = tree.find_nearest(Vector(point))
        face = before.faces[index]
        result.append((face, np.array(poly_3d_calc([Vector(before.corners[i]) for i in face], place))))
    return result
