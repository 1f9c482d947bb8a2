# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that makes the figures, videos and data files of a bake."""

import bpy

from ..addon.display import baked_scene
from . import modal_job, support


class PALPATE_OT_figures_make(modal_job.ModalJob, bpy.types.Operator):
    """Make the chosen figures of the bake; nothing is computed. ESC stops; earlier figures stay"""

    bl_idname = "palpate.figures_make"
    bl_label = "Make Figures"
    bl_options = {"REGISTER"}
    needs = (
        support.SCENE,
        support.Condition(
            lambda context: bool(baked_scene.bake_folders(context.scene)), "Nothing is baked in this scene: bake first"
        ),
        support.IDLE,
    )
    stopped = "Stopped; earlier figures are unchanged"

    def job(self, context):
        from ..addon.render import figure_export, figure_request

        scene, self._left_out = context.scene, []
        request = figure_request.requested_figures(scene, context.object)
        return figure_export.make_figures(scene, figure_request.figure_folder(scene), request, self._left_out.append)

    def done(self, result):
        names = ", ".join(f"'{path.name}'" for path in result[:4])
        more = f" and {len(result) - 4} more" if len(result) > 4 else ""
        self.report({"INFO"}, f"Made {names}{more} in '{result[0].parent}'" if result else "There is no figure to make")
        for reason in self._left_out:  # the status bar shows the last
            self.report({"WARNING"}, reason)
