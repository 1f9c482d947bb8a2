# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake, step by step. Operator and command line drive the job :func:`bake`, which is its table of contents::

open → read scene → scenario → model → step, forces, readings, images of each frame → seal → publish → report
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from ...core.errors import SceneError
from ...core.io.bake_folder import BakeOwner
from ...core.io.file_writing import writable_folder
from ...core.jobs import Job, Progress, part_of_job
from ...core.model.recording import Recording
from ...core.model.scenario import Scenario
from ...core.skins.channel_readouts import with_clipping_warnings
from ..scene import scene_fingerprint, scene_reader
from ..scene.scene_reading import SceneReading
from ..session import first_use, identity, session_state
from . import bake_files

if TYPE_CHECKING:
    from ...core.io.bake_reader import Bake


@dataclass(frozen=True)
class BakeResult:
    """The result of a bake.

    Attributes
    ----------
    recording : Recording
    scenario : Scenario
        What was solved.
    folders : dict of str to Path
        Bake folder of each sensor, by the sensor's name.
    """

    recording: Recording
    scenario: Scenario
    folders: dict[str, Path]


def bake(scene, into_scene: bool = True, images: bool = True, blend: bake_files.BlendToSave | None = None) -> Job[BakeResult]:
    """Compute the whole frame range of a scene, write the files, and put the result into the scene.

    Nothing in the scene changes before the last step, and an earlier bake stays as it is until then, also if the generator is
    closed. A kill in the last step may leave files of both bakes, which their readers say (:mod:`...core.io.bake_folder`).

    Parameters
    ----------
    scene : Scene
    into_scene : bool
        False writes the files only. Use it where objects are linked from other files and cannot show a bake.
    images : bool
        False writes the recordings alone, as for a million frames. A scene cannot show such a bake: `into_scene` is False too.
    blend : BlendToSave, optional
        The .blend to save with the bake: the old one stays in its place until all of the bake is. The scene in memory shows the
        new bake before that step.

    Raises
    ------
    PalpateError
        Before anything changes, if the scene or the bake folder is unsuitable; later, if the folder fills up or if the user
        deletes an object that is part of the simulation.
    """
    if into_scene and not images:
        raise ValueError("a scene shows a bake by its images")
    name, first, total = scene.name, scene.frame_start, _total(scene)
    with session_state.suspended():
        folder = bake_files.bake_folder(scene)  # it need not exist yet, and is not made before the scene is read
        writable_folder(folder if os.path.exists(folder) else folder.parent)
        reading = yield from _read(scene)
        scenario = reading.scenario
        if into_scene:
            _scene_writer().check_writable(scene, reading)
        yield from first_use.wait(scenario)
        bake_files.check_space(folder, scenario, images)
        simulation = first_use.load_solver().Simulation(scenario)
        owner = _owner(scene, into_scene, blend)
        with bake_files.BakeFiles(folder, scenario, owner, images) as files:
            for frame in simulation.frames():  # a step, its forces and readings
                files.write(frame)
                yield Progress("Computing forces", total // 2 + frame.frame - first + 1, total, frame.frame)
                reading.objects(_scene_called(name))  # raises if the user has deleted one
            warnings = (*reading.warnings, *simulation.warnings)
            recording = with_clipping_warnings(files.recording(simulation.dt, warnings, simulation.step_reason))
            files.seal(recording)
            if blend is not None:
                _show(_scene_called(name), reading, recording, files.folders, files.bake_id, owner.scene_id)
            files.publish(blend)
        if into_scene and blend is None:
            _show(_scene_called(name), reading, recording, files.folders, files.bake_id, owner.scene_id)
        return BakeResult(recording, scenario, files.folders)


def show_bake(scene, found: Bake) -> Job[None]:
    """Put a bake that was written without its .blend (:func:`bake` without `into_scene`) into the scene; nothing is computed.

    The scene gets the bake's frame range, and sensors that the bake has not become pads, as they were for it.

    Parameters
    ----------
    scene : Scene
    found : Bake
        From :func:`.bake_reader.read_bake`, with tactile images.

    Raises
    ------
    PalpateError
        The bake is not of this scene as it is now, it has no images, or the scene cannot show it.
    """
    from ..display import bake_identity

    manifest = next(iter(found.manifests.values()))
    place = next(iter(found.folders.values())).parent
    sensors = {obj.name: obj for obj in scene.objects if obj.palpate.role == "SENSOR"}
    for name in found.manifests:
        if name not in sensors:
            raise SceneError(f"The bake in '{place}' has a sensor '{name}', which '{scene.name}' has not: choose another.")
    bake_identity.require_images(found)
    if missing := [name for name in manifest.sensors if name not in found.manifests]:
        raise SceneError(f"The bake in '{place}' also has the sensor '{missing[0]}': give the folder of the whole bake.")
    with session_state.suspended():
        for name, obj in sensors.items():
            if name not in found.manifests:
                obj.palpate.role = "PAD"
        scene.frame_start, scene.frame_end = (int(found.recording.frames[end]) for end in (0, -1))
        reading = yield from _read(scene)
        if reading.scenario.digest() != manifest.digest:
            raise SceneError(
                f"The bake in '{place}' is not of '{scene.name}' as it is now: something that forces depend on has "
                "changed since, or options of the bake changed it; bake again, or use a .blend that was saved with its bake."
            )
        _scene_writer().check_writable(scene, reading)
        _show(scene, reading, found.recording, found.folders, manifest.bake_id, identity.scene_id(scene))


def _total(scene) -> int:
    """Return the number of steps of a bake, which reads every frame and then solves it."""
    return 2 * max(1, scene.frame_end - scene.frame_start + 1)


def _read(scene) -> Job[SceneReading]:
    """Read a scene as the first half of a bake."""
    total = _total(scene)
    return part_of_job(scene_reader.read_scene(scene), lambda step: replace(step, stage="Reading the scene", total=total))


def _scene_writer():
    """Return the module that puts a bake into its scene; a bake that only writes files does not load it."""
    from . import scene_writer

    return scene_writer


def _owner(scene, into_scene: bool, blend: bake_files.BlendToSave | None) -> BakeOwner:
    """Return the scene as the owner of its bake. It gets an id only where the bake is put into it, and so can be saved."""
    opened = Path(bpy.data.filepath) if bpy.data.filepath else None
    others = frozenset(identity.scene_id(other) for other in bpy.data.scenes if other != scene) - {""}
    saved = opened if blend is None else blend.path
    scene_id = identity.scene_id(scene) or (identity.new_scene_id(scene, saved) if into_scene else "")
    return BakeOwner(scene_id, saved, opened, others)


def _show(scene, reading: SceneReading, recording: Recording, folders: dict[str, Path], bake_id: str, scene_id: str) -> None:
    """Put the result into the scene and evaluate the present frame again, so that the new keyframes take effect."""
    _scene_writer().write(scene, reading, recording, folders)
    scene.palpate.scene_id, scene.palpate.baked_id = scene_id, bake_id
    scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)
    scene.palpate.baked_fingerprint = scene_fingerprint.fingerprint(scene)
    for show in session_state.when_baked:
        show(scene, recording, folders)


def _scene_called(name: str):
    """Return the scene that is being baked; looked up by name, because the user may delete it meanwhile."""
    scene = bpy.data.scenes.get(name)
    if scene is None:
        raise SceneError(f"Scene '{name}' was deleted or renamed while it was baked: undo that, or start again.")
    return scene
