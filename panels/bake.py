# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of a scene: bake, display of results, figures."""

from ..addon.display import baked_scene
from ..addon.properties import scene_properties
from ..addon.properties.scene_units import name_in_units
from ..addon.session import frame_status
from .subpanels import Subpanel, draw_choices, draw_job, draw_named, draw_progress, draw_sentences, draw_settings, job_progress


class Bake(Subpanel):
    name = "bake"
    bl_label = "Bake"
    bl_options = set()
    split = False

    def draw_part(self, layout, _settings, context):
        scene = context.scene
        own = scene.palpate
        layout.prop(own, "folder", text="")
        column = layout.column(align=True)
        draw_named(column, own, "interpolation", "Motion")
        draw_settings(column, own, "subframes", "use_auto_dt")
        if not own.use_auto_dt:
            column.prop(own, "dt")
        layout.prop(own, "use_live")
        progress = job_progress("palpate.bake")
        if progress is not None:
            text = "Compiling the solver" if progress.frame is None else progress.text
            draw_progress(layout, text, progress.share)
            return
        row = layout.row(align=True)
        row.operator("palpate.bake", text=f"Bake {scene.frame_start}–{scene.frame_end}", icon="RENDER_ANIMATION")
        if baked_scene.has_bake(scene):
            row.operator("palpate.bake_clear", text="", icon="TRASH")
        else:
            row = layout.row(align=True)
            draw_job(row, "palpate.catch_up")
            row.operator("palpate.reset", text="Reset")
        status = frame_status.status_of(scene)
        draw_sentences(layout, status.text, "INFO", context)
        if status.warnings:
            draw_sentences(layout, status.warnings, "ERROR", context)
        if status.step:
            draw_sentences(layout, status.step, "PREVIEW_RANGE", context)


class Display(Subpanel):
    name = "display"
    bl_label = "Display"
    split = False

    def draw_part(self, layout, _settings, context):
        own = context.scene.palpate
        row = layout.row()
        row.prop(own, "show_overlay")
        part = row.row()
        part.active = own.show_overlay
        part.prop(own, "show_through")
        layout.prop(own, "show_inset")
        draw_named(layout, own, "color_map", "Colours")
        draw_named(layout, own, "quantity")
        column = layout.column(align=True)
        column.prop(own, "use_auto_range")
        if not own.use_auto_range:
            draw_settings(column, own, *scene_properties.range_names(own))
        row = layout.row(align=True)
        row.prop(own, "show_indentation")
        if own.show_indentation:
            row.prop(own, "indentation_factor")
        layout.label(text="On baked sensors:")
        layout.grid_flow(even_columns=True, align=True).prop(own, "overlays")
        column = layout.column(align=True)
        column.prop(own, "use_auto_arrow")
        if not own.use_auto_arrow:
            draw_settings(column, own, "arrow_scale", "texel_arrow_scale")
        if baked_scene.baked_objects(context.scene):
            layout.operator("palpate.display_refresh")


class Figures(Subpanel):
    name = "figures"
    bl_label = "Figures"

    def draw_part(self, layout, _settings, context):
        own = context.scene.palpate.figures
        layout.prop(own, "folder", text="")
        draw_choices(layout, own, "kinds")
        if own.kinds & {"STRIP", "CURVES", "NUMBERS"}:
            draw_choices(layout, own, "formats")
            draw_settings(layout, own, "width", "dpi")
        draw_settings(layout, own, "sensors", "frames")
        if own.kinds & {"SCENE", "VIDEO"}:
            column = layout.column()
            draw_settings(column, own, "engine", "camera")
            if own.camera == "VIEW":
                column.prop(own, "view", text="")
            draw_settings(column, own, "size", "samples", "own_light", "see_through", "transparent")
        if "GEL" in own.kinds:
            column = layout.column()
            if not own.kinds & {"SCENE", "VIDEO"}:
                column.prop(own, "size")
            draw_settings(column, own, "light_angle", "markers")
            if own.markers:
                column.prop(own, name_in_units(own, "marker_pitch", context.scene))
        draw_choices(layout, own, "exports")
        draw_job(layout, "palpate.figures_make", icon="RENDER_STILL")


SUBPANELS = (Display, Figures)
