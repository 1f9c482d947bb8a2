# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a finished recording into its scene: keyframes of the bodies that forces moved, heat maps, markers and arrows."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from ...core.errors import SceneError
from ...core.model.recording import Recording
from ..display import bake_display, baked_scene
from ..display.baked_sensor import BakedSensor
from ..properties.migrations import VERSION
from ..scene import moved_bodies, participants, scene_fingerprint
from ..scene.scene_reading import SceneReading
from ..session import identity

MANY_KEYFRAMES = 100_000
"""Keyframes from which a warning comes before a bake. A keyframe of an object, location and rotation together, takes 94 bytes
of a compressed .blend, 0.8 kB of memory whenever it is open, and 0.03 ms (of 30,000 frames with bpy 4.5): so this is 9 MB on
the disk and 80 MB in memory."""


def keyframe_warning(scene) -> str:
    """Return a sentence about a scene that would get very many keyframes by a bake, and an empty one for others."""
    frames = scene.frame_end - scene.frame_start + 1
    found = participants.find_participants(scene)[0]
    bodies = sum(obj.palpate.body in ("FREE", "DRIVEN") for obj in found)
    markers = sum(obj.palpate.role == "SENSOR" for obj in found) * len(scene.palpate.overlays)
    keyframes = frames * (bodies + markers)
    if keyframes <= MANY_KEYFRAMES:
        return ""
    return (
        f"The bake puts {keyframes:,} keyframes into the scene "
        f"({frames:,} frames, bodies that forces move: {bodies}, markers: {markers}): "
        f"about {94e-6 * keyframes:,.0f} MB in the .blend and {0.8e-3 * keyframes:,.0f} MB of memory whenever it is open. "
        "To avoid that, write the files alone with `palpate bake` without --save, or choose fewer overlays."
    )


def check_writable(scene, reading: SceneReading) -> None:
    """Raise SceneError if an object that the bake has to change cannot be changed."""
    objects = reading.objects(scene)
    sensors = [obj for sensor, obj in zip(reading.scenario.sensors, sensor_objects(scene, reading)) if sensor.readout]
    for obj in {*(objects[index] for index in reading.start_matrices), *sensors}:
        if not obj.is_editable:
            raise SceneError(
                f"'{obj.name}' is linked from another file, so that a bake cannot be put on it: "
                "use Object › Relations › Make Local first, or `palpate bake` without --save, which writes files alone."
            )
    for obj in sensors:
        mesh = obj.data
        if not mesh.is_editable or mesh.override_library is not None:  # Blender does not save changes of these
            raise SceneError(
                f"The mesh of sensor '{obj.name}' is linked from another file, so that its heat map would be "
                "lost: use Object › Relations › Make Local › Selected Objects and Data first, "
                "or `palpate bake` without --save, which writes files alone."
            )


def sensor_objects(scene, reading: SceneReading) -> list:
    """Return the objects that hold the sensors and pads, by sensor index.

    Raises
    ------
    SceneError
        One of them was deleted.
    """
    found = reading.sensor_objects(scene)
    if any(obj is None for obj in found):
        raise SceneError("A sensor was deleted while its forces were computed: undo that, or start again without it.")
    return found


def write(scene, reading: SceneReading, recording: Recording, folders: dict[str, Path]) -> None:
    """Put a recording into its scene. It replaces the recording of an earlier bake.

    Parameters
    ----------
    reading : SceneReading
        Its scenario was solved.
    recording : Recording
    folders : dict of str to Path
        Finished bake folder of each sensor, by the sensor's name.
    """
    scenario = reading.scenario
    objects, sensors = reading.objects(scene), sensor_objects(scene, reading)
    taking_part = {*objects, *sensors}
    for obj in scene.objects:  # objects that took part in an earlier bake and no longer do
        if obj.palpate.is_baked and obj not in taking_part:
            baked_scene.clear_object(scene, obj)
    for index in reading.start_matrices:
        obj, parents = objects[index], np.array(reading.parent_matrices[index])
        placement = moved_bodies.BodyPlacement.of(obj, reading.start_matrices[index], parents[0], reading.metres_per_unit)
        moved_bodies.keyframe_motion(obj, placement, recording.frames, recording.poses[:, index], parents)
    moved = {objects[index] for index in reading.start_matrices}
    baked_sensors = []
    for sensor, obj in zip(scenario.sensors, sensors):
        if sensor.readout:
            baked_sensors.append(_baked_sensor(obj, objects[sensor.body], sensor, reading, recording, folders[sensor.name]))
            obj.palpate.is_baked = True
        elif obj.palpate.is_baked and obj not in moved:
            baked_scene.clear_object(scene, obj)
    bake_display.show_bake(scene, baked_sensors)
    baked_scene.remove_orphans()
    settings = scene.palpate
    settings.schema_version = VERSION
    settings.baked_digest = recording.digest
    settings.baked_shapes = scene_fingerprint.pack_fingerprints(reading.mesh_fingerprints)
    settings.baked_names = json.dumps({identity.key(obj): obj.name for obj in participants.find_participants(scene)[0]})
    settings.baked_start, settings.baked_end = scenario.frame_start, scenario.frame_end


def _baked_sensor(obj, body, sensor, reading: SceneReading, recording: Recording, folder: Path) -> BakedSensor:
    return BakedSensor(
        obj=obj,
        body=body,
        texels=sensor.texels,
        painted=sensor.painted,
        parameters=sensor.parameters,
        readings=recording.sensors[sensor.name],
        frames=recording.frames,
        poses=recording.poses[:, sensor.body],
        scale=reading.metres_per_unit,
        folder=folder,
    )
