# SPDX-License-Identifier: GPL-3.0-or-later
"""Ask the window for a new picture of what depends on the timeline."""

from __future__ import annotations

import bpy


def views() -> None:
    """Draw 3D views and panels anew."""
    if bpy.app.background:
        return
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES"}:
                area.tag_redraw()
