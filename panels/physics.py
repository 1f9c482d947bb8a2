# SPDX-License-Identifier: GPL-3.0-or-later
"""Palpate in the Physics tab of the properties editor."""

import textwrap

import bpy

from ..addon import live, meshes, state, write


def sentences(layout, text: str, icon: str, context) -> None:
    """Show text over as many lines as the panel's width asks for."""
    letters = int(context.region.width / (7.5 * context.preferences.system.ui_scale)) - 6
    column = layout.column(align=True)
    column.scale_y = 0.8
    for i, line in enumerate(textwrap.wrap(text, max(letters, 20))):
        column.label(text=line, icon=icon if i == 0 else "BLANK1")


class Physics:
    """Where the panels are."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "physics"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type in meshes.KINDS


class Part(Physics):
    """A subpanel for objects with certain roles."""

    bl_parent_id = "PALPATE_PT_physics"
    bl_options = {"DEFAULT_CLOSED"}
    roles = {"SENSOR", "TARGET", "PAD"}
    split = True
    """False puts names inside the number fields: units fit there, beside the fields of a narrow editor they are cut off."""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object.palpate.role in cls.roles

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = self.split
        layout.use_property_decorate = False
        self.draw_part(layout, context.object.palpate, context)


class PALPATE_PT_physics(Physics, bpy.types.Panel):
    bl_label = "Palpate"

    def draw(self, context):
        layout = self.layout
        obj = context.object
        settings = obj.palpate
        for name in (obj.name, context.scene.name):
            if name in state.session.notes:
                sentences(layout, state.session.notes[name], "ERROR", context)
        if settings.role == "NONE":
            column = layout.box().column()
            column.label(text=f"'{obj.name}' takes no part.")
            column.operator("palpate.sensor_add", text="Make Sensor")
            column.operator("palpate.role_set", text="Make Target").role = "TARGET"
            column.operator("palpate.sensor_add", text="Make Pad").role = "PAD"
            return
        layout.use_property_split = True
        layout.use_property_decorate = False
        row = layout.row(align=True)
        row.prop(settings, "role")
        row.operator("palpate.sensor_remove", text="", icon="X")


class PALPATE_PT_region(Part, bpy.types.Panel):
    bl_label = "Region"
    bl_options = set()
    roles = {"SENSOR", "PAD"}

    def draw_part(self, layout, settings, context):
        layout.prop(settings, "region")
        if settings.region == "GROUP":
            layout.prop_search(settings, "vertex_group", context.object, "vertex_groups")
            layout.prop(settings, "threshold")
        row = layout.row(align=True)
        row.operator("palpate.weight_paint", icon="WPAINT_HLT")
        again = row.operator("palpate.sensor_add", text="From Selection", icon="EDITMODE_HLT")
        again.source, again.role = "SELECTION", settings.role


class PALPATE_PT_contact(Part, bpy.types.Panel):
    bl_label = "Contact"
    split = False
    roles = {"SENSOR", "PAD"}

    def draw_part(self, layout, settings, _context):
        column = layout.column()
        column.prop(settings, "normal_law")
        column.prop(settings, "k")
        if settings.normal_law == "linear":
            column.prop(settings, "cn")
        else:
            column.prop(settings, "exponent")
            column.prop(settings, "dissipation")
        column.prop(settings, "max_penetration")


class PALPATE_PT_friction(Part, bpy.types.Panel):
    bl_label = "Friction"
    split = False
    roles = {"SENSOR", "PAD"}

    def draw_part(self, layout, settings, _context):
        column = layout.column(align=True)
        column.prop(settings, "mus")
        column.prop(settings, "mud")
        column.prop(settings, "x0")
        column = layout.column(align=True)
        column.prop(settings, "sigma0")
        column.prop(settings, "sigma1")
        column.prop(settings, "ct")


class PALPATE_PT_body(Part, bpy.types.Panel):
    bl_label = "Body"
    split = False

    def draw_part(self, layout, settings, _context):
        layout.row().prop(settings, "body", expand=True)
        if settings.body == "FREE":
            layout.prop(settings, "mass")
            layout.column().prop(settings, "velocity")
            layout.column().prop(settings, "angular_velocity")


class PALPATE_PT_readout(Part, bpy.types.Panel):
    bl_label = "Readout"
    bl_options = set()
    split = False
    roles = {"SENSOR"}

    def draw_part(self, layout, settings, context):
        column = layout.column()
        column.prop(settings, "unit")
        column.prop(settings, "gain")
        column.prop(settings, "zero")
        status = live.status(context.scene)
        felt = status.frame.sensors.get(context.object.name) if status.frame is not None else None
        box = layout.box().column()
        if felt is None:
            sentences(box, status.text, "INFO", context)
            return
        net = ", ".join(f"{round(value, 3) + 0.0:.3f}" for value in felt.net_force)  # adding zero turns -0.0 into 0.0
        box.label(text=f"Frame {status.frame.frame}: {int(felt.contact.sum())} of {len(felt.contact)} texels touch")
        box.label(text=f"Sum of normals: {felt.normal_force.sum():.4f} N")
        box.label(text=f"Largest normal: {felt.normal_force.max():.4f} N")
        box.label(text=f"Largest shear: {(felt.shear**2).sum(axis=1).max() ** 0.5:.4f} N")
        box.label(text=f"Net: {net} N")
        box.label(text=f"Reading: {felt.reading.min():.4g} to {felt.reading.max():.4g} {settings.unit}")


class PALPATE_PT_bake(Part, bpy.types.Panel):
    bl_label = "Bake"
    bl_options = set()
    split = False

    def draw_part(self, layout, _settings, context):
        scene = context.scene
        own = scene.palpate
        layout.prop(own, "folder", text="")
        column = layout.column(align=True)
        column.prop(own, "use_auto_dt")
        if not own.use_auto_dt:
            column.prop(own, "dt")
        layout.prop(own, "use_live")
        progress = state.session.bake
        if progress is not None:
            text = f"{progress.stage}: frame {progress.frame} (ESC: stop)"
            layout.progress(text=text, factor=progress.done / progress.total)
            return
        row = layout.row(align=True)
        row.operator("palpate.bake", text=f"Bake {scene.frame_start}–{scene.frame_end}", icon="RENDER_ANIMATION")
        if write.has_bake(scene):
            row.operator("palpate.bake_clear", text="", icon="TRASH")
        else:
            layout.operator("palpate.reset", text="Reset Playback")
        sentences(layout, live.status(scene).text, "INFO", context)


class PALPATE_PT_display(Part, bpy.types.Panel):
    bl_label = "Display"
    split = False

    def draw_part(self, layout, _settings, context):
        own = context.scene.palpate
        layout.prop(own, "show_overlay")
        layout.prop(own, "color_map")
        column = layout.column(align=True)
        column.prop(own, "use_auto_range")
        if not own.use_auto_range:
            column.prop(own, "range_max")
        column = layout.column(align=True)
        column.prop(own, "use_auto_arrow")
        if not own.use_auto_arrow:
            column.prop(own, "arrow_scale")


CLASSES = (
    PALPATE_PT_physics,
    PALPATE_PT_region,
    PALPATE_PT_contact,
    PALPATE_PT_friction,
    PALPATE_PT_body,
    PALPATE_PT_readout,
    PALPATE_PT_bake,
    PALPATE_PT_display,
)
