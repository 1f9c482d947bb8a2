# SPDX-License-Identifier: GPL-3.0-or-later
"""Saved files hold nothing of what playing has changed."""

from __future__ import annotations

from ..display import materials
from ..properties import start_transforms


def hide(scene) -> None:
    """Undo what playing has changed in the scene; what was computed is kept.

    Also for files that were written without this, as after a crash, and for changes by a run that has been dropped.
    """
    for obj in scene.objects:
        settings = obj.palpate
        if settings.is_baked or not settings.uid:
            continue
        if settings.has_start and obj.is_editable:
            start_transforms.restore_start(obj)
        if obj.type == "MESH" and obj.data.is_editable:
            attribute = obj.data.attributes.get(materials.FORCE)
            if attribute is not None:
                obj.data.attributes.remove(attribute)
