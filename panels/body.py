# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel of an object's body: what moves it."""

from ..addon.properties import object_properties
from ..addon.properties.scene_units import name_in_units
from ..addon.scene import moved_bodies
from .subpanels import Subpanel, draw_named, draw_sentences


class Body(Subpanel):
    name = "body"
    bl_label = "Body"
    split = False

    def draw_part(self, layout, settings, context):
        layout.prop(settings, "body", text="")
        if settings.body in object_properties.MOVED_BY_FORCES:
            layout.prop(settings, name_in_units(settings, "mass", context.scene))
        if settings.role in {"SENSOR", "PAD"}:
            layout.prop(settings, "presses")
        if settings.role == "TARGET" or settings.presses:
            draw_named(layout, settings, "contact_normals", "Normals")
        if settings.body == "DRIVEN":
            _draw_drive(layout, settings, context.scene)
        if settings.body == "FREE":
            layout.column().prop(settings, name_in_units(settings, "velocity", context.scene))
            layout.column().prop(settings, "angular_velocity")
        if settings.body == "PARENT" and context.object.parent is None:
            draw_sentences(
                layout, "It has no parent: select the object it is fixed to last, and use Object › Parent.", "ERROR", context
            )


def _draw_drive(layout, settings, scene) -> None:
    draw_named(layout, settings, "drive_leader", "Coupled")
    draw_named(layout, settings, "drive_axis")
    draw_named(layout, settings, "drive_space")
    if settings.drive_leader is not None:
        return
    draw_named(layout, settings, "drive_control")
    column = layout.column(align=True)
    column.use_property_decorate = True
    column.prop(settings, moved_bodies.TARGET_PROPERTIES[settings.drive_control])
    column = layout.column(align=True)
    column.prop(settings, "drive_max_force")
    column.prop(settings, name_in_units(settings, "drive_max_speed", scene))
    column.prop(settings, "drive_damping")
    if settings.drive_control != "VELOCITY":
        column.prop(settings, "drive_stiffness")
    if settings.drive_control == "FORCE":
        draw_named(layout, settings, "drive_sensor")
        layout.prop(settings, "drive_settling")


SUBPANELS = (Body,)
