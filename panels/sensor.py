# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of one object: its role, and of a sensor or pad its region, its contact, its friction and what it reads."""

import bpy

from ..addon.authoring import laid_sensors, sensor_report
from ..addon.display import bake_display
from ..addon.properties import object_properties
from ..addon.properties.scene_units import name_in_units
from ..addon.scene import moved_bodies
from ..addon.session import first_use, frame_status, session_state
from ..core.figures.quantities import QUANTITIES, Extent
from ..core.model.sensor_parameters import CONTACT, FRICTION, HUNT_CROSSLEY, LINEAR, READOUT, SENSOR_PARAMETERS
from ..operators import presets
from .subpanels import ROOT, Subpanel, draw_named, draw_operator_fields, draw_sentences


class Root(Subpanel):
    name = ROOT
    parent = None
    bl_label = "Palpate"
    bl_options = set()
    roles = {"NONE", "SENSOR", "TARGET", "PAD"}

    def draw_header_preset(self, context):
        if context.object.palpate.role in {"SENSOR", "PAD"}:
            presets.PALPATE_PT_presets.draw_panel_header(self.layout)

    def draw_part(self, layout, settings, context):
        obj = context.object
        for name in (obj.name, context.scene.name):
            if name in session_state.session.unreadable_settings:
                draw_sentences(layout, session_state.session.unreadable_settings[name], "ERROR", context)
        coming = first_use.progress()
        if coming is not None:
            layout.progress(text="Compiling the solver", factor=coming.done / coming.total)
            draw_sentences(layout, f"{coming.text}.", "SORTTIME", context)
        if settings.role == "NONE":
            column = layout.box().column()
            column.label(text=f"'{obj.name}' is not part of the simulation.")
            column.operator("palpate.sensor_add", text="Make Sensor")
            column.operator("palpate.role_set", text="Make Target").role = "TARGET"
            column.operator("palpate.sensor_add", text="Make Pad").role = "PAD"
            column.operator("palpate.weight_paint", text="Paint a Sensor", icon="WPAINT_HLT")
            _draw_lay_texels(layout.box(), context)
            return
        row = layout.row(align=True)
        row.prop(settings, "role")
        row.operator("palpate.sensor_remove", text="", icon="X")
        if settings.role in {"SENSOR", "PAD"}:
            column = layout.column(align=True)  # beside one another their names are cut off in a narrow editor
            column.operator("palpate.parameters_copy", icon="COPYDOWN")
            column.operator("palpate.probe_add", icon="MESH_UVSPHERE")
            draw_operator_fields(column, context, "palpate.probe_add", "shape", "size", "depth")


class Skins(Subpanel):
    """Sensors that lie on this object, or what this sensor lies on"""

    name = "skins"
    bl_label = "Texels on This Surface"
    bl_options = set()
    roles = {"NONE", "SENSOR", "TARGET", "PAD"}

    @classmethod
    def poll(cls, context):
        obj = context.object
        return super().poll(context) and obj.type == "MESH" and (obj.palpate.role != "NONE" or bool(laid_sensors.laid_on(obj)))

    def draw_part(self, layout, settings, context):
        obj = context.object
        if laid_sensors.is_laid(obj):
            own = settings.skin
            box = layout.box().column()
            row = box.row(align=True)
            row.label(text=f"Lies on '{obj.parent.name}'" if obj.parent else "Lies on nothing", icon="MOD_SHRINKWRAP")
            if obj.parent:
                row.operator("palpate.object_activate", text="", icon="RESTRICT_SELECT_OFF").name = obj.parent.name
            for name in object_properties.FIELDS[own.method]:
                box.prop(own, name_in_units(own, name, context.scene))
            layout.operator("palpate.skin_update", icon="FILE_REFRESH")
            return
        for skin in laid_sensors.laid_on(obj):
            row = layout.row(align=True)
            row.prop(skin, "name", text="", icon="MOD_SHRINKWRAP")
            row.operator("palpate.object_activate", text="", icon="RESTRICT_SELECT_OFF").name = skin.name
        _draw_lay_texels(layout, context)


