# SPDX-License-Identifier: GPL-3.0-or-later
"""Fix a problem of a sensor that its panel shows."""

import bpy
from bpy.props import EnumProperty

from ..addon.authoring import problems, sensor_report
from . import support


class PALPATE_OT_fix(support.PalpateOperator, bpy.types.Operator):
    """Fix this problem of the active sensor"""

    bl_idname = "palpate.fix"
    bl_label = "Fix Sensor"
    needs = (*support.MESH, support.IS_SENSOR)

    kind: EnumProperty(
        name="Problem",
        description="Problem to fix",
        items=[(kind, label, label) for kind, (label, _) in problems.FIXES.items()],
        options={"SKIP_SAVE"},
    )

    def run(self, context):
        support.leave_edit_mode(context)
        obj = context.object
        problems.fix(obj, self.kind, sensor_report.fresh_report(obj, context.scene))
        left = sensor_report.fresh_report(obj, context.scene).problems
        if left:
            self.report({"WARNING"}, left[0].text)
        else:
            self.report({"INFO"}, f"'{obj.name}' is fixed")
