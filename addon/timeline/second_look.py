# SPDX-License-Identifier: GPL-3.0-or-later
"""Look again at the frame that is shown when something else than the frame has changed, so that no old number stays unmarked.

Blender reports changes many times a second while a slider is dragged. They are looked at once, a moment after the first.
"""

from __future__ import annotations

import time
from contextlib import suppress

import bpy

from ..display import baked_scene, markers, overlays
from ..scene import participants, scene_fingerprint
from ..session import fcurves, frame_status, session_state
from . import baked_frames, live_cache, playback

DELAY = 0.1
"""Seconds between a change and the look: short for the eye, long beside the milliseconds that a look takes."""
QUICK = 0.05
"""Seconds of computing after which a slider that is dragged would seem to stick."""
PAUSE = 0.5
"""Seconds without a change after which what takes longer is computed, with progress: the slider has stopped."""

_seconds_per_frame: dict[int, float] = {}
"""By scene: what a frame took when frames were last computed here."""
_dropped: set[int] = set()
"""Scenes whose frames were taken away here and have to be computed again."""


def soon() -> None:
    """Look at the scenes of all windows in a moment."""
    if bpy.app.background:
        return
    if not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=DELAY)
    if bpy.app.timers.is_registered(_compute_missing):
        compute_later()


def compute_later() -> None:
    """Compute the missing frames, with progress, once nothing has changed for a while."""
    if bpy.app.timers.is_registered(_compute_missing):
        bpy.app.timers.unregister(_compute_missing)
    if not bpy.app.background:
        bpy.app.timers.register(_compute_missing, first_interval=PAUSE)


def _compute_missing() -> float | None:
    """Timer: compute the missing frames, or come back later where the user is in the middle of something."""
    if _user_is_busy():
        return PAUSE
    return playback.offer_to_compute()


def _user_is_busy() -> bool:
    """Return True while an object is moved, or edited: computing would put it back. Blender 4.2 does not tell the former."""
    for window in bpy.context.window_manager.windows:
        if getattr(window, "modal_operators", ()) or _edited(window) is not None:
            return True
    return False


def _edited(window):
    """Return the object that is edited or painted in a window, or None; leaving that mode is a change of its own."""
    active = window.view_layer.objects.active
    return active if overlays.is_edited(active) else None


def stop() -> None:
    """Forget what was to be looked at."""
    for timer in (_look, _compute_missing):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
    _seconds_per_frame.clear()
    _dropped.clear()


def _look() -> float | None:
    """Timer: look at the scenes of all windows, or come back later where the user is in the middle of something."""
    if session_state.session.catching_up:
        return DELAY
    for window in bpy.context.window_manager.windows:
        if getattr(window, "modal_operators", ()):
            return DELAY
        if (edited := _edited(window)) is not None:
            note_edit(window.scene, edited)
        elif not window.screen.is_animation_playing:  # playing looks at each frame
            look_again(window.scene)
    return None


def note_edit(scene, obj) -> None:
    """Say so once painting has changed what a shown frame was computed from; it is computed again in Object Mode."""
    session = session_state.session
    if obj.palpate.role == "NONE" or obj.name not in session.changed_geometry or obj.mode not in overlays.PAINT_MODES:
        return
    depsgraph, run = participants.depsgraph_of(scene), live_cache.get(scene)
    if baked_scene.baked_objects(scene):
        baked_frames.show(scene, depsgraph)
    elif run is not None and frame_status.status_of(scene).frame is not None and live_cache.is_stale(scene, depsgraph, run):
        session.changed_geometry.add(obj.name)  # it is looked at again in Object Mode
        overlays.clear(scene)
        frame_status.set_status(scene, f"'{obj.name}' has changed since this frame was computed: go on in Object Mode.")


def look_again(scene) -> None:
    """Compare what is shown of a scene with the scene as it is now.

    A bake that is out of date is named so. Frames that were computed while playing are computed again: at once where that is
    quick, else with progress once nothing changes any more.
    """
    session = session_state.session
    if session.suspension_depth or session.rendering or session.catching_up:
        return
    if not playback.has_participants(scene):
        return
    depsgraph = participants.depsgraph_of(scene)
    if baked := baked_scene.baked_objects(scene):
        baked_scene.clear_copies(scene)
        markers.follow_names(scene, baked)
        baked_frames.show(scene, depsgraph)
        session_state.redraw_views()
        return
    run = live_cache.get(scene)
    frame, part = fcurves.current_frame(scene)
    is_shown = run is not None and frame in run.frames
    if part or not is_shown and scene.session_uid not in _dropped:
        return  # no numbers were taken away
    has_moved = is_shown and live_cache.has_moved(scene, depsgraph, run)
    if run is not None and not has_moved and not live_cache.is_stale(scene, depsgraph, run):
        if is_shown:
            _dropped.discard(scene.session_uid)
            if not overlays.is_up_to_date(scene):
                overlays.show(scene, run, run.frames[frame])
        return
    live_cache.drop(scene)
    overlays.clear(scene)
    frame_status.set_status(scene, "Out of date, something has changed: use Compute to Here, or play from the first frame.")
    _dropped.add(scene.session_uid)
    playback.forget_error(scene)
    blocks = scene_fingerprint.related_data_blocks(participants.find_participants(scene)[0])
    if not any(fcurves.has_other_values(block, frame) for block in blocks):  # what is not keyframed would be put back
        _compute_again(scene)
        if playback.missing_frames(scene):
            compute_later()
    session_state.redraw_views()


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
