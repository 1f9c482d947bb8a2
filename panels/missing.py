# SPDX-License-Identifier: GPL-3.0-or-later
"""All that registers when something that Palpate needs cannot be found: a panel that says so."""

import bpy

from ..addon.session import dependencies
from ..operators.debug import PALPATE_OT_debug_info_copy


class PALPATE_PT_missing(bpy.types.Panel):
    bl_label = "Palpate"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "physics"

    lost = ()

    def draw(self, _context):
        column = self.layout.column()
        column.label(text=f"Palpate cannot start: {', '.join(self.lost)} not found.", icon="ERROR")
        column.label(text="Install the zip made for this system and this Blender's Python.")
        column.operator("palpate.debug_info_copy", icon="COPYDOWN")


def register():
    PALPATE_PT_missing.lost = tuple(dependencies.missing_modules())
    bpy.utils.register_class(PALPATE_OT_debug_info_copy)
    bpy.utils.register_class(PALPATE_PT_missing)


def unregister():
    bpy.utils.unregister_class(PALPATE_PT_missing)
    bpy.utils.unregister_class(PALPATE_OT_debug_info_copy)
