# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured data of the real sensor: what the model misses against them."""

from ..addon.measured import gap_results
from .subpanels import Subpanel, draw_sentences


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
        layout.operator("palpate.gap_find", icon="VIEWZOOM")
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
            layout.operator("palpate.gap_add", icon="ADD")
        layout.operator("palpate.gap_curves", icon="FCURVE")
        row = layout.row(align=True)
        row.operator("palpate.gap_show", text="Error: Base", icon="COLOR").amended = False
        row.operator("palpate.gap_show", text="Amended").amended = True
        layout.operator("palpate.gap_report", icon="EXPORT")


SUBPANELS = (Measured,)
