# SPDX-License-Identifier: GPL-3.0-or-later
"""The net-force arrow of a sensor: an object of its own with keyframes, which plays in any Blender.

It stands on the centre of pressure and shows the force that the sensor pushes *back* with, as biomechanics draws ground
reaction forces: out of the sensor, where it can be seen. The force on the sensor is its negative. Without contact its
scale is zero.
"""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from ..core.recording import Recording
from . import curves, materials, transforms

MESH_MARK = "palpate_arrow"
SHAFT, HEAD, HEAD_START = 0.025, 0.07, 0.75
"""Radii and where the head begins, as shares of the length."""
SIDES = 24
COLOR = (1.0, 0.25, 0.02)


def bake(scene, obj, recording: Recording, sensor: str, body: int, scale: float, length: float) -> None:
    """Keyframe the arrow of one sensor.

    Parameters
    ----------
    obj : Object
        The sensor.
    body : int
        Its body in the recording.
    scale : float
        Metres per Blender unit.
    length : float
        Of the arrow, Blender units per newton.
    """
    table = channels(recording, sensor, body, scale, length)
    arrow = materials.find(scene.objects, obj.palpate.uid) or _make(scene, obj)
    arrow.rotation_mode = "QUATERNION"
    found, _ = curves.ensure(arrow, f"{arrow.name} Palpate")
    for path, columns in (("location", slice(0, 3)), ("rotation_quaternion", slice(3, 7)), ("scale", slice(7, 10))):
        curves.write(found, path, recording.frames, table[:, columns])


def channels(recording: Recording, sensor: str, body: int, scale: float, length: float) -> np.ndarray:
    """(F, 10) float: location, quaternion and scale of the arrow at each recorded frame."""
    felt = recording.sensors[sensor]
    rows, last = [], Quaternion()
    for i in range(len(recording.frames)):
        rotation = transforms.rotation(recording.poses[i, body, 3:])
        force = -rotation @ felt.net_force[i]
        foot = (recording.poses[i, body, :3] + rotation @ felt.centre_of_pressure[i]) / scale
        size = float(np.linalg.norm(force))
        if felt.contact[i].any() and size > 0.0:
            turn = Vector(force / size).to_track_quat("Z", "Y")
            turn.make_compatible(last)
            last = turn
        else:
            size = 0.0
        rows.append([*foot, *last, *(3 * [size * length])])
    return np.array(rows)


def clear(scene, uid: str) -> None:
    """Remove the arrow of a sensor."""
    arrow = materials.find(scene.objects, uid)
    if arrow is not None:
        _remove(arrow)


def sweep(uids) -> None:
    """Remove the arrows of sensors that were deleted; `uids` are those of all objects."""
    for arrow in of_deleted(bpy.data.objects, uids):
        _remove(arrow)


def of_deleted(objects, uids=None) -> list:
    """Return the arrows among some objects whose sensor was deleted."""
    arrows = [obj for obj in objects if materials.MARK in obj and obj.library is None]
    if arrows and uids is None:
        uids = {obj.palpate.uid for obj in bpy.data.objects}
    return [arrow for arrow in arrows if arrow[materials.MARK] not in uids]


def _remove(arrow) -> None:
    action = arrow.animation_data.action if arrow.animation_data else None
    mesh = arrow.data
    bpy.data.objects.remove(arrow)
    if action is not None and action.users == 0:
        bpy.data.actions.remove(action)
    if mesh is not None and mesh.users == 0:
        own = list(mesh.materials)
        bpy.data.meshes.remove(mesh)
        for material in own:
            if material is not None and material.users == 0:
                bpy.data.materials.remove(material)


def _make(scene, obj):
    arrow = bpy.data.objects.new(f"Net Force {obj.name}", _mesh())
    arrow[materials.MARK] = obj.palpate.uid
    own = {scene.collection, *scene.collection.children_recursive}  # the sensor may be in other scenes, too
    place = next((found for found in obj.users_collection if found in own and found.is_editable), scene.collection)
    place.objects.link(arrow)
    return arrow


def _mesh():
    """Return the mesh that all arrows share: one unit long, along +Z."""
    mesh = next((mesh for mesh in bpy.data.meshes if MESH_MARK in mesh), None)
    if mesh is not None:
        return mesh
    profile = [(0.0, 0.0), (SHAFT, 0.0), (SHAFT, HEAD_START), (HEAD, HEAD_START), (0.0, 1.0)]
    vertices = [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    for radius, height in profile[1:-1]:
        for side in range(SIDES):
            angle = 2 * math.pi * side / SIDES
            vertices.append((radius * math.cos(angle), radius * math.sin(angle), height))
    faces = []
    for side in range(SIDES):
        after = (side + 1) % SIDES
        faces.append((0, 2 + after, 2 + side))
        for ring in (0, 1):
            low, high = 2 + ring * SIDES, 2 + (ring + 1) * SIDES
            faces.append((low + side, low + after, high + after, high + side))
        faces.append((2 + 2 * SIDES + side, 2 + 2 * SIDES + after, 1))
    mesh = bpy.data.meshes.new("Palpate Arrow")
    mesh.from_pydata(vertices, [], faces)
    mesh[MESH_MARK] = 1
    mesh.materials.append(_material())
    mesh.update()
    return mesh


def _material():
    material = bpy.data.materials.new("Palpate Arrow")
    material.diffuse_color = (*COLOR, 1.0)
    if material.node_tree is None:
        material.use_nodes = True
    surface = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    surface.inputs["Base Color"].default_value = (*COLOR, 1.0)
    surface.inputs["Emission Color"].default_value = (*COLOR, 1.0)
    surface.inputs["Emission Strength"].default_value = 0.5
    return material
