# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample → solve → write, as one generator; the operator and the command line drive it."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...core.errors import SceneError
from ...core.jobs.job_runner import part_of_job
from ...core.jobs.progress import Progress
from ...core.model.recording import Recording
from ...core.model.scenario import Scenario
from ..display import texel_arrows
from ..scene import scene_reader
from ..session import dependencies, first_use, session_state
from ..timeline import playback
from . import bake_files, scene_writer


@dataclass(frozen=True)
class BakeResult:
    """What a bake leaves: the recording, what was solved, and the folder of each sensor."""

    recording: Recording
    scenario: Scenario
    folders: dict[str, Path]


def bake(scene, into_scene: bool = True) -> Generator[Progress, None, BakeResult]:
    """Compute the whole frame range of a scene, write its files, and put the result into the scene.

    With `into_scene` False only files are written, also of objects that are linked and could not hold a bake.

    Until the last step nothing in the scene changes, and an earlier bake stays as it is: closing the generator, an error and a
    kill leave the old or the new bake, never half of one. After a kill the next bake of the same scene goes on where it was.

    Raises
    ------
    PalpateError
        Before anything is touched when the scene or the bake folder is not fit; later when the folder fills up or an
        object that takes part is deleted.
    """
    with session_state.suspended():
        try:
            return (yield from _bake(scene, scene.name, into_scene))
        finally:
            session_state.session.bake = None


def _bake(scene, name: str, into_scene: bool) -> Generator[Progress, None, BakeResult]:
    folder = bake_files.bake_folder(scene)
    bake_files.check_folder(folder)
    total = 2 * max(1, scene.frame_end - scene.frame_start + 1)

    with texel_arrows.hidden_arrows(scene):
        reading = scene_reader.sample_scenario(scene)
        scenario, binding = yield from part_of_job(
            reading, lambda step: _noted(replace(step, stage="Reading the scene", total=total))
        )

    if into_scene:
        scene_writer.check_writable(scene, scenario, binding)
    yield from part_of_job(first_use.wait(), _noted)
    solver = dependencies.solver()
    simulation = solver.Simulation(scenario)
    files = bake_files.BakeFiles(folder, scenario, bpy.data.filepath)
    try:
        frames = files.resume(simulation)
        job = solver.solve(scenario, simulation, frames)
        while True:
            try:
                step = next(job)
            except StopIteration as stop:
                recording = stop.value
                break
            files.write_frame(frames[-1])
            files.save_checkpoint(simulation, frames)
            binding.objects(_still_there(name))
            yield _noted(replace(step, done=total // 2 + step.done, total=total))
        recording = replace(recording, warnings=binding.warnings + recording.warnings)
        scene = _still_there(name)
        binding.objects(scene)
        files.finish(recording)
    except BaseException:
        files.discard()
        raise
    if into_scene:
        scene_writer.write(scene, scenario, binding, recording, files.folders)
        scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)  # the new keyframes show
        playback.baked(scene, recording, files.folders)
    return BakeResult(recording, scenario, files.folders)


def _noted(progress: Progress) -> Progress:
    """Note the progress for the panel and return it."""
    session_state.session.bake = progress
    return progress


def _still_there(name: str):
    scene = bpy.data.scenes.get(name)
    if scene is None:
        raise SceneError(f"Scene '{name}' was deleted or renamed while it was baked: undo that, or start again.")
    return scene
