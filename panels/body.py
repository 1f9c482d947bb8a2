# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel of what moves an object."""

from ..addon import drives, freebodies
from .places import Part, sentences


class Body(Part):
    name = "body"
    bl_label = "Body"
    split = False

    def draw_part(self, layout, settings, context):
        layout.prop(settings, "body", text="")
        if settings.body in freebodies.MOVED:
            layout.prop(settings, "mass")
        if settings.role in {"SENSOR", "PAD"}:
            layout.prop(settings, "presses")
        if settings.role == "TARGET" or settings.presses:
            layout.prop(settings, "contact_normals")
        if settings.body == "DRIVEN":
            _draw_drive(layout, settings)
        if settings.body == "FREE":
            layout.column().prop(settings, "velocity")
            layout.column().prop(settings, "angular_velocity")
        if settings.body == "PARENT" and context.object.parent is None:
            sentences(
                layout, "It has no parent: select the object it is fixed to last, and use Object › Parent.", "ERROR", context
            )


def _draw_drive(layout, settings) -> None:
    layout.prop(settings, "drive_leader")
    row = layout.row(align=True)
    row.prop(settings, "drive_axis", text="")
    row.prop(settings, "drive_space", text="")
    if settings.drive_leader is not None:
        return
    layout.prop(settings, "drive_control", text="")
    column = layout.column(align=True)
    column.use_property_decorate = True
    column.prop(settings, drives.TARGETS[settings.drive_control])
    column = layout.column(align=True)
    column.prop(settings, "drive_max_force")
    column.prop(settings, "drive_max_speed")
    column.prop(settings, "drive_damping")
    if settings.drive_control != "VELOCITY":
        column.prop(settings, "drive_stiffness")
    if settings.drive_control == "FORCE":
        layout.prop(settings, "drive_sensor")
        layout.prop(settings, "drive_settling")


PARTS = (Body,)
