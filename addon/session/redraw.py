# SPDX-License-Identifier: GPL-3.0-or-later
"""Ask the window for a new picture of what depends on the timeline."""

from __future__ import annotations

import bpy


def panels() -> None:
    """Draw panels anew, and nothing of the scene, which may take long."""
    for manager in bpy.data.window_managers:
        for window in manager.windows:
            for area in window.screen.areas:
                if area.type == "PROPERTIES":
                    area.tag_redraw()
                for region in area.regions:
                    if region.type == "UI" and area.type == "VIEW_3D":
                        region.tag_redraw()


def views() -> None:
    """Draw 3D views and panels anew."""
    if bpy.app.background:
        return
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES"}:
                area.tag_redraw()
