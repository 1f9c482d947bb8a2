# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry nodes that subdivide faces and spread a value smoothly over them, as :mod:`....core.geometry.smooth_mesh` does.

Blender's own node for smooth subdivision rebuilds its tables at every frame: 55 ms for 436 vertices and two levels (Blender
4.5, one core). Catmull and Clark's subdivision is also an even one followed by averages over the faces at each vertex (Warren
and Weimer, Subdivision Methods for Geometric Design, 2001, chapter 7), and geometry nodes average what goes from one domain to
another. That gives the same surface in a sixth of the time.
"""

from __future__ import annotations

import bpy

from ...core.geometry import smooth_grid
from ..scene.display_names import SMOOTH_VALUE
from . import materials

MARK = "smooth_subdivision:1"
"""Begins the marks of the node groups that all sensors share; its number changes with their nodes."""
_GEOMETRY, _VALUE = "NodeSocketGeometry", "NodeSocketFloat"


def smooth_subdivision(add, geometry, value, levels: int):
    """Subdivide the faces of a mesh and spread a value smoothly over them, near the given numbers.

    Parameters
    ----------
    add : NodeAdder
    geometry : NodeSocket
    value : NodeSocket
        Number at each vertex; evaluated several times, so it should be an attribute.
    levels : int
        Zero or more: each makes four faces of a quad.

    Returns
    -------
    geometry, value : NodeSocket
        The subdivided mesh, and the number at each of its vertices, on the limit surface of the sharpened numbers. Without
        levels, as they were given.
    """
    if not levels:
        return geometry, value
    mesh = _store(add, geometry, _use(add, "sharpening", value))
    for _ in range(levels):
        mesh = _use(add, "step", mesh)
    return mesh, _use(add, "limit")


def remove_unused() -> None:
    """Remove the shared groups of nodes that no sensor uses any more."""
    for group in list(bpy.data.node_groups):
        if str(group.get(materials.SENSOR_KEY, "")).startswith(f"{MARK}:") and group.library is None and not group.users:
            bpy.data.node_groups.remove(group)


def _use(add, kind: str, *given):
    """Return the output of a shared group of nodes, which is made where the .blend has none yet."""
    sockets, fill = {
        "sharpening": ((_VALUE, _VALUE), lambda own, start: _sharpened(own, start.outputs[0])),
        "step": ((_GEOMETRY, _GEOMETRY), lambda own, start: _step(own, start.outputs[0])),
        "limit": ((None, _VALUE), lambda own, start: _limit(own, _Averages(own))),
    }[kind]
    mark = f"{MARK}:{kind}"
    group = next(
        (one for one in bpy.data.node_groups if one.get(materials.SENSOR_KEY) == mark and one.library is None), None
    ) or _new_group(mark, f"Palpate smoothing, {kind}", sockets, fill)
    node = add("GeometryNodeGroup", node_tree=group)
    for place, socket in zip(node.inputs, given, strict=True):
        add.tree.links.new(socket, place)
    return node.outputs[0]


def _new_group(mark: str, name: str, sockets: tuple, fill):
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group[materials.SENSOR_KEY] = mark
    for kind, way in zip(sockets, ("INPUT", "OUTPUT"), strict=True):
        if kind is not None:
            group.interface.new_socket("Geometry" if kind == _GEOMETRY else "Value", in_out=way, socket_type=kind)
    add = materials.NodeAdder(group)
    end = fill(add, add("NodeGroupInput"))
    group.links.new(end, add("NodeGroupOutput").inputs[0])
    return group


def _sharpened(add, given):
    """Return values whose smoothed surface passes near the given ones: each time, what the smoothing takes away is added."""
    values = given
    for _ in range(smooth_grid.SHARPENINGS):
        blur = add("GeometryNodeBlurAttribute", data_type="FLOAT")
        blur.inputs["Iterations"].default_value = 1
        blur.inputs["Weight"].default_value = smooth_grid.NEIGHBOUR_WEIGHT
        add.tree.links.new(values, blur.inputs["Value"])
        values = math(add, "ADD", values, math(add, "SUBTRACT", given, blur.outputs["Value"]))
    return values


class _Averages:
    """Sockets of the stored value, of its averages around each vertex, and of what lies around the vertex.

    Attributes
    ----------
    value
        At the vertex.
    faces, edges
        Mean over the middles of the faces and of the edges at the vertex.
    border
        The same of the edges that have one face.
    valence
        Number of edges at the vertex.
    is_border
        1 at a vertex with edges that have one face, else 0.
    is_odd
        1 where more than two faces share an edge, where an edge has none, and where sheets touch in a point; else 0.
    """

    def __init__(self, add):
        self.value = add("GeometryNodeInputNamedAttribute", data_type="FLOAT")
        self.value.inputs["Name"].default_value = SMOOTH_VALUE
        self.value = self.value.outputs["Attribute"]
        self.faces, self.edges = (_on(add, domain, self.value) for domain in ("FACE", "EDGE"))
        sides = add("GeometryNodeInputMeshEdgeNeighbors").outputs["Face Count"]
        is_rim = math(add, "COMPARE", sides, 1.0, 0.1)
        share = _on(add, "EDGE", is_rim)
        self.border = math(add, "DIVIDE", _on(add, "EDGE", math(add, "MULTIPLY", is_rim, self.value)), share)
        self.valence = add("GeometryNodeInputMeshVertexNeighbors").outputs["Vertex Count"]
        self.is_border = math(add, "GREATER_THAN", share, 0.0)
        # regular: all edges have one or two faces, and none or two of them have one
        usual = math(add, "COMPARE", _on(add, "EDGE", math(add, "COMPARE", sides, 1.5, 0.6)), 1.0, 1e-4)
        rims = math(add, "MULTIPLY", share, self.valence)
        two = math(add, "COMPARE", rims, math(add, "MULTIPLY", self.is_border, 2.0), 0.1)
        self.is_odd = math(add, "LESS_THAN", math(add, "MULTIPLY", usual, two), 0.5)

    def chosen(self, add, inner, border):
        """Return the socket of one value inside, another on the border, and the vertex's own where it is odd."""
        return mix(add, mix(add, inner, border, self.is_border), self.value, self.is_odd)