def _draw_lay_texels(layout, context) -> None:
    """Draw the button that lays texels, and below it what it lays."""
    column = layout.column(align=True)
    column.operator("palpate.skin_add", icon="MOD_SHRINKWRAP")
    pattern = context.window_manager.operator_properties_last("palpate.skin_add")
    draw_operator_fields(column, context, "palpate.skin_add", "method", *object_properties.FIELDS[pattern.method])


class Region(Subpanel):
    name = "region"
    bl_label = "Region"
    bl_options = set()
    roles = {"SENSOR", "PAD"}

    def draw_part(self, layout, settings, context):
        obj = context.object
        layout.prop(settings, "region")
        if settings.region == "GROUP":
            layout.prop_search(settings, "vertex_group", obj, "vertex_groups", text="")
            layout.prop(settings, "threshold")
        elif settings.region == "MATERIAL":
            layout.prop_search(settings, "material", obj, "material_slots", text="")
        elif settings.region == "FACE_SET":
            row = layout.row(align=True)
            row.prop(settings, "face_set")
            row.operator_menu_enum("palpate.face_set_choose", "face_set", text="", icon="DOWNARROW_HLT")
        row = layout.row(align=True)
        row.operator("palpate.weight_paint", icon="WPAINT_HLT")
        again = row.operator("palpate.sensor_add", text="From Selection", icon="EDITMODE_HLT")
        again.source, again.role = "SELECTION", settings.role


def painted(layout, settings, key: str) -> None:
    """Draw the field for a painted multiplier, and its factor when one is chosen."""
    column = layout.column(align=True)
    name = settings.bl_rna.properties[f"{key}_map"].name
    column.prop(settings, f"{key}_map", text="", icon="GROUP_VERTEX", placeholder=f"{name}: none")
    if getattr(settings, f"{key}_map"):
        column.prop(settings, f"{key}_factor", text=f"{name.removeprefix('Painted ')} × at Weight 1")


def draw_parameters(layout, settings, *names: str) -> None:
    """Draw parameters of a sensor in the units of the scene."""
    for name in names:
        layout.prop(settings, name_in_units(settings, name, bpy.context.scene))


def draw_others(layout, settings, group: str, *drawn: str) -> None:
    """Draw the parameters of a group that have no place of their own."""
    others = [name for name, specification in SENSOR_PARAMETERS.items() if specification.group == group and name not in drawn]
    draw_parameters(layout, settings, *others)


class Contact(Subpanel):
    name = "contact"
    bl_label = "Contact"
    split = False
    roles = {"SENSOR", "PAD"}

    def draw_part(self, layout, settings, _context):
        column = layout.column()
        draw_named(column, settings, "normal_law")
        of_laws = {LINEAR: ("cn",), HUNT_CROSSLEY: ("exponent", "dissipation")}
        draw_parameters(column, settings, "k", *of_laws[settings.normal_law], "max_penetration")
        draw_named(column, settings, "points_per_texel", "Points")
        placed = "normal_law", "k", *sum(of_laws.values(), ()), "max_penetration", "points_per_texel"
        draw_others(column, settings, CONTACT, *placed)
        painted(layout, settings, "k")
        layout.operator("palpate.stiffness_fit", icon="FCURVE_SNAPSHOT")


class Friction(Subpanel):
    name = "friction"
    bl_label = "Friction"
    split = False
    roles = {"SENSOR", "PAD"}

    def draw_part(self, layout, settings, _context):
        column = layout.column(align=True)
        limits, bristles = ("mus", "mud", "x0"), ("sigma0", "sigma1", "ct")
        draw_parameters(column, settings, *limits)
        column = layout.column(align=True)
        draw_parameters(column, settings, *bristles)
        draw_others(column, settings, FRICTION, *limits, *bristles)
        painted(layout, settings, "friction")
        layout.operator("palpate.friction_fit", icon="FCURVE_SNAPSHOT")


