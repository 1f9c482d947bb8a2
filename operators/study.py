# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for studies: vary a property, write the study's file, run it beside the window, open its report.

What reads and writes studies is imported when it is needed: it loads scipy and numba.
"""

import bpy
from bpy.props import IntProperty, StringProperty

from . import modal_job, support


class PALPATE_OT_study_vary(support.PalpateOperator, bpy.types.Operator):
    """Vary this property in the study of the scene: it gets a range in the panel Study"""

    bl_idname = "palpate.study_vary"
    bl_label = "Vary in Study"
    needs = (support.NO_STUDY, support.SCENE)

    path: StringProperty(
        name="Path", description="Path of the property, as Copy Full Data Path gives it", options={"SKIP_SAVE"}
    )

    def invoke(self, context, _event):
        if self.path:
            return self.execute(context)
        return context.window_manager.invoke_props_dialog(self)  # by F3

    def run(self, context):
        from ..addon.study import study_settings

        names = study_settings.vary(context.scene, self.path)
        self.report({"INFO"}, f"{', '.join(names)} {'varies' if len(names) == 1 else 'vary'} in the study")


class PALPATE_OT_study_remove(support.PalpateOperator, bpy.types.Operator):
    """Remove this from the study; the scene does not change"""

    bl_idname = "palpate.study_remove"
    bl_label = "Remove from Study"
    needs = (
        support.NO_STUDY,
        support.SCENE,
        support.Condition(
            lambda context: bool(context.scene.palpate.study.variables),
            "Nothing varies yet: right-click on a number and choose Vary in Study",
        ),
    )

    index: IntProperty(name="Number", description="Index among the varied properties, from zero", min=0, options={"SKIP_SAVE"})

    def run(self, context):
        context.scene.palpate.study.variables.remove(self.index)


class PALPATE_OT_study_write(support.PalpateOperator, bpy.types.Operator):
    """Write the file of the study, for the command palpate sweep on this machine or another"""

    bl_idname = "palpate.study_write"
    bl_label = "Write Study"
    bl_options = {"REGISTER"}
    needs = (support.NO_STUDY, support.SCENE)

    def run(self, context):
        from ..addon.study import study_settings

        self.report({"INFO"}, f"Wrote {study_settings.write_study(context.scene)}")


class PALPATE_OT_study_run(modal_job.ModalJob, bpy.types.Operator):
    """Write the study and compute its runs beside the window, which can be used meanwhile. ESC stops it; the same button goes
    on where it was"""

    bl_idname = "palpate.study_run"
    bl_label = "Run Study"
    bl_options = {"REGISTER"}
    needs = (support.NO_STUDY, support.SCENE)
    stopped = "Study stopped; finished runs are kept, and Run Study continues"

    def job(self, context):
        from ..addon.study import study_process, study_settings

        support.leave_edit_mode(context)
        return study_process.run_study(study_settings.write_study(context.scene), context.scene.palpate.study.workers)

    def modal(self, context, event):
        if event.type not in {"ESC", "TIMER"}:
            return {"PASS_THROUGH"}  # runs read the saved file, so the scene may change
        result = super().modal(context, event)
        return {"PASS_THROUGH"} if result == {"RUNNING_MODAL"} else result

    def done(self, result):
        self.report({"INFO"}, result)


class PALPATE_OT_study_report(support.PalpateOperator, bpy.types.Operator):
    """Open the report of the study in a browser: metrics over the varied parameters, the strongest dependencies, failures"""

    bl_idname = "palpate.study_report"
    bl_label = "Open Report"
    bl_options = {"REGISTER"}
    needs = (support.SCENE,)

    def run(self, context):
        from ..addon.study import study_process, study_settings

        report = study_process.report_of(study_settings.study_path(context.scene))
        bpy.ops.wm.url_open(url=report.absolute().as_uri())
