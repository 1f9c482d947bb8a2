# SPDX-License-Identifier: GPL-3.0-or-later
"""Place the magnets and magnetometers of a skin as it is built under a sensor: empties that move with it."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from ...core.skins import skin_presets
from ..properties import object_properties
from ..scene import moved_bodies, participants, sensor_reader
from ..session import transforms

SHOWN = 1.5e-3
"""m: length of the arrows of an empty."""


def place_skin(context, obj, name: str):
    """Put the magnets and magnetometers of a preset below a sensor, and make them its read-out.

    Parameters
    ----------
    obj : Object
        A sensor.
    name : str
        Of :data:`.skin_presets.PRESETS`.

    Returns
    -------
    Collection
        A new one, with the empties.

    Raises
    ------
    SensorError
        The sensor has no texels, or the preset does not fit below them.
    """
    scene, depsgraph = context.scene, participants.depsgraph_of(context.scene)
    preset = skin_presets.preset_named(name)
    sensor, _ = sensor_reader.sensor_in_own_frame(scene, obj, depsgraph)
    magnets, chips = skin_presets.placed(preset, sensor.texels)
    pose, metres = moved_bodies.body_pose(scene, obj, depsgraph), transforms.metres_per_unit(scene)
    body = np.array(Matrix.LocRotScale(pose[:3] / metres, Quaternion(pose[3:]), None))
    collection = bpy.data.collections.new(f"{obj.name} Magnetic Skin")
    scene.collection.children.link(collection)

    def put(what: str, i: int, place: np.ndarray, axes: np.ndarray, shape: str):
        """Add an empty with axes in rows (3, 3) at a place of the body, m."""
        part = bpy.data.objects.new(f"{obj.name} {what.title()} {i:02d}", None)
        collection.objects.link(part)
        part.empty_display_size, part.empty_display_type = SHOWN / metres, shape
        part.parent, part.matrix_parent_inverse = obj, obj.matrix_world.inverted()
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = axes.T, place / metres
        part.matrix_basis = Matrix(body @ matrix)
        part.palpate.magnetic.part = what
        return part.palpate.magnetic

    for i, (place, moment) in enumerate(zip(magnets.place, magnets.moment, strict=True)):
        put("MAGNET", i, place, _frame_of(moment), "SINGLE_ARROW").moment = float(np.linalg.norm(moment))
    for i, (place, axes) in enumerate(zip(chips.place, chips.axes, strict=True)):
        put("MAGNETOMETER", i, place, axes, "ARROWS")
    own = obj.palpate.readout
    own.kind, own.collection, own.thickness = object_properties.PLACED, collection, preset.thickness
    return collection


def _frame_of(direction: np.ndarray) -> np.ndarray:
    """Return axes in rows (3, 3), the last along a direction."""
    up = direction / np.linalg.norm(direction)
    across = np.cross(np.eye(3)[np.argmin(np.abs(up))], up)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(up, across), up])
