# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings in files of an older Palpate are updated when the file is opened; see :mod:`.migrations`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import bpy

from ...core.errors import FileError
from ...core.io.hidden_folder import PRIVATE_FOLDER, is_private_folder
from ..session import session_state
from .scene_properties import EARLIER_FOLDER

# Update settings that an older Palpate has saved: plain dictionary in, plain dictionary out.
#
# Each step in :data:`STEPS` updates the settings of one kind from its version to the next. A saved version of 0 means that
# nothing was ever set.

VERSION = 1
"""Version of the settings that this Palpate reads and writes."""

Settings = dict[str, Any]
Step = Callable[[Settings], Settings]

STEPS: dict[tuple[str, int], Step] = {}
"""(kind, version) → function that updates settings of that version to the next; kinds are "object" and "scene"."""


def migrate(
    settings: Mapping[str, Any],
    kind: str,
    name: str,
    steps: Mapping[tuple[str, int], Step] | None = None,
    version: int = VERSION,
) -> Settings:
    """Return the settings as they are in this version, with ``schema_version`` set.

    Parameters
    ----------
    settings : mapping
        Settings with ``schema_version``; they are not changed.
    kind : str
        "object" or "scene".
    name : str
        Name of the object or scene, for the message.
    steps, version
        Steps and version for tests; by default those of this version.

    Raises
    ------
    FileError
        The settings were saved by a newer Palpate.
    """
    steps = STEPS if steps is None else steps
    result = dict(settings)
    saved = int(result.get("schema_version", 0))
    if saved > version:
        raise FileError(
            f"The settings of '{name}' were saved by a newer Palpate (version {saved}, this one reads {version}): "
            "install the newer Palpate to use them."
        )
    if saved > 0:
        for old in range(saved, version):
            step = steps.get((kind, old))
            if step is not None:
                result = step(result)
    result["schema_version"] = version
    return result


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
