# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a finished recording into its scene: keyframes of the bodies that forces moved, heat maps, markers and arrows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...core.errors import SceneError
from ...core.model.recording import Recording
from ...core.model.scenario import Scenario
from ..display import bake_display, baked_scene
from ..display.baked_sensor import BakedSensor
from ..scene import moved_bodies
from ..scene.scene_reader import Binding
from ..timeline import staleness


def check_writable(scene, scenario: Scenario, binding: Binding) -> None:
    """Raise SceneError if an object that the bake has to change cannot be changed."""
    objects = binding.objects(scene)
    sensors = [obj for sensor, obj in zip(scenario.sensors, sensor_objects(scene, binding)) if sensor.readout]
    for obj in {*(objects[index] for index in binding.starts), *sensors}:
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


def sensor_objects(scene, binding: Binding) -> list:
    """Return the objects that hold the sensors and pads, by sensor index.

    Raises
    ------
    SceneError
        One of them was deleted.
    """
    found = binding.sensor_objects(scene)
    if any(obj is None for obj in found):
        raise SceneError("A sensor was deleted while its forces were computed: undo that, or start again without it.")
    return found


def write(scene, scenario: Scenario, binding: Binding, recording: Recording, folders: dict[str, Path]) -> None:
    """Put a recording into its scene. It replaces the recording of an earlier bake.

    Parameters
    ----------
    scenario : Scenario
        What was solved.
    binding : Binding
        Which object of the scene is which body and sensor of the scenario.
    recording : Recording
    folders : dict of str to Path
        Finished bake folder of each sensor, by the sensor's name.
    """
    objects, sensors = binding.objects(scene), sensor_objects(scene, binding)
    taking_part = {*objects, *sensors}
    for obj in scene.objects:  # objects that took part in an earlier bake and no longer do
        if obj.palpate.is_baked and obj not in taking_part:
            baked_scene.clear_object(scene, obj)
    for index in binding.starts:
        _keyframe_body(objects[index], index, binding, recording)
    moved = {objects[index] for index in binding.starts}
    baked_sensors = []
    for sensor, obj in zip(scenario.sensors, sensors):
        if sensor.readout:
            baked_sensors.append(_baked_sensor(obj, objects[sensor.body], sensor, binding, recording, folders[sensor.name]))
            obj.palpate.is_baked = True
        elif obj.palpate.is_baked and obj not in moved:
            baked_scene.clear_object(scene, obj)
    bake_display.show_bake(scene, baked_sensors)
    baked_scene.remove_orphans()
    settings = scene.palpate
    settings.baked_digest = recording.digest
    settings.baked_shapes = staleness.pack(binding.looks)
    settings.baked_start, settings.baked_end = scenario.frame_start, scenario.frame_end


def _keyframe_body(obj, index: int, binding: Binding, recording: Recording) -> None:
    """Write the motion of a body that forces have moved as keyframes of its object."""
    placement = moved_bodies.Placement.of(obj, binding.starts[index], binding.parents[index][0], binding.scale)
    moved_bodies.bake(obj, placement, recording.frames, recording.poses[:, index], np.array(binding.parents[index]))


def _baked_sensor(obj, body, sensor, binding: Binding, recording: Recording, folder: Path) -> BakedSensor:
    return BakedSensor(
        obj=obj,
        body=body,
        texels=sensor.texels,
        painted=sensor.painted,
        parameters=sensor.parameters,
        readings=recording.sensors[sensor.name],
        frames=recording.frames,
        poses=recording.poses[:, sensor.body],
        scale=binding.scale,
        folder=folder,
    )
