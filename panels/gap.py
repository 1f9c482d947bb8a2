# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured data of the real sensor: what the model misses against them."""

from ..addon.measured import gap_results, planned_probe
from .subpanels import Subpanel, draw_job, draw_operator_fields, draw_sentences


class Measured(Subpanel):
    """Measurements of the real sensor, and what the model misses against them"""

    name = "measured"
    bl_label = "Measured Data"
    roles = {"SENSOR", "PAD"}

    def draw_part(self, layout, settings, context):
        row = layout.row(align=True)
        row.prop(settings, "measured", text="")
        row.operator("palpate.measured_open", text="", icon="FILE_FOLDER")
        row.operator("palpate.measured_logs", text="", icon="FILE_NEW")
        column = layout.column(align=True)  # beside one another their names are cut off in a narrow editor
        draw_job(column, "palpate.gap_find", icon="VIEWZOOM")
        column = layout.column(align=True)
        draw_job(column, "palpate.gap_plan", icon="CON_FOLLOWPATH")
        draw_operator_fields(column, context, "palpate.gap_plan", "depth", "speed", "duration")
        plan = planned_probe.sentence_of(context.object)
        if plan:
            draw_sentences(column, plan, "CON_FOLLOWPATH", context)
        result = gap_results.of(context.object)
        if result is None:
            return
        box = layout.box()
        draw_sentences(box, result.headline, "INFO", context)
        for line in result.lines:
            draw_sentences(box, line, "DOT", context)
        if result.experiment:
            draw_sentences(box, result.experiment, "QUESTION", context)
        if result.lines and result.caution:
            draw_sentences(box, result.caution, "ERROR", context)
        if result.lines:
            layout.operator("palpate.gap_add", icon="PASTEDOWN")
        layout.operator("palpate.gap_curves", icon="FCURVE")
        row = layout.row(align=True)
        shown = gap_results.shown_on(context.object)
        for text, amended in (("Error: Base", False), ("Amended", True)):
            is_shown = shown is not None and shown.amended == amended
            row.operator("palpate.gap_show", text=text, icon="COLOR", depress=is_shown).amended = amended
        if shown is not None:
            draw_sentences(layout, f"Black: no error. Bright yellow: {shown.scale.words(shown.scale.high)}.", "COLOR", context)
        draw_job(layout, "palpate.gap_report", icon="EXPORT")


SUBPANELS = (Measured,)
