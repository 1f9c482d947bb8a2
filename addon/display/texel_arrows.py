# SPDX-License-Identifier: GPL-3.0-or-later
"""An arrow at every texel, made by geometry nodes from the baked images, so that the arrows play in any Blender.

``NORMALS`` are normal to the surface and ``SHEARS`` tangential; their lengths show the force. Like the markers they show the
reaction, the force with which the sensor pushes back. Each kind is an object of points, one per texel, that is a child of the
sensor's body.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from ..scene import mesh_arrays
from ..scene.stored_names import ARROWS_MODIFIER
from ..session import transforms
from . import marker_meshes, markers, materials
from .baked_sensor import BakedSensor

KINDS = {"NORMALS": ("Normal Forces", "Normal Arrow"), "SHEARS": ("Shear Forces", "Shear Arrow")}
"""For each kind of arrow the name of its object, to which the sensor's name is appended, and the name of its material."""
NORMAL, X_AXIS, Y_AXIS = "palpate_normal", "palpate_x", "palpate_y"
"""Vector attributes of the points: the texel's axes."""
MIN_ARROW_SHARE = 0.02
"""Length below which an arrow is not drawn, as a share of the longest arrow."""


def build_arrows(scene, sensor: BakedSensor, image, kinds, lengths: dict, longest: dict) -> None:
    """Make the arrows of one sensor again: remove those of an earlier bake and build the kinds that are wanted.

    Parameters
    ----------
    sensor : BakedSensor
    image : Image
        The baked image sequence.
    kinds : collection of str
        Keys of :data:`KINDS`.
    lengths, longest : dict of str to float
        By kind: Blender units per newton, and the length of the longest arrow of all sensors.
    """
    frames = int(sensor.frames[0]), int(sensor.frames[-1])
    for kind, (name, material) in KINDS.items():
        uid = sensor.obj.palpate.uid
        found = markers.only_marker(scene.objects, uid, kind)
        if found is not None:
            markers.remove(found)
        if kind not in kinds:
            continue
        mesh = _points(sensor, f"{name} {sensor.obj.name}")
        arrows = bpy.data.objects.new(mesh.name, mesh)
        markers.link(scene, sensor.obj, arrows, kind)
        arrows.parent = sensor.body
        _, _, scale = transforms.decompose(transforms.as_array(sensor.body.matrix_world))
        arrows.matrix_parent_inverse = Matrix(np.vstack([np.column_stack([np.linalg.inv(scale), np.zeros(3)]), [0, 0, 0, 1]]))
        arrows.hide_select = True
        arrows.color = (*marker_meshes.COLORS[material], 1.0)  # Workbench shows these of what nodes make
        modifier = arrows.modifiers.new(ARROWS_MODIFIER, "NODES")
        made_of = marker_meshes.marker_material(material)
        scales = lengths[kind], longest[kind]
        modifier.node_group = _nodes(f"{uid}:{kind}", arrows.name, image, frames, kind, *scales, made_of)


def _points(sensor: BakedSensor, name: str):
    """Return a mesh of loose vertices, one per texel, with the attributes that the nodes read."""
    texels = sensor.texels
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(texels))
    mesh.vertices.foreach_set("co", (texels.position / sensor.scale).astype(np.float32).ravel())
    uv = np.column_stack([texels.layout.uv(), np.zeros(len(texels))])
    for key, table in (
        (materials.TEXEL_UV, uv), (NORMAL, texels.normal), (X_AXIS, texels.tangent), (Y_AXIS, texels.bitangent)
    ):  # fmt: skip
        mesh_arrays.store(mesh, key, table)
    mesh.update()
    return mesh


def _nodes(mark: str, name: str, image, frames, kind: str, length: float, longest: float, material):
    """Return geometry nodes that compute a vector per texel and put an arrow along it where it is long enough."""
    group = materials.empty_node_group(mark, name)
    add = materials.NodeAdder(group)
    start = add("NodeGroupInput")
    color = materials.add_image_lookup(add, image, frames)
    parts = add.end("FunctionNodeSeparateColor", {"Color": color}).outputs

    def times(key: str, channel: str):
        return add.vector("SCALE", add.attribute(key), Scale=parts[channel])

    if kind == "NORMALS":
        force = times(NORMAL, "Red")
    else:  # the reaction: the negative of the shear on the sensor
        force = add.vector("SCALE", add.vector("ADD", times(X_AXIS, "Green"), times(Y_AXIS, "Blue")), Scale=-1.0)
    arrow = add.vector("SCALE", force, Scale=length)
    size = add.vector("LENGTH", arrow, output="Value")
    long_enough = add.math("GREATER_THAN", size, MIN_ARROW_SHARE * longest)
    is_drawn = add.math("SUBTRACT", long_enough, materials.add_missing_test(add, color))
    lift = add.vector("SCALE", add.attribute(NORMAL), Scale=0.04 * longest if kind == "SHEARS" else 0.0)
    given = {
        "Points": add("GeometryNodeSetPosition", {"Geometry": start, "Offset": lift}),
        "Selection": is_drawn,
        "Instance": _arrow(add, material),
        "Rotation": add("FunctionNodeAlignRotationToVector", {"Vector": arrow}, axis="Z"),
        "Scale": size,
    }
    add.end("NodeGroupOutput", {0: add("GeometryNodeInstanceOnPoints", given)})
    return group


def _arrow(add, material):
    """Return the socket of an arrow of length one along z; it is built by nodes, so that no other object is needed."""
    join = add.end("GeometryNodeJoinGeometry")
    for bottom, top, begin, end in ((0.035, 0.035, 0.0, 0.66), (0.1, 0.0, 0.66, 1.0)):
        cone = add("GeometryNodeMeshCone", {"Vertices": 12, "Radius Top": top, "Radius Bottom": bottom, "Depth": end - begin})
        moved = add("GeometryNodeTransform", {"Geometry": cone, "Translation": (0.0, 0.0, begin)})
        add.tree.links.new(moved, join.inputs["Geometry"])
    return add("GeometryNodeSetMaterial", {"Geometry": join.outputs[0], "Material": material})
