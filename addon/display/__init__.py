# SPDX-License-Identifier: GPL-3.0-or-later
"""Display of forces in Blender: heat maps, markers and arrows of a bake, overlays and tactile images while the timeline plays.

What a bake shows is stored in the .blend as Blender's own materials, node groups and keyframed objects, so that it plays where
Palpate is not installed. What playing shows is drawn over the 3D view and is part of no file.
"""

__all__ = [
    "bake_display",
    "bake_identity",
    "baked_scene",
    "baked_sensor",
    "heat_map",
    "indentation",
    "inset",
    "markers",
    "materials",
    "overlays",
    "played_table",
    "texel_arrows",
]
