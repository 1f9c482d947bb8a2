# SPDX-License-Identifier: GPL-3.0-or-later
"""Markers on a baked sensor: keyframed objects of their own, which play in any Blender.

* ``FORCE``: an arrow at the centre of pressure. It shows the force that the sensor pushes *back* with, as biomechanics draws
  ground reaction forces: out of the sensor, where it is visible. The force on the sensor is its negative.
* ``TORQUE``: a double arrow along the free moment, the net torque about the centre of pressure; also of the reaction.
* ``CENTRE``: a ball at the centre of pressure.
* ``SLIP``: a ring around it. Its width shows the share of the normal force that slipping texels carry.

Without contact the scale of a marker is zero.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from ...core import response
from ..session import fcurves, identity
from . import marker_meshes, materials
from .baked_sensor import BakedSensor

KIND_KEY = "palpate_marker"
"""Custom property of a marker: its key in :data:`KINDS`. Earlier versions had only FORCE, without this property."""
KINDS = {
    "FORCE": ("Net Force", "Arrow"),
    "TORQUE": ("Free Moment", "Torque Arrow"),
    "CENTRE": ("Centre of Pressure", "Ball"),
    "SLIP": ("Slip", "Ring"),
}
"""Name of the object (the sensor's name is appended) and its shape."""
BALL_SHARE, RING_SHARE = 0.03, 0.25
"""Radius of the ball, and of the ring if all texels slip, as shares of the sensor's size."""


def only_marker(objects, uid: str, kind: str):
    """Return a sensor's marker among some objects, or None, and remove its duplicates: they would show an earlier bake."""
    found = [obj for obj in objects if obj.get(materials.SENSOR_KEY) == uid and obj.get(KIND_KEY, "FORCE") == kind]
    for duplicate in found[1:]:
        remove(duplicate)
    return found[0] if found else None


def keyframe_markers(scene, sensor: BakedSensor, kinds, lengths: dict[str, float]) -> None:
    """Keyframe the markers of one sensor and remove those that are not wanted.

    Parameters
    ----------
    kinds : collection of str
        Keys of :data:`KINDS`.
    lengths : dict
        Scale of the arrows: Blender units per newton (FORCE) and per newton metre (TORQUE).
    """
    for kind in KINDS:
        marker = only_marker(scene.objects, sensor.obj.palpate.uid, kind)
        if kind not in kinds:
            if marker is not None:
                remove(marker)
            continue
        if marker is None:
            name, shape = KINDS[kind]
            marker = bpy.data.objects.new(f"{name} {sensor.obj.name}", marker_meshes.shared_mesh(shape))
            link(scene, sensor.obj, marker, kind)
        marker.rotation_mode = "QUATERNION"
        table = channels(sensor, kind, lengths.get(kind, 1.0))
        found, _ = fcurves.ensure(marker, f"{marker.name} Palpate")
        for path, columns in (("location", slice(0, 3)), ("rotation_quaternion", slice(3, 7)), ("scale", slice(7, 10))):
            fcurves.write(found, path, sensor.frames, table[:, columns])


def channels(sensor: BakedSensor, kind: str, length: float = 1.0) -> np.ndarray:
    """(F, 10) float: location, quaternion and scale of a marker at each recorded frame.

    `length` is the length of an arrow for one newton or newton metre, in Blender units.
    """
    direction, size = _direction_and_size(sensor, kind)
    size = np.where(sensor.in_contact, size * length, 0.0)
    points, axes = sensor.reactions()[0], sensor.to_world(direction)
    turns, last = [], Quaternion()
    for i in range(len(size)):
        if size[i] > 0.0:
            turn = Vector(axes[i] / np.linalg.norm(axes[i])).to_track_quat("Z", "Y")  # normalised, as it ignores short vectors
            turn.make_compatible(last)
            last = turn
        turns.append(tuple(last))
    return np.hstack([points, turns, np.repeat(size[:, None], 3, axis=1)])


def _direction_and_size(sensor: BakedSensor, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the direction of a marker in the body's frame, (F, 3), and its size, (F,); of an arrow, N or N·m."""
    if kind == "FORCE":
        return -sensor.readings.net_force, np.linalg.norm(sensor.readings.net_force, axis=1)
    if kind == "TORQUE":
        moment = response.free_moment(sensor.readings)
        return -moment, np.linalg.norm(moment, axis=1)
    outward = sensor.readings.normal_force @ sensor.texels.normal  # mean normal of the texels, weighted with their forces
    outward[np.linalg.norm(outward, axis=1) == 0.0] = sensor.texels.normal[0]
    if kind == "CENTRE":
        return outward, np.full(len(sensor.frames), BALL_SHARE * sensor.size)
    return outward, response.slip_share(sensor.readings, sensor.parameters, sensor.painted) * RING_SHARE * sensor.size


def follow_names(scene, sensors) -> None:
    """Name the markers of renamed sensors after them, unless the user has named a marker himself."""
    names = {obj.palpate.uid: obj.name for obj in sensors if not identity.is_copy(obj)}
    for marker in scene.objects:
        sensor, (label, _) = names.get(marker.get(materials.SENSOR_KEY)), KINDS.get(marker.get(KIND_KEY, "FORCE"), ("", ""))
        if sensor and label and marker.is_editable and marker.name.startswith(f"{label} "):
            wanted = f"{label} {sensor}"
            if not marker.name.startswith(wanted):
                marker.name = wanted


def clear(scene, uid: str) -> None:
    """Remove the markers of a sensor."""
    for marker in [obj for obj in scene.objects if obj.get(materials.SENSOR_KEY) == uid]:
        remove(marker)


def remove_orphans() -> None:
    """Remove the markers of sensors that were deleted, and copies of markers in scenes without their sensor."""
    for marker in orphans(bpy.data.objects):
        remove(marker)


def orphans(objects) -> list:
    """Return the markers among some objects whose sensor is in none of the marker's scenes.

    It was deleted, or the scene is a full copy: there the copied sensor has an identity of its own, and the copied marker names
    the original.
    """
    found = [obj for obj in objects if materials.SENSOR_KEY in obj and obj.library is None]
    uids: dict = {}
    for marker in found:
        for scene in marker.users_scene:
            if scene not in uids:
                uids[scene] = {obj.palpate.uid for obj in scene.objects}
    return [marker for marker in found if not any(marker[materials.SENSOR_KEY] in uids[scene] for scene in marker.users_scene)]


def remove(marker) -> None:
    """Remove a marker with its animation, mesh, nodes and materials, as far as nothing else uses them."""
    action = marker.animation_data.action if marker.animation_data else None
    groups = [modifier.node_group for modifier in marker.modifiers if modifier.type == "NODES"]
    mesh = marker.data
    bpy.data.objects.remove(marker)
    if action is not None and action.users == 0:
        bpy.data.actions.remove(action)
    used = [material for material in mesh.materials if material is not None] if mesh is not None else []
    if mesh is not None and mesh.users == 0:
        bpy.data.meshes.remove(mesh)
    for group in groups:
        if group is not None and group.users == 0:
            used += [node.inputs["Material"].default_value for node in group.nodes if node.type == "SET_MATERIAL"]
            bpy.data.node_groups.remove(group)
    for material in used:
        if material is not None and material.users == 0:
            bpy.data.materials.remove(material)


def link(scene, obj, marker, kind: str) -> None:
    """Link a new marker to a collection of this scene that holds its sensor, which may be in other scenes as well."""
    marker[materials.SENSOR_KEY], marker[KIND_KEY] = obj.palpate.uid, kind
    own = {scene.collection, *scene.collection.children_recursive}
    place = next((found for found in obj.users_collection if found in own and found.is_editable), scene.collection)
    place.objects.link(marker)
