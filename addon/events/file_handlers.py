# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers that each scene needs, also where nothing is shown: its file is opened and saved, and its objects are edited."""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from ..properties import migrations
from ..scene import moved_bodies, scene_fingerprint
from ..session import first_use, identity, session_state


def examine_file() -> None:
    """Examine the objects of a file once: after it was opened, or at the first event after the add-on was enabled."""
    if session_state.session.file_examined or session_state.session.rendering:
        return
    session_state.session.file_examined = True
    identity.register_owners(bpy.data.objects)
    migrations.apply()
    for scene in bpy.data.scenes:
        moved_bodies.remove_played(scene)  # the file may have been written without save_pre, as after a crash
    if any(obj.palpate.role != "NONE" for obj in bpy.data.objects):
        first_use.begin()


@persistent
def palpate_load_post(_path):
    session_state.reset()
    identity.forget()
    scene_fingerprint.forget()
    examine_file()


@persistent
def palpate_depsgraph_update_post(_scene, depsgraph):
    """Note which objects Blender reports as changed; they are compared at the next frame."""
    examine_file()
    session = session_state.session
    for update in depsgraph.updates:
        block = update.id
        if isinstance(block, bpy.types.Object):
            if update.is_updated_geometry:
                session.changed_geometry.add(block.name)
                session.geometry_version += 1
            if update.is_updated_transform:
                session.changed_motion.add(block.name)


@persistent
def palpate_save_pre(_path):
    from ..timeline import staleness  # a bake that saves no file needs none of it

    identity.separate_copied_scenes()
    for scene in bpy.data.scenes:
        staleness.note_unchanged(scene)
        moved_bodies.remove_played(scene)


LISTS = {
    "load_post": palpate_load_post,
    "depsgraph_update_post": palpate_depsgraph_update_post,
    "save_pre": palpate_save_pre,
}


def register():
    for name, function in LISTS.items():
        getattr(bpy.app.handlers, name).append(function)


def unregister():
    first_use.stop()
    for name, function in LISTS.items():
        getattr(bpy.app.handlers, name).remove(function)
    identity.forget()
    session_state.reset()
