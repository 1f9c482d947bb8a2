# SPDX-License-Identifier: GPL-3.0-or-later
"""Show the numbers of a bake's present frame. Keyframes and materials show the bake in the 3D view by themselves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import PalpateError
from ...core.geometry.texels import Texels
from ...core.io.bake_folder import RECORDING_NAME
from ...core.io.recording_npz import load_recording
from ...core.io.sensor_npz import SENSOR_NAME, load_sensor
from ...core.model.recording import Frame, Recording
from ..display import bake_display, baked_scene, inset
from ..session import animation_time, frame_status
from . import staleness

_recordings: dict[Path, Recording | None] = {}
"""By folder of a sensor's bake: its recording, read when it is first needed; None when it cannot be read."""
_texels: dict[Path, Texels | None] = {}
"""By folder of a sensor's bake: its texels, likewise."""


def forget() -> None:
    """Forget all recordings and texels that were read."""
    _recordings.clear()
    _texels.clear()


def remember(recording: Recording, folders: dict[str, Path]) -> None:
    """Keep the recording of a new bake in memory, for the folders of its sensors; others are forgotten."""
    forget()
    _recordings.update(dict.fromkeys(folders.values(), recording))


def show(scene, depsgraph) -> None:
    """Show the numbers of a bake's present frame in the panel, and its images and curves in the 3D view."""
    number, _ = animation_time.current_frame(scene)
    sensors, recording = {}, None
    for obj in baked_scene.baked_objects(scene):
        found = _recording_of(obj)
        if found is not None:
            recording = found
            if number in found.frames:
                sensors.update(found.at(number).sensors)
    if not sensors:
        frame_status.set_status(scene, f"Frame {number} is outside of the bake.")
        return
    text = f"Frame {number} of the bake."
    if staleness.is_stale(scene, depsgraph, recording):
        text = "The bake is out of date, something has changed since: bake again."
    frame = Frame(number, 0.0, sensors, poses=np.zeros((0, 7)), velocities=np.zeros((0, 6)))
    frame_status.set_status(scene, text, frame, recording.step_reason)
    if scene.palpate.show_inset and not bpy.app.background:
        _show_inset(scene, frame)


def _show_inset(scene, frame: Frame) -> None:
    """Show the tactile images and force curves of a bake's frame."""
    sensors, texels, last = {}, {}, None
    for obj in baked_scene.baked_objects(scene):
        recording, own = _recording_of(obj), _texels_of(obj)
        if recording is not None and own is not None and frame.frame in recording.frames:
            last = recording
            sensors.update(recording.sensors)
            texels.update(dict.fromkeys(recording.sensors, own))
    if last is None:
        return
    style = bake_display.figure_style(scene)
    top = style.scale_limit(replace(last, sensors=sensors), texels) * (1e3 if style.quantity == "pressure" else 1.0)
    loads = {name: readings.normal_force.sum(axis=1) for name, readings in sensors.items()}
    inset.show(scene, inset.inset_content(scene, frame, texels, last.frames.astype(float), loads, top))


def _texels_of(obj) -> Texels | None:
    """Return the texels of a sensor's bake; None when they cannot be read."""
    folder = baked_scene.bake_folder(obj)
    if folder is None:
        return None
    if folder not in _texels:
        try:
            _texels[folder] = load_sensor(folder / SENSOR_NAME)[0]
        except PalpateError:
            _texels[folder] = None
    return _texels[folder]


def _recording_of(obj) -> Recording | None:
    """Return the recording of a sensor's bake; None when it cannot be read."""
    folder = baked_scene.bake_folder(obj)
    if folder is None:
        return None
    if folder not in _recordings:
        try:
            _recordings[folder] = load_recording(folder / RECORDING_NAME)
        except PalpateError:
            _recordings[folder] = None
    return _recordings[folder]
