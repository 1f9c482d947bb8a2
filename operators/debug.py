# SPDX-License-Identifier: GPL-3.0-or-later
"""Help us help. Works without any of Palpate's dependencies."""

import bpy

from ..addon.session import dependencies


class PALPATE_OT_debug_info_copy(bpy.types.Operator):
    """Copy versions and missing modules, to be pasted into a bug report"""

    bl_idname = "palpate.debug_info_copy"
    bl_label = "Copy Debug Info"

    def execute(self, context):
        context.window_manager.clipboard = dependencies.debug_info()
        self.report({"INFO"}, "Debug info is on the clipboard")
        return {"FINISHED"}