def _step(add, mesh):
    """Return the socket of a mesh whose faces are cut once, with the value moved as Catmull and Clark do.

    A vertex of n edges from before moves by 4/n of the way to the mean of the faces around it. The middle of an edge or a face
    moves twice the way to the mean of the edges there, which leaves the middle of a face where it is.
    """
    finer = add("GeometryNodeSubdivideMesh")
    add.tree.links.new(mesh, finer.inputs["Mesh"])
    finer.inputs["Level"].default_value = 1
    size = add("GeometryNodeAttributeDomainSize", component="MESH")
    add.tree.links.new(mesh, size.inputs["Geometry"])
    is_old = math(add, "LESS_THAN", add("GeometryNodeInputIndex").outputs[0], size.outputs["Point Count"])
    around = _Averages(add)
    old = mix(add, around.value, around.faces, math(add, "DIVIDE", 4.0, around.valence))
    inner = mix(add, mix(add, around.value, around.edges, 2.0), old, is_old)
    return _store(add, finer.outputs["Mesh"], around.chosen(add, inner, around.border))


def _limit(add, around: _Averages):
    """Return the socket of the value on the limit surface: ((n − 3) v + 4 faces + 4 edges) / (n + 5), a third v on borders."""
    means = math(add, "ADD", around.faces, around.edges)
    twice = math(add, "SUBTRACT", means, math(add, "MULTIPLY", around.value, 2.0))
    share = math(add, "DIVIDE", 4.0, math(add, "ADD", around.valence, 5.0))
    inner = math(add, "MULTIPLY_ADD", twice, share, around.value)
    return around.chosen(add, inner, mix(add, around.value, around.border, 2.0 / 3.0))


def _on(add, domain: str, value):
    """Return the socket of a value that is averaged over the vertices of faces or edges, and over those around each vertex."""
    node = add("GeometryNodeFieldOnDomain", data_type="FLOAT", domain=domain)
    _set(add, node.inputs[0], value)
    return node.outputs[0]


def _store(add, geometry, value):
    node = add("GeometryNodeStoreNamedAttribute", data_type="FLOAT", domain="POINT")
    node.inputs["Name"].default_value = SMOOTH_VALUE
    add.tree.links.new(geometry, node.inputs["Geometry"])
    add.tree.links.new(value, node.inputs["Value"])
    return node.outputs["Geometry"]


def math(add, operation: str, *values):
    """Return the socket of a calculation with sockets and numbers."""
    node = add("ShaderNodeMath", operation=operation)
    for place, value in zip(node.inputs, values, strict=False):
        _set(add, place, value)
    return node.outputs[0]


def mix(add, zero, one, factor):
    """Return the socket of what lies between two values; the factor is a number or socket, which may exceed one."""
    node = add("ShaderNodeMix", data_type="FLOAT", clamp_factor=False)
    sockets = {socket.identifier: socket for socket in node.inputs}
    for key, value in (("Factor_Float", factor), ("A_Float", zero), ("B_Float", one)):
        _set(add, sockets[key], value)
    return node.outputs[0]


def _set(add, place, value) -> None:
    if isinstance(value, float):
        place.default_value = value
    else:
        add.tree.links.new(value, place)
