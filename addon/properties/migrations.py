# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings in files of other versions of Palpate, when a file is opened.

No property has been renamed since the first version. One that is has to be read here under its former name.
"""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core.io.hidden_folder import PRIVATE_FOLDER, is_private_folder
from ..session import session_state
from .scene_properties import EARLIER_FOLDER

VERSION = 1
"""Version of the settings that this Palpate reads and writes. A saved version of 0 means that nothing was ever set."""


def apply() -> None:
    """Note which settings of the file a newer Palpate has saved, and let scenes go on in the bake folder of before."""
    for block in (*bpy.data.objects, *bpy.data.scenes):
        saved = block.palpate.schema_version
        if saved > VERSION:
            session_state.session.unreadable_settings[block.name] = (
                f"The settings of '{block.name}' were saved by a newer Palpate (version {saved}, this one reads {VERSION}): "
                "install the newer Palpate to use them."
            )
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
