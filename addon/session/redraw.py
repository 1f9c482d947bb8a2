# SPDX-License-Identifier: GPL-3.0-or-later
"""Ask Blender to redraw what depends on the timeline."""

from __future__ import annotations

import bpy


def panels() -> None:
    """Redraw panels, but no 3D view, because that may take long."""
    for manager in bpy.data.window_managers:
        for window in manager.windows:
            for area in window.screen.areas:
                if area.type == "PROPERTIES":
                    area.tag_redraw()
                for region in area.regions:
                    if region.type == "UI" and area.type == "VIEW_3D":
                        region.tag_redraw()


def views() -> None:
    """Redraw 3D views and panels."""
    if bpy.app.background:
        return
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES"}:
                area.tag_redraw()
