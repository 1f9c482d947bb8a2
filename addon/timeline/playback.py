# SPDX-License-Identifier: GPL-3.0-or-later
"""The timeline: playing forward computes and shows, scrubbing shows what was computed, and a saved file holds none of it."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import PalpateError
from ...core.geometry.texels import Texels
from ...core.io.bake_folder import RECORDING_NAME
from ...core.io.recording_npz import load_recording
from ...core.io.sensor_npz import SENSOR_NAME, load_sensor
from ...core.jobs.progress import Progress
from ...core.model.recording import Frame, Recording
from ..display import bake_display, baked_scene, inset, materials, overlays
from ..scene import moved_bodies, scene_reader
from ..session import clock, first_use, session_state
from . import live_cache, staleness


@dataclass(frozen=True)
class Status:
    """What the panel says about the present frame: `text`, `frame` when there are numbers to show, and in what `step`s."""

    text: str
    frame: Frame | None = None
    step: str = ""


_status: dict[int, Status] = {}
_refused: dict[int, str] = {}
"""Why the last attempt to compute failed, by scene."""
_waiting: set[int] = set()
"""Scenes that came to a frame before the solver was ready."""
_recordings: dict[Path, Recording | None] = {}
"""Recordings of bakes that were read for the panel, by folder."""


_known_texels: dict[Path, Texels | None] = {}
"""Of their sensors, likewise."""


def status(scene) -> Status:
    """Return what is known about a scene's present frame; cheap enough for drawing."""
    return _status.get(scene.session_uid, Status("Not computed: go to the first frame and play."))


def forget() -> None:
    """Forget everything, because another file is open or undo has changed it."""
    live_cache.clear()
    overlays.clear()
    _status.clear()
    _refused.clear()
    _waiting.clear()
    _recordings.clear()
    _known_texels.clear()
    staleness.forget()


def is_baking() -> bool:
    """Whether a bake is under way."""
    return session_state.session.bake is not None


def has_roles(scene) -> bool:
    """Whether any object takes part; looked up again only when a role may have changed."""
    session, key = session_state.session, scene.session_uid
    if not session.participants_known or session.object_counts.get(key) != len(scene.objects):
        if not session.participants_known:
            session.has_roles.clear()
        session.has_roles[key] = any(obj.palpate.role != "NONE" for obj in scene.objects)
        session.object_counts[key] = len(scene.objects)
        session.participants_known = True
    return session.has_roles.get(key, True)


def before_frame(scene) -> None:
    """Begin a run at the frame that is being left: pressing play on the first frame starts with the second."""
    if not _is_on(scene) or scene.frame_current != scene.frame_start + 1 or not first_use.is_ready():
        return
    depsgraph = scene_reader.view_layer_of(scene).depsgraph
    if depsgraph is None or depsgraph.scene_eval.frame_current != scene.frame_start or depsgraph.scene_eval.frame_subframe:
        return
    run = live_cache.get(scene)
    if run is None or live_cache.is_stale(scene, depsgraph, run):
        _begin(scene, depsgraph)


def on_frame(scene, depsgraph) -> None:
    """Compute or show the frame that the scene has arrived at."""
    if not has_roles(scene) or session_state.session.suspended or _renders_beside_window(scene):
        return
    if baked_scene.baked_objects(scene):
        live_cache.drop(scene)
        overlays.clear(scene)
        _show_bake(scene, depsgraph)
        return
    if not _is_on(scene) or _waits_for_solver(scene):
        return
    (frame, share), run = clock.moment(scene), live_cache.get(scene)
    if not session_state.session.rendering and not share:
        if run is not None and (live_cache.is_stale(scene, depsgraph, run) or _elsewhere(scene, depsgraph, run)):
            live_cache.drop(scene)
            run = None
        if run is None and frame == scene.frame_start:
            run = _begin(scene, depsgraph)
        elif run is not None and frame == run.simulation.frame + 1:
            run = _attempt(scene, lambda: live_cache.go_on(scene, depsgraph, run))
    if run is not None and frame in run.frames:
        show(scene, run)
    else:
        overlays.clear(scene)
        _say(scene, _not_computed(scene, run))
        if not bpy.app.background and not session_state.session.rendering and missing(scene):
            bpy.app.timers.register(_ask_for_the_missing, first_interval=0.0)


def _waits_for_solver(scene) -> bool:
    """Whether nothing can be computed yet, because the solver is being prepared; the panel shows how far that is."""
    if first_use.is_ready():
        return False
    first_use.begin()
    _waiting.add(scene.session_uid)
    overlays.clear(scene)
    _say(scene, "Frames are computed as soon as the solver is ready.")
    return True


