# SPDX-License-Identifier: GPL-3.0-or-later
"""Connects Blender with core: reads scenes, runs and bakes simulations, and shows, renders and exports what they give.

The packages below stand in the order of their imports: each uses only those before it.
"""

__all__ = [
    "session",
    "properties",
    "scene",
    "study",
    "display",
    "timeline",
    "authoring",
    "bake",
    "render",
    "measured",
    "events",
    "scripting",
]
