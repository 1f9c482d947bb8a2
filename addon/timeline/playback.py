# SPDX-License-Identifier: GPL-3.0-or-later
"""The timeline: playing forward computes and shows frames, scrubbing shows computed frames; saved files hold none of them."""

from __future__ import annotations

import sys
from collections.abc import Generator

import bpy
import numpy as np

from ...core.errors import PalpateError
from ...core.jobs import Progress
from ..display import baked_scene, overlays
from ..properties import object_properties
from ..scene import mesh_arrays, moved_bodies, participants, scene_fingerprint, stored_names
from ..session import fcurves, first_use, frame_status, session_state
from . import baked_frames, live_cache

_errors: dict[int, str] = {}
"""By scene: why the last attempt to compute failed."""
_waiting: set[int] = set()
"""Scenes that arrived at a frame before the solver was ready."""


def forget() -> None:
    """Forget everything, because another file is open or undo has changed it."""
    live_cache.drop()
    overlays.clear()
    frame_status.forget()
    _errors.clear()
    _waiting.clear()
    baked_frames.forget()
    scene_fingerprint.forget()


def has_participants(scene) -> bool:
    """Return True when any object has a role; looked up again only when a role may have changed."""
    known, count = session_state.session.has_roles, len(scene.objects)
    if known.get(scene.session_uid, (None,))[0] != count:
        known[scene.session_uid] = count, any(obj.palpate.role != "NONE" for obj in scene.objects)
    return known[scene.session_uid][1]


def on_frame(scene, depsgraph) -> None:
    """Compute or show the frame at which the scene has arrived."""
    if not has_participants(scene) or session_state.session.suspension_depth:
        return
    if session_state.session.rendering:
        _note_missing(scene)
    if _renders_beside_window(scene):
        return
    if baked_scene.baked_objects(scene):
        live_cache.drop(scene)
        overlays.clear(scene)
        baked_frames.show(scene, depsgraph)
        return
    if not _is_on(scene) or _waits_for_solver(scene):
        return
    run = live_cache.get(scene)
    frame, part = fcurves.current_frame(scene)
    if not session_state.session.rendering and not part:
        run = _updated_run(scene, depsgraph, run, frame)
    if run is not None and frame in run.frames:
        show(scene, run)
    elif not _waits_for_solver(scene):
        overlays.clear(scene)
        frame_status.set_status(scene, _not_computed(scene, run))
        is_busy = session_state.session.rendering or session_state.session.catching_up
        if not bpy.app.background and not is_busy and missing_frames(scene):
            bpy.app.timers.register(offer_to_compute, first_interval=0.0)


def _note_missing(scene) -> None:
    """Note once in a render that it shows neither forces nor the motion of free bodies, as nothing is computed meanwhile."""
    session, run, here = session_state.session, live_cache.get(scene), fcurves.current_frame(scene)
    is_shown = run is not None and here[0] in run.frames and not _renders_beside_window(scene)
    if session.render_note or here == session.rendered_from or is_shown or baked_scene.baked_objects(scene):
        return
    session.render_note = f"'{scene.name}' is rendered without forces, and free bodies stay in their place: bake it first."
    print(session.render_note, file=sys.stderr)


def _updated_run(scene, depsgraph, run, frame: int):
    """Return the run of a scene after its arrival at a frame: started, advanced, as it was, or None if it was dropped."""
    if run is not None and (
        live_cache.is_stale(scene, depsgraph, run) or frame in run.frames and live_cache.has_moved(scene, depsgraph, run)
    ):
        live_cache.drop(scene)
        run = None
    if run is None and frame == scene.frame_start:
        return _start(scene, depsgraph)
    if run is None and frame == scene.frame_start + 1:  # Play on the first frame evaluates the second one next
        with live_cache.at_other_frames(scene):  # as animation has it, without what was moved there and not keyframed
            scene.frame_set(scene.frame_start)
            run = _start(scene, participants.depsgraph_of(scene))
    if run is not None and frame == run.simulation.frame + 1:
        return _attempt(scene, lambda: live_cache.advance(scene, depsgraph, run))
    return run


def _waits_for_solver(scene) -> bool:
    """Return True when a scene is too large to be computed before the solver is compiled."""
    if first_use.is_ready():
        return False
    first_use.begin()
    if scene.session_uid not in _waiting:
        return False
    overlays.clear(scene)
    frame_status.set_status(scene, "Frames are computed as soon as the solver is compiled.")
    return True


def solver_is_ready() -> None:
    """Compute the frames that had to wait for the solver; a scene that plays starts again."""
    waiting = set(_waiting)
    _waiting.clear()
    session = session_state.session
    if session.suspension_depth or session.catching_up:
        return
    for window in bpy.context.window_manager.windows:
        scene = window.scene
        if scene.session_uid in waiting:
            playing = window.screen.is_animation_playing
            frame = (scene.frame_start, 0.0) if playing else (scene.frame_current, scene.frame_subframe)
            scene.frame_set(frame[0], subframe=frame[1])


def _not_computed(scene, run) -> str:
    """Return why the present frame cannot be shown, and what to do."""
    frame, _ = fcurves.current_frame(scene)
    if run is None and scene.session_uid in _errors:
        return _errors[scene.session_uid]
    start = "the first frame" if run is None else f"frame {run.simulation.frame}"
    return f"Frame {frame} is not computed: play from {start}, or use Compute to Here."


def missing_frames(scene) -> range:
    """Return the frames that have to be computed to show the present one; empty when they cannot be computed."""
    if not _is_on(scene) or scene.session_uid in _errors:
        return range(0)
    (frame, part), run = fcurves.current_frame(scene), live_cache.get(scene)
    first = scene.frame_start if run is None else run.simulation.frame + 1
    return range(first, min(frame + bool(part), scene.frame_end) + 1)