class Readout(Subpanel):
    name = "readout"
    bl_label = "Readout"
    bl_options = set()
    split = False
    roles = {"SENSOR"}

    def draw_part(self, layout, settings, context):
        column = layout.column()
        draw_named(column, settings, "unit")
        draw_parameters(column, settings, "gain", "zero")
        draw_others(column, settings, READOUT, "unit", "gain", "zero")
        painted(layout, settings, "gain")
        column = layout.column()
        draw_named(column, settings, "image_layout", "Image")
        if settings.image_layout == "UV":
            column.prop_search(settings, "image_map", context.object.data, "uv_layers", text="", icon="UV")
            column.prop(settings, "image_size")
            column.prop(settings, "image_filter", text="")
        _draw_channels(layout, settings.readout, context)
        status = frame_status.status_of(context.scene)
        readings = status.frame.sensors.get(context.object.name) if status.frame is not None else None
        box = layout.box().column()
        box.label(text=f"Frame {context.scene.frame_current}:" + ("" if readings else " not computed"))
        for name, value in _measured(context, readings):  # as many lines without numbers: what is below does not jump
            box.label(text=f"{name}: {value}")
        if readings is not None and readings.channels is not None:
            box.label(text=_summary(readings.channels))
        draw_sentences(box, _sentence_of_net(context.scene, context.object), "NONE", context)


def _draw_channels(layout, own, context) -> None:
    """Draw what further channels a sensor has."""
    column = layout.column()
    draw_named(column, own, "kind", "Channels")
    if own.kind == "PLACED":
        draw_named(column, own, "collection", "Magnets")
        column.prop(own, name_in_units(own, "thickness", context.scene))
    if own.kind not in {"NONE", "NET_FORCE"}:
        column.prop(own, "shear_stiffness")
        column.operator_menu_enum("palpate.magnetic_skin_place", "preset", icon="EMPTY_SINGLE_ARROW")


def _summary(channels) -> str:
    """Return how many channels a sensor has and the largest of their readings at a frame."""
    clipped = int(channels.clipped.sum())
    ending = f", {clipped} clipped" if clipped else ""
    return f"Channels: {channels.values.size}, largest {abs(channels.values).max():.4g} {channels.unit}{ending}"


def _sentence_of_net(scene, obj) -> str:
    """Return the meaning of Net and its axes."""
    body = moved_bodies.body_object(obj, moved_bodies.objects_with_role(scene))
    mirrored = ", x reversed because its scale mirrors it" if body.matrix_world.is_negative else ""
    return (
        f"Net is the vector sum of normals and shear, along the local axes of '{body.name}'{mirrored}: "
        "what points in different directions cancels in part."
    )


def _measured(context, readings) -> list[tuple[str, str]]:
    """Return names and values of what a sensor measures at a frame; dashes where there is nothing."""
    quantities = QUANTITIES["reading"], bake_display.figure_style(context.scene).shown
    shown = {quantity.title: quantity for quantity in quantities}
    names = "Texels in contact", "Sum of normals", "Largest normal", "Largest shear", "Net", *shown
    if readings is None:
        return [(name, "–") for name in names]
    net = ", ".join(f"{round(value, 3) + 0.0:.3f}" for value in readings.net_force)  # adding zero turns -0.0 into 0.0
    values = (
        f"{int(readings.contact.sum())} of {len(readings.contact)}",
        f"{readings.normal_force.sum():.4f} N",
        f"{readings.normal_force.max():.4f} N",
        f"{(readings.shear**2).sum(axis=1).max() ** 0.5:.4f} N",
        f"{net} N",
        *(_range(context, quantity, readings) for quantity in shown.values()),
    )
    return list(zip(names, values, strict=True))


def _range(context, quantity, readings) -> str:
    """Return the least and the largest value of a quantity at a frame; a dash where the sensor has none or has changed."""
    report = sensor_report.known_report(context.object, context.scene)
    texels = None if report is None else report.texels
    if texels is None or len(texels) != len(readings.reading) or not quantity.is_in(readings):
        return "–"
    extent = Extent.of(quantity, [(readings, texels)])
    return f"{extent.low:.4g} to {extent.high:.4g} {extent.units[0]}"


class Magnet(Subpanel):
    """What this empty is in a magnetic skin"""

    name = "magnet"
    parent = None
    bl_label = "Palpate Magnet"
    bl_options = set()
    split = False

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "EMPTY"

    def draw_part(self, layout, settings, _context):
        own = settings.magnetic
        draw_named(layout, own, "part")
        if own.part == "MAGNET":
            layout.prop(own, "moment")
        elif own.part == "MAGNETOMETER":
            layout.prop(own, "full_scale")
            layout.column().prop(own, "zero_field")


SUBPANELS = (Region, Skins, Contact, Friction, Readout, Magnet)
