# SPDX-License-Identifier: GPL-3.0-or-later
"""Probes: keyframed balls, boxes or rods that press on a sensor, hold and leave, to try it out."""

from __future__ import annotations

import math

import bmesh
import bpy
import numpy as np
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

from ...core.errors import SensorError
from ..display import materials
from ..session import fcurves, transforms
from . import sensor_report

PRESS, HOLD = 0.2, 0.75
"""Shares of the frame range at which the probe is deepest, and begins to leave."""
START = 0.02
"""Height at the first frame, as a share of the depth: the probe touches at the second frame, or the third of a long range."""
SIDES = 64
MATERIAL_KEY = "palpate_probe"
"""Custom property of the material of all probes."""
OPACITY = 0.2
"""Of a probe in a render: its outline and lights are seen, and the colours behind it remain."""


def add_probe(context, obj, shape: str, size: float, depth: float):
    """Add a target that presses on the middle of a sensor along its normal.

    Parameters
    ----------
    shape : {"BALL", "BOX", "ROD"}
    size : float, metres
        Radius, or half the side of a box. 0: a third of the sensor's extent.
    depth : float, metres
        How deep the probe presses, from its first contact. 0: a quarter of the maximum penetration.

    Returns
    -------
    Object
        The probe, a keyframed target.

    Raises
    ------
    SensorError
        The sensor has no texels.
    """
    report = sensor_report.fresh_report(obj, context.scene)
    if report.texels is None:
        raise SensorError(report.problems[0].text)
    texels, unit = report.texels, report.metres
    extent = float(np.ptp(texels.position, axis=0).max())
    size, depth = size or extent / 3, depth or report.reach / 4
    foot, mean_normal = _middle(texels)
    location, quaternion, _ = transforms.decompose(transforms.as_array(obj.matrix_world))
    rotation = transforms.rotation(quaternion)
    normal, ground = rotation @ mean_normal, location + rotation @ foot / unit
    probe = bpy.data.objects.new("Probe", _mesh(shape, size / unit))
    collections = (found for found in obj.users_collection if found.is_editable)  # shown and baked where the sensor is
    next(collections, context.scene.collection).objects.link(probe)
    turn = Vector(normal).to_track_quat("Z", "Y")
    probe.rotation_euler = turn.to_euler()
    around = (texels.position - foot) / unit @ rotation.T @ transforms.as_array(turn.to_matrix())
    ground = ground + _first_contact(probe.data, around, size / unit) * normal
    _animate(context.scene, probe, ground, normal, size / unit, depth / unit)
    _show_sparsely(probe, shape)
    probe.palpate.role = "TARGET"
    return probe


def _show_sparsely(probe, shape: str) -> None:
    """Let the texels under a probe be seen: a few lines in the 3D view, and clear as thin glass in a render."""
    if shape == "ROD":  # Blender draws bounding cylinders along z only
        probe.display_type = "WIRE"
    else:
        probe.display_type, probe.display_bounds_type = "BOUNDS", "SPHERE" if shape == "BALL" else "BOX"
    material = next((found for found in bpy.data.materials if MATERIAL_KEY in found), None)
    if material is None:
        material = bpy.data.materials.new("Palpate Probe")
        material[MATERIAL_KEY] = 1
        surface = next(node for node in materials.tree_of(material).nodes if node.type == "BSDF_PRINCIPLED")
        surface.inputs["Alpha"].default_value = OPACITY
        surface.inputs["Roughness"].default_value = 0.1
        material.diffuse_color = (0.8, 0.8, 0.8, OPACITY)
    probe.data.materials.append(material)


def _middle(texels) -> tuple[np.ndarray, np.ndarray]:
    """Return the position of the texel in the middle of a sensor (3,), metres, and the mean normal of all texels (3,)."""
    weights = texels.area / texels.area.sum()
    mean = weights @ texels.normal
    mean = mean / np.linalg.norm(mean) if np.linalg.norm(mean) > 0.1 else texels.normal[0]
    flat = np.eye(3) - np.outer(mean, mean)
    across = np.linalg.norm((texels.position - weights @ texels.position) @ flat, axis=1)
    facing = texels.normal @ mean > 0.5 * (texels.normal @ mean).max()  # not those on the back of a closed sensor
    return texels.position[np.argmin(np.where(facing, across, np.inf))], mean


def _first_contact(mesh, points: np.ndarray, size: float) -> float:
    """Return how much higher than `size` the probe's middle is above the foot when the probe first touches a texel.

    Parameters
    ----------
    mesh : Mesh
        Mesh of the probe, which moves down along its own z axis.
    points : (n, 3) float
        Positions of texels relative to the foot, along the probe's axes.
    """
    tree = BVHTree.FromPolygons([vertex.co for vertex in mesh.vertices], [face.vertices for face in mesh.polygons])
    under = Vector((0.0, 0.0, -10.0 * size))
    heights = [0.0]  # the foot itself
    for x, y, z in points:
        place = tree.ray_cast(under + Vector((x, y, 0.0)), Vector((0.0, 0.0, 1.0)))[0]
        if place is not None:
            heights.append(z - place.z - size)
    return max(heights)


def _animate(scene, probe, ground: np.ndarray, normal: np.ndarray, size: float, depth: float) -> None:
    """Keyframe the probe: it starts just above the ground point, presses along the normal, holds and leaves; Blender units.

    It moves at constant speeds, so that the start is not drawn out by an easing.
    """
    first, length = scene.frame_start, scene.frame_end - scene.frame_start
    clear = max(2.0 * depth, 0.2 * size)
    shares, heights = np.array([(0.0, START * depth), (PRESS, -depth), (HOLD, -depth), (1.0, clear)]).T
    places = ground + (size + heights)[:, None] * normal
    curves, _ = fcurves.ensure(probe, "Probe")
    fcurves.write(curves, "location", np.round(first + shares * length).astype(int), places)


def _mesh(shape: str, size: float):
    """Return the mesh of a probe, Blender units."""
    mesh, data = bmesh.new(), bpy.data.meshes.new("Probe")
    if shape == "BOX":
        bmesh.ops.create_cube(mesh, size=2 * size)
    elif shape == "ROD":
        bmesh.ops.create_cone(mesh, cap_ends=True, segments=SIDES, radius1=size, radius2=size, depth=4 * size)
        bmesh.ops.rotate(mesh, verts=mesh.verts, matrix=Matrix.Rotation(math.pi / 2, 3, "X"))
    else:
        bmesh.ops.create_uvsphere(mesh, u_segments=SIDES, v_segments=SIDES // 2, radius=size)
        for face in mesh.faces:
            face.smooth = True
    mesh.to_mesh(data)
    mesh.free()
    return data
