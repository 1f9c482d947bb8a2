# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings in files of an older Palpate are updated when the file is opened; see :mod:`.settings_migration`."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core.errors import FileError
from ...core.io.hidden_folder import PRIVATE_FOLDER, is_private_folder
from ..session import session_state
from .scene_properties import EARLIER_FOLDER
from .settings_migration import VERSION, migrate


def apply(version: int = VERSION, steps=None) -> None:
    """Update the settings of all objects and scenes of the file; other versions and steps are for tests."""
    for kind, blocks in (("object", bpy.data.objects), ("scene", bpy.data.scenes)):
        for block in blocks:
            if block.palpate.schema_version not in (0, version):
                _update(block, kind, version, steps)
    for scene in bpy.data.scenes:
        _keep_earlier_folder(scene)


def _keep_earlier_folder(scene) -> None:
    """Let a scene that an earlier version baked into its default folder go on there; new bakes note the settings' version."""
    settings = scene.palpate
    if settings.schema_version or settings.is_property_set("folder"):
        return
    saved = bool(bpy.data.filepath) and is_private_folder(Path(bpy.path.abspath(EARLIER_FOLDER), PRIVATE_FOLDER))
    if settings.baked_digest or saved:
        settings.folder, settings.schema_version = EARLIER_FOLDER, VERSION


def _update(block, kind: str, version: int, steps) -> None:
    before = stored(block)
    try:
        after = migrate(before, kind, block.name, steps, version)
    except FileError as error:
        session_state.session.unreadable_settings[block.name] = str(error)
        return
    for key, value in after.items():
        if before.get(key) != value and hasattr(block.palpate, key):
            setattr(block.palpate, key, value)


def stored(block) -> dict:
    """Return the settings of a data-block as they were saved, including names that this version no longer knows."""
    if hasattr(block, "bl_system_properties_get"):  # Blender 5.0 keeps it apart from custom properties
        system = block.bl_system_properties_get()
        group = system.get("palpate") if system is not None else None
    else:
        group = block.get("palpate")
    return {key: _plain(value) for key, value in group.items()} if group is not None else {}


def _plain(value):
    if hasattr(value, "to_dict"):  # settings within settings, and pointers to objects that point nowhere
        return {key: _plain(item) for key, item in value.items()}
    return list(value) if hasattr(value, "to_list") else value