def solver_is_ready() -> None:
    """Compute what had to wait; what plays begins anew."""
    waiting = set(_waiting)
    _waiting.clear()
    if is_baking() or session_state.session.catching_up:
        return
    for window in bpy.context.window_manager.windows:
        scene = window.scene
        if scene.session_uid in waiting:
            playing = window.screen.is_animation_playing
            scene.frame_set(scene.frame_start if playing else scene.frame_current)


def _not_computed(scene, run) -> str:
    frame, _ = clock.moment(scene)
    if run is not None:
        return f"Frame {frame} is not computed: play from frame {run.simulation.frame}, or use Compute to Here."
    reason = _refused.get(scene.session_uid)
    return reason or f"Frame {frame} is not computed: go to the first frame and play, or use Compute to Here."


def missing(scene) -> range:
    """Return the frames that have to be computed so that the present one can be shown; none where nothing can be done."""
    if not _is_on(scene) or scene.session_uid in _refused:
        return range(0)
    (frame, share), run = clock.moment(scene), live_cache.get(scene)
    first = scene.frame_start if run is None else run.simulation.frame + 1
    return range(first, min(frame + bool(share), scene.frame_end) + 1)


def catch_up(scene) -> Generator[Progress, None, None]:
    """Compute what is missing up to the present frame, and come back to it. Closing the generator keeps what is computed."""
    yield from first_use.wait()
    wanted, frames = (scene.frame_current, scene.frame_subframe), missing(scene)
    session_state.session.catching_up = True
    try:
        with clock.unstretched(scene):
            for done, number in enumerate(frames, 1):
                scene.frame_set(number)
                run = live_cache.get(scene)
                if run is None or number not in run.frames:
                    break  # the panel says why
                yield Progress("Computing forces", done, len(frames), number)
    finally:
        session_state.session.catching_up = False
        with suppress(ReferenceError):  # the scene went meanwhile
            scene.frame_set(wanted[0], subframe=wanted[1])


def _ask_for_the_missing() -> None:
    """After a jump, in the window: what is missing is computed with progress. Not in the handler, which must not last."""
    scene = bpy.context.scene
    if scene is not None and not is_baking() and not session_state.session.catching_up and missing(scene):
        bpy.ops.palpate.catch_up("INVOKE_DEFAULT")


def _is_on(scene) -> bool:
    return (
        scene.palpate.use_live
        and not session_state.session.suspended
        and has_roles(scene)
        and not baked_scene.baked_objects(scene)
    )


def _renders_beside_window(scene) -> bool:
    """Whether a render runs in a thread of its own, while the window could touch the same objects."""
    return session_state.session.rendering and not bpy.app.background and not scene.render.use_lock_interface


def _elsewhere(scene, depsgraph, run) -> bool:
    return clock.moment(scene)[0] in run.frames and live_cache.has_moved(scene, depsgraph, run)


def _begin(scene, depsgraph):
    return _attempt(scene, lambda: live_cache.begin(scene, depsgraph))


def _attempt(scene, work):
    """Do it, or keep for the panel why it cannot be done: a report at every frame would be in the way."""
    try:
        result = work()
    except PalpateError as error:
        live_cache.drop(scene)
        _refused[scene.session_uid] = str(error)
        return None
    _refused.pop(scene.session_uid, None)
    return result


def _say(scene, text: str, frame: Frame | None = None, step: str = "") -> None:
    _status[scene.session_uid] = Status(text, frame, step)


def show(scene, run) -> None:
    """Put free bodies and heat maps where the run has them at the present frame."""
    number, share = clock.moment(scene)
    frame = run.frames[number]
    objects = run.binding.objects(scene)
    for index, placement in run.placements.items():
        if number == run.scenario.frame_start and not share:
            moved_bodies.restore(objects[index])
        else:
            _place(run, objects[index], placement, index, number, share)
        run.written[index] = moved_bodies.channels(objects[index])
    for sensor, obj in zip(run.scenario.sensors, run.binding.sensor_objects(scene), strict=True):
        if sensor.readout and obj is not None:
            _write_force(obj, sensor.texels.vertex, frame.sensors[sensor.name].normal_force)
    overlays.show(scene, run, frame)
    warnings = run.binding.warnings + tuple(run.simulation.warnings)
    _say(scene, " ".join(warnings) or f"Frame {number} computed.", frame, run.simulation.step_reason)


