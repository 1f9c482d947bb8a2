# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel of a sensor's texels: their number and density, the advised time step, and problems with a button that fixes each."""

from ..addon.authoring import problems, sensor_report
from ..core.geometry.grid_layout import GridLayout
from ..core.solver.time_step_adviser import benefit
from .subpanels import Subpanel, draw_sentences, draw_settings


class Texels(Subpanel):
    name = "texels"
    bl_label = "Texels"
    bl_options = set()
    roles = {"SENSOR", "PAD"}
    split = False

    def draw_part(self, layout, _settings, context):
        own = context.scene.palpate
        grid = layout.grid_flow(columns=2, even_columns=True, align=True)
        draw_settings(grid, own, "show_texels", "show_normals", "show_numbers", "show_reach")
        report = sensor_report.known_report(context.object, context.scene)
        if report is None:
            layout.label(text="Looking at it…", icon="SORTTIME")
            return
        box = layout.box().column(align=True)
        if report.texels is not None:
            shape = report.texels.layout
            size = f"{shape.rows} × {shape.columns} = " if isinstance(shape, GridLayout) else ""
            box.label(text=f"{size}{len(report.texels)} texels")
            box.label(text=f"{report.area * 1e4:.4g} cm², {report.density:.3g} texels per cm²")
        advice = report.advice
        if advice is not None:
            limit = f"{advice.limit * 1e3:.3g} ms" if advice.limit < 1e3 else "none, no body is free"
            box.label(text=f"Stability limit: {limit}")
            box.label(text=f"Recommended step: {advice.dt * 1e3:.3g} ms")
            if not own.use_auto_dt and (text := benefit(own.dt, advice)):
                draw_sentences(box, text, "INFO", context)
        elif report.missing:
            draw_sentences(box, report.missing, "INFO", context)
        for problem in report.problems:
            box = layout.box().column()
            draw_sentences(box, problem.text, "ERROR", context)
            if problem.kind in problems.FIXES:
                box.operator("palpate.fix", text=problems.FIXES[problem.kind][0]).kind = problem.kind


SUBPANELS = (Texels,)
