# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers that show a scene in a window while it is played, scrubbed, edited and rendered."""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from ..authoring import sensor_report, texel_overlay
from ..display import inset, overlays
from ..scene import participants
from ..session import fcurves, first_use, session_state
from ..timeline import playback, second_look
from . import file_handlers


@persistent
def palpate_frame_change_pre(_scene, _depsgraph=None):
    file_handlers.examine_file()


@persistent
def palpate_frame_change_post(scene, depsgraph):
    if depsgraph is not None and depsgraph.view_layer.name == participants.view_layer_of(scene).name:
        playback.on_frame(scene, depsgraph)


@persistent
def palpate_depsgraph_update_post(_scene, _depsgraph):
    second_look.soon()


@persistent
def palpate_load_post(_path):
    playback.forget()
    sensor_report.forget()
    playback.file_is_open()
    second_look.soon()


@persistent
def palpate_undo_post(_scene, _depsgraph=None):
    playback.forget()
    sensor_report.forget()
    session_state.participants_changed()
    second_look.soon()


@persistent
def palpate_save_post(_path):
    for scene in bpy.data.scenes:
        playback.unhide(scene)


@persistent
def palpate_render_begins(scene, _depsgraph=None):
    session = session_state.session
    session.rendering, session.render_note, session.rendered_from = True, "", fcurves.current_frame(scene)


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
    "save_post": palpate_save_post,
    "save_post_fail": palpate_save_post,
    "render_init": palpate_render_begins,
    "render_complete": palpate_render_ends,
    "render_cancel": palpate_render_ends,
}

DRAWN = (
    (overlays.draw, "POST_VIEW"),
    (inset.draw, "POST_PIXEL"),
    (texel_overlay.draw, "POST_VIEW"),
    (texel_overlay.draw_numbers, "POST_PIXEL"),
)
"""What is drawn into each 3D view, and when: with its geometry, or in pixels after it."""
_drawn: list = []


def register():
    for name, function in LISTS.items():
        getattr(bpy.app.handlers, name).append(function)
    first_use.when_ready.append(playback.solver_is_ready)
    session_state.when_settings_change.append(second_look.soon)
    session_state.when_baked.append(playback.show_new_bake)
    if not bpy.app.background:
        _drawn.extend(bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", when) for draw, when in DRAWN)


def unregister():
    while _drawn:
        bpy.types.SpaceView3D.draw_handler_remove(_drawn.pop(), "WINDOW")
    overlays.clear()
    texel_overlay.clear()
    sensor_report.forget()
    session_state.when_settings_change.clear()
    session_state.when_baked.clear()
    second_look.stop()
    first_use.when_ready.clear()
    for name, function in LISTS.items():
        getattr(bpy.app.handlers, name).remove(function)
    playback.forget()
