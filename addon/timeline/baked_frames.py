# SPDX-License-Identifier: GPL-3.0-or-later
"""Show the numbers of a bake's present frame. Keyframes and materials show the bake in the 3D view by themselves."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ...core.errors import PalpateError
from ...core.figures.quantities import Extent, Scale
from ...core.io.bake_reader import Bake, read_sensors
from ...core.model.recording import Frame, Recording
from ..display import bake_display, bake_identity, baked_scene, inset, overlays
from ..session import fcurves, frame_status, identity
from . import staleness

_new: dict[Path, Recording] = {}
"""By folder of a sensor's bake: the recording of the bake that has just been made."""
_names: dict[Path, str] = {}
"""By folder of a sensor's bake: the name that the sensor has in it."""
_read: dict[tuple[Path, ...], tuple[list[tuple[int, ...]], Bake | PalpateError]] = {}
"""By the folders of a scene's sensors: the stamps of their manifests and their bake, read and checked when it is first needed
and when another one has taken its place, or why it cannot be read."""
_extents: dict[tuple[int, str], tuple[Bake, Extent]] = {}
"""By identity of a bake, which is kept with it, and quantity: the extent of the colours that were shown last."""


def forget() -> None:
    """Forget all that was read."""
    _new.clear()
    _read.clear()
    _names.clear()
    _extents.clear()


def remember(recording: Recording, folders: dict[str, Path]) -> None:
    """Keep the recording of a new bake in memory, for the folders of its sensors; others are forgotten."""
    forget()
    _new.update(dict.fromkeys(folders.values(), recording))
    _names.update({folder: name for name, folder in folders.items()})


def show(scene, depsgraph) -> None:
    """Show the numbers of a bake's present frame in the panel, and its images and curves in the 3D view."""
    number, _ = fcurves.current_frame(scene)
    try:
        recording = _recording(scene)
    except PalpateError as error:
        frame_status.set_status(scene, str(error))
        return
    if recording is None or number not in recording.frames:
        frame_status.set_status(scene, f"Frame {number} is outside of the bake.")
        return
    text, note = f"Frame {number} of the bake.", ""
    other = bake_identity.other_bake(scene)
    if other:
        text, note = other, "not the bake of this file"
    elif staleness.is_stale(scene, depsgraph, recording):
        text, note = "The scene has changed since this bake. Bake again.", "out of date: bake again"
    present = _present_names(scene)
    sensors = {present.get(name, name): readings for name, readings in recording.at(number).sensors.items()}
    frame = Frame(number, 0.0, sensors, poses=np.zeros((0, 7)), velocities=np.zeros((0, 6)))
    frame_status.set_status(scene, text, frame, recording.step_reason, " ".join(recording.warnings))
    if not bpy.app.background:
        _show_in_views(scene, frame, note)


def _show_in_views(scene, frame: Frame, note: str) -> None:
    """Show the heat maps, tactile images and force curves of a bake's frame in the 3D views."""
    try:
        bake = _bake(scene)
    except PalpateError:
        return  # a new bake whose files are damaged already; its numbers are shown
    if bake is None or frame.frame not in bake.recording.frames:
        return
    recording, present = bake.recording, _present_names(scene)
    scale = _scale(scene, bake)
    overlays.show_bake(scene, bake, frame.frame, scale)
    if scene.palpate.show_inset:
        texels = {present.get(name, name): own for name, own in bake.texels.items()}
        loads = {present.get(name, name): readings.normal_force.sum(axis=1) for name, readings in recording.sensors.items()}
        inset.show(scene, inset.inset_content(scene, frame, texels, recording.frames.astype(float), loads, scale, note))


def _scale(scene, bake: Bake) -> Scale:
    """Return the colours of a bake, whose extent is looked up once for each quantity."""
    style = bake_display.figure_style(scene)
    key = id(bake), style.quantity
    if _extents.get(key, (None,))[0] is not bake:
        sensors = bake.recording.sensors
        sources = ((sensors[name], own) for name, own in bake.texels.items() if style.shown.is_in(sensors[name]))
        _extents.clear()
        _extents[key] = bake, Extent.of(style.shown, sources)
    return style.scale_of(_extents[key][1])


def _present_names(scene) -> dict[str, str]:
    """Return the present names of the sensors of a bake, by their names in the bake: they may have been renamed since."""
    folders = baked_scene.bake_folders(scene)
    return {_names[folder]: obj.name for obj, folder in folders.items() if folder in _names and not identity.is_copy(obj)}


def _recording(scene) -> Recording | None:
    """Return the recording of a scene's sensors; None if it shows no bake. Raises PalpateError if it cannot be read."""
    folders = _folders(scene)
    if folders and all(folder in _new for folder in folders):
        return _new[folders[0]]
    bake = _bake(scene)
    return None if bake is None else bake.recording


def _bake(scene) -> Bake | None:
    """Return the bake that a scene shows; None if it shows none. Raises PalpateError if it cannot be read."""
    folders = _folders(scene)
    if not folders:
        return None
    stamps = [bake_identity.manifest_stamp(folder) for folder in folders]
    if folders not in _read or _read[folders][0] != stamps:
        try:
            _read[folders] = stamps, read_sensors(folders, images=False)
            _names.update({folder: name for name, folder in _read[folders][1].folders.items()})
        except PalpateError as error:
            _read[folders] = stamps, error
    found = _read[folders][1]
    if isinstance(found, PalpateError):
        raise found
    return found


def _folders(scene) -> tuple[Path, ...]:
    return tuple(dict.fromkeys(baked_scene.bake_folders(scene).values()))