def _place(run, obj, placement, index: int, number: int, share: float) -> None:
    """Put a free body where it is at a frame, or on the way to the next, as the keyframes of a bake would."""

    def channels(frame: int, before=None) -> np.ndarray:
        return placement.pose(obj, run.frames[frame].poses[index], run.moments[frame].parents[index], before)

    first = number == run.scenario.frame_start
    here = placement.channels if first else channels(number)
    if share and number + 1 in run.frames:
        here = here + share * (channels(number + 1, here) - here)
    placement.put(obj, here)


def _write_force(obj, vertex: np.ndarray, force: np.ndarray) -> None:
    mesh = obj.data
    if obj.mode == "EDIT" or not mesh.is_editable:
        return
    attribute = mesh.attributes.get(materials.FORCE) or mesh.attributes.new(materials.FORCE, "FLOAT", "POINT")
    values = np.zeros(len(mesh.vertices), dtype=np.float32)
    values[vertex] = force
    attribute.data.foreach_set("value", values)
    mesh.update_tag()


def _show_bake(scene, depsgraph) -> None:
    """Keyframes and material show the bake by themselves; only the panel's numbers come from its recording."""
    number, _ = clock.moment(scene)
    sensors, poses, velocities, recording = {}, np.zeros((0, 7)), np.zeros((0, 6)), None
    for obj in baked_scene.baked_objects(scene):
        found = _recording(obj)
        if found is not None:
            recording = found
            if number in found.frames:
                sensors.update(found.at(number).sensors)
    if not sensors:
        _say(scene, f"Frame {number} is outside of the bake.")
        return
    text = f"Frame {number} of the bake."
    if staleness.is_stale(scene, depsgraph, recording):
        text = "The bake is out of date, something has changed since: bake again."
    frame = Frame(number, 0.0, sensors, poses, velocities)
    _say(scene, text, frame, recording.step_reason)
    if scene.palpate.show_inset and not bpy.app.background:
        _show_board(scene, frame)


def _show_board(scene, frame: Frame) -> None:
    """Show the tactile images and curves of a bake's present frame."""
    sensors, texels, last = {}, {}, None
    for obj in baked_scene.baked_objects(scene):
        recording, own = _recording(obj), _texels(obj)
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


def _texels(obj):
    """Return the texels of a sensor's bake, read when they are first asked for; None when they are not there."""
    place = baked_scene.bake_folder(obj)
    if place is not None and place not in _known_texels:
        try:
            _known_texels[place] = load_sensor(place / SENSOR_NAME)[0]
        except PalpateError:
            _known_texels[place] = None
    return _known_texels.get(place)


def _recording(obj):
    """Return the recording of a sensor's bake, read when it is first asked for; None when it is not there."""
    place = baked_scene.bake_folder(obj)
    if place is None:
        return None
    if place not in _recordings:
        try:
            _recordings[place] = load_recording(place / RECORDING_NAME)
        except PalpateError:
            _recordings[place] = None
    return _recordings[place]


def baked(scene, recording, places) -> None:
    """Give way to a new bake, and keep its recording for the panel."""
    live_cache.drop(scene)
    overlays.clear(scene)
    _recordings.clear()
    _known_texels.clear()
    for place in places.values():
        _recordings[place] = recording
    scene.palpate.baked_fingerprint = staleness.fingerprint(scene)
    _show_bake(scene, scene_reader.depsgraph_of(scene))


# --- files hold nothing of it


def hide(scene) -> None:
    """Put everything back as it was before playing; what was computed is kept.

    Also for files that were written without this, as by a crash, and for what a run has left that is stale by now.
    """
    for obj in scene.objects:
        settings = obj.palpate
        if settings.is_baked or not settings.uid:
            continue
        if settings.has_start and obj.is_editable:
            moved_bodies.restore(obj)
        if obj.type == "MESH" and obj.data.is_editable:
            attribute = obj.data.attributes.get(materials.FORCE)
            if attribute is not None:
                obj.data.attributes.remove(attribute)


def unhide(scene) -> None:
    """Show the present frame again after :func:`hide`."""
    run = live_cache.get(scene)
    if run is not None and clock.moment(scene)[0] in run.frames:
        _attempt(scene, lambda: show(scene, run))


def reset(scene) -> None:
    """Back to the start: free bodies where they were, nothing computed."""
    hide(scene)
    live_cache.drop(scene)
    overlays.clear(scene)
    _status.pop(scene.session_uid, None)
    _refused.pop(scene.session_uid, None)