def forget_error(scene) -> None:
    """Forget why the last attempt failed, because something has changed since."""
    _errors.pop(scene.session_uid, None)


def compute_to_present_frame(scene) -> Generator[Progress, None, None]:
    """Compute the missing frames up to the present one, and return to it. Closing the generator keeps what was computed.

    A render that begins meanwhile ends it, and so does whoever moves the scene to another frame; the scene then stays there.
    """
    if scene.session_uid in _waiting:
        yield from first_use.wait()
    frames, session, number = missing_frames(scene), session_state.session, scene.frame_current
    session.catching_up = True

    def is_taken() -> bool:
        return session.rendering or scene.frame_current != number

    try:
        # At the return to the present frame still catching up, so that what was stopped does not start again.
        with fcurves.frame_kept(scene, unless=is_taken), fcurves.without_time_stretching(scene):
            for done, number in enumerate(frames, 1):
                scene.frame_set(number)
                if scene.session_uid in _waiting:
                    yield from first_use.wait()
                    scene.frame_set(number)
                run = live_cache.get(scene)
                if run is None or number not in run.frames:
                    break  # the panel says why
                yield Progress("Computing forces", done, len(frames), number)
                if is_taken():
                    break
    finally:
        session.catching_up = False


def file_is_open() -> None:
    """Compute up to the present frame of a file that was saved at a later one than its first."""
    if not bpy.app.background:
        bpy.app.timers.register(_compute_opened_file, first_interval=0.1)


def _compute_opened_file() -> None:
    """Timer after a file was opened."""
    scene = bpy.context.scene
    if scene is not None and scene.frame_current > scene.frame_start:
        offer_to_compute()


def offer_to_compute() -> None:
    """Timer after a jump or a change: compute the missing frames with progress. The handler itself must return at once."""
    scene = bpy.context.scene
    if scene is not None and bpy.ops.palpate.catch_up.poll():
        bpy.ops.palpate.catch_up("INVOKE_DEFAULT", by_itself=True)


def _is_on(scene) -> bool:
    """Return True when playing this scene computes frames."""
    return (
        scene.palpate.use_live
        and not session_state.session.suspension_depth
        and has_participants(scene)
        and not baked_scene.baked_objects(scene)
    )


def _renders_beside_window(scene) -> bool:
    """Return True when a render runs in its own thread, while the window could change the same objects."""
    return session_state.session.rendering and not bpy.app.background and not scene.render.use_lock_interface


def _start(scene, depsgraph):
    run = _attempt(scene, lambda: live_cache.start(scene, depsgraph))
    if run is None and scene.session_uid not in _errors:
        _waiting.add(scene.session_uid)
    return run


def _attempt(scene, work):
    """Call `work` and return its result; if it fails, keep the reason for the panel instead of a report at every frame."""
    try:
        result = work()
    except PalpateError as error:
        live_cache.drop(scene)
        _errors[scene.session_uid] = str(error)
        return None
    _errors.pop(scene.session_uid, None)
    return result


def show(scene, run) -> None:
    """Show bodies and heat maps as a run has computed them at the present frame."""
    number, part = fcurves.current_frame(scene)
    frame = run.frames[number]
    objects = run.reading.objects(scene)
    for index, placement in run.placements.items():
        if number == run.scenario.frame_start and not part:
            object_properties.restore_start(objects[index])
        else:
            _place(run, objects[index], placement, index, number, part)
        run.placed_channels[index] = object_properties.transform_channels(objects[index])
    for sensor, obj in zip(run.scenario.sensors, run.reading.sensor_objects(scene), strict=True):
        if sensor.readout and obj is not None and obj.mode != "EDIT" and obj.data.is_editable:
            force = frame.sensors[sensor.name].normal_force  # for the live heat map, at the vertices of the texels
            mesh_arrays.store(obj.data, stored_names.FORCE, force, sensor.texels.vertex, "FLOAT")
            obj.data.update_tag()
    overlays.show(scene, run, frame)
    warnings = run.reading.warnings + tuple(run.simulation.warnings)
    frame_status.set_status(scene, f"Frame {number} computed.", frame, run.simulation.step_reason, " ".join(warnings))


def _place(run, obj, placement, index: int, number: int, part: float) -> None:
    """Move a body to its pose at a frame, or between it and the next one, as keyframes of a bake would."""

    def channels(frame: int, before=None) -> np.ndarray:
        return placement.channels_at(obj, run.frames[frame].poses[index], run.samples[frame].parent_matrices[index], before)

    first = number == run.scenario.frame_start
    here = placement.channels if first else channels(number)
    if part and number + 1 in run.frames:
        here = here + part * (channels(number + 1, here) - here)
    placement.move(obj, here)


def show_new_bake(scene, recording, folders) -> None:
    """Drop the live run, because a bake was put into the scene, and show the bake's present frame.

    Parameters
    ----------
    scene : Scene
    recording : Recording
    folders : dict of str to Path
        Of the sensors.
    """
    live_cache.drop(scene)
    overlays.clear(scene)
    baked_frames.remember(recording, folders)
    baked_frames.show(scene, participants.depsgraph_of(scene))


def unhide(scene) -> None:
    """Show the present frame again after :func:`.moved_bodies.remove_played`."""
    run = live_cache.get(scene)
    if run is not None and fcurves.current_frame(scene)[0] in run.frames:
        _attempt(scene, lambda: show(scene, run))


def reset(scene) -> None:
    """Move bodies back to their start and forget what was computed."""
    moved_bodies.remove_played(scene)
    live_cache.drop(scene)
    overlays.clear(scene)
    frame_status.forget(scene)
    forget_error(scene)
