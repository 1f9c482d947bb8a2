# SPDX-License-Identifier: GPL-3.0-or-later
"""Look again at the frame that is shown when something else than the frame has changed, so that no old number stays unmarked.

Blender reports changes many times a second while a slider is dragged. They are looked at once, a moment after the first.
"""

from __future__ import annotations

import time
from contextlib import suppress

import bpy

from ..display import baked_scene, markers, overlays
from ..scene import participants
from ..session import animation_time, frame_status, redraw, session_state
from . import baked_frames, live_cache, playback

DELAY = 0.1
"""Seconds between a change and the look: short for the eye, long beside the milliseconds that a look takes."""
QUICK = 0.05
"""Seconds of computing after which a slider that is dragged would seem to stick."""

_seconds_per_frame: dict[int, float] = {}
"""By scene: what a frame took when frames were last computed here."""


def soon() -> None:
    """Look at the scenes of all windows in a moment."""
    if not bpy.app.background and not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=DELAY)


def stop() -> None:
    """Forget what was to be looked at."""
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    _seconds_per_frame.clear()


def _look() -> float | None:
    """Timer: look at the scenes of all windows, or come back later where the user is in the middle of something."""
    for window in bpy.context.window_manager.windows:
        if getattr(window, "modal_operators", ()):  # moving an object, say: computing would put it back; not told by 4.2
            return DELAY
        active = window.view_layer.objects.active
        is_edited = active is not None and active.mode not in ("OBJECT", "POSE")  # leaving the mode is a change of its own
        if is_edited:
            note_edit(window.scene, active)
        elif not window.screen.is_animation_playing:  # playing looks at each frame
            look_again(window.scene)
    return None


def note_edit(scene, obj) -> None:
    """Take away what is shown of a frame once painting or editing has changed an object of the simulation."""
    if obj.palpate.role == "NONE" or obj.name not in session_state.session.changed_geometry:
        return
    if frame_status.status_of(scene).frame is not None:
        overlays.clear(scene)
        frame_status.set_status(scene, f"'{obj.name}' has changed since this frame was computed: go on in Object Mode.")


def look_again(scene) -> None:
    """Compare what is shown of a scene with the scene as it is now.

    A bake that is out of date is named so. Frames that were computed while playing are computed again where that is quick, and
    else taken away.
    """
    session = session_state.session
    if session.suspension_depth or session.rendering or session.catching_up or session_state.is_baking():
        return
    if not playback.has_participants(scene):
        return
    depsgraph = participants.depsgraph_of(scene)
    if baked := baked_scene.baked_objects(scene):
        baked_scene.clear_copies(scene)
        markers.follow_names(scene, baked)
        baked_frames.show(scene, depsgraph)
        redraw.views()
        return
    run = live_cache.get(scene)
    frame, part = animation_time.current_frame(scene)
    if run is None or part or frame not in run.frames:
        return
    has_moved = live_cache.has_moved(scene, depsgraph, run)
    if has_moved or live_cache.is_stale(scene, depsgraph, run):
        live_cache.drop(scene)
        overlays.clear(scene)
        frame_status.set_status(scene, "Out of date, something has changed: use Compute to Here, or play from the first frame.")
        if not has_moved:  # what is moved without a keyframe would be put back
            _compute_again(scene)
        redraw.views()


def _compute_again(scene) -> None:
    """Compute the frames up to the present one if that is quick; what it took decides about the next time."""
    count = len(playback.missing_frames(scene))
    known = _seconds_per_frame.get(scene.session_uid, 0.0)
    if not count or count * known > QUICK:
        return
    began, done = time.perf_counter(), 0
    frames = playback.compute_to_present_frame(scene)
    with suppress(StopIteration):
        while time.perf_counter() - began < QUICK:
            next(frames)
            done += 1
    frames.close()
    _seconds_per_frame[scene.session_uid] = (time.perf_counter() - began) / max(done, 1)
