# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel of a scene's study: what varies, over what, and the button that computes it."""

from ..addon.properties.scene_properties import WORDS
from .subpanels import Subpanel, draw_named, draw_progress, draw_sentences, draw_settings, job_progress

HINT = "Right-click on a number and choose Vary in Study."


class Study(Subpanel):
    """Many runs of the scene with varied numbers"""

    name = "study"
    bl_label = "Study"
    split = False

    def draw_part(self, layout, _settings, context):
        own = context.scene.palpate.study
        draw_named(layout, own, "design")
        column = layout.column(align=True)
        if own.design != "GRID":
            draw_settings(column, own, "samples", "seed")
        for index, item in enumerate(own.variables):
            _draw_variable(layout.box(), item, index, own.design)
        if not own.variables:
            draw_sentences(layout, HINT, "INFO", context)
        self._draw_press(layout, own)
        draw_settings(layout, own, "images", "use_limit")
        if own.use_limit:
            layout.prop(own, "run_limit")
        layout.prop(own, "use_memory_limit")
        if own.use_memory_limit:
            layout.prop(own, "run_memory")
        layout.prop(own, "workers")
        layout.prop(own, "file", text="")
        progress = job_progress("palpate.study_run")
        if progress is not None:
            draw_progress(layout, progress.text, progress.share)
            return
        layout.operator("palpate.study_run", icon="PLAY")
        row = layout.row(align=True)
        row.operator("palpate.study_write")
        row.operator("palpate.study_report")

    @staticmethod
    def _draw_press(layout, own) -> None:
        layout.prop(own, "use_press")
        if not own.use_press:
            return
        draw_named(layout, own, "press_by")
        column = layout.column(align=True)
        kind = own.press_by.lower()
        draw_settings(column, own, f"{kind}_low", f"{kind}_high", "slide", "tilt", "twist")


def _draw_variable(box, item, index: int, design: str) -> None:
    """Draw one thing that varies."""
    row = box.row(align=True)
    row.prop(item, "use", text="")
    row.label(text=f"{item.name} ({item.unit})" if item.unit else item.name)
    row.operator("palpate.study_remove", text="", icon="X", emboss=False).index = index
    column = box.column(align=True)
    column.active = item.use
    if item.kind != WORDS:
        column.prop(item, "distribution", text="")
    if item.distribution == "CHOICE":
        column.prop(item, "choices", text="")
        return
    draw_settings(column, item, *(("mean", "deviation") if item.distribution == "NORMAL" else ("low", "high")))
    if design == "GRID":
        column.prop(item, "levels")


SUBPANELS = (Study,)
