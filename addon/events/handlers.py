# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of Blender's events. Each calls the modules that act on the event."""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from ..authoring import sensor_report, texel_overlay
from ..display import overlays
from ..properties import migrations
from ..scene import participants
from ..session import first_use, identity, session_state
from ..timeline import playback, second_look, staleness


def _examine_file() -> None:
    """Examine the objects of a file once: after it was opened, or at the first event after the add-on was enabled."""
    if session_state.session.file_examined or session_state.session.rendering:
        return
    session_state.session.file_examined = True
    identity.register_owners(bpy.data.objects)
    migrations.apply()
    for scene in bpy.data.scenes:
        playback.hide(scene)  # the file may have been written without save_pre, as after a crash
    if any(obj.palpate.role != "NONE" for obj in bpy.data.objects):
        first_use.begin()


@persistent
def palpate_frame_change_pre(scene, _depsgraph=None):
    _examine_file()
    playback.before_frame(scene)


@persistent
def palpate_frame_change_post(scene, depsgraph):
    if depsgraph is not None and depsgraph.view_layer.name == participants.view_layer_of(scene).name:
        playback.on_frame(scene, depsgraph)


@persistent
def palpate_depsgraph_update_post(_scene, depsgraph):
    """Note which objects Blender reports as changed; they are compared at the next frame."""
    _examine_file()
    session = session_state.session
    for update in depsgraph.updates:
        block = update.id
        if isinstance(block, bpy.types.Object):
            if update.is_updated_geometry:
                session.changed_geometry.add(block.name)
                session.geometry_version += 1
            if update.is_updated_transform:
                session.changed_motion.add(block.name)
    second_look.soon()


@persistent
def palpate_load_post(_path):
    session_state.reset()
    identity.forget()
    playback.forget()
    sensor_report.forget()
    _examine_file()
    playback.file_is_open()
    second_look.soon()


@persistent
def palpate_undo_post(_scene, _depsgraph=None):
    playback.forget()
    sensor_report.forget()
    session_state.participants_changed()
    second_look.soon()


@persistent
def palpate_save_pre(_path):
    identity.separate_copied_scenes()
    for scene in bpy.data.scenes:
        staleness.note_unchanged(scene)
        playback.hide(scene)


@persistent
def palpate_save_post(_path):
    for scene in bpy.data.scenes:
        playback.unhide(scene)


@persistent
def palpate_render_begins(_scene, _depsgraph=None):
    session_state.session.rendering = True


@persistent
def palpate_render_ends(_scene, _depsgraph=None):
    session_state.session.rendering = False


LISTS = {
    "frame_change_pre": palpate_frame_change_pre,
    "frame_change_post": palpate_frame_change_post,
    "depsgraph_update_post": palpate_depsgraph_update_post,
    "load_post": palpate_load_post,
    "undo_post": palpate_undo_post,
    "redo_post": palpate_undo_post,
    "save_pre": palpate_save_pre,
    "save_post": palpate_save_post,
    "save_post_fail": palpate_save_post,
    "render_init": palpate_render_begins,
    "render_complete": palpate_render_ends,
    "render_cancel": palpate_render_ends,
}


def register():
    for name, function in LISTS.items():
        getattr(bpy.app.handlers, name).append(function)
    first_use.when_ready.append(playback.solver_is_ready)
    session_state.when_settings_change.append(second_look.soon)
    overlays.register()
    texel_overlay.register()


def unregister():
    texel_overlay.unregister()
    overlays.unregister()
    sensor_report.forget()
    session_state.when_settings_change.clear()
    second_look.stop()
    first_use.stop()
    first_use.when_ready.clear()
    for name, function in LISTS.items():
        getattr(bpy.app.handlers, name).remove(function)
    playback.forget()
    identity.forget()
    session_state.reset()
