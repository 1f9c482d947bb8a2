# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel of what moves an object."""

from .places import Part, sentences


class Body(Part):
    name = "body"
    bl_label = "Body"
    split = False

    def draw_part(self, layout, settings, context):
        layout.prop(settings, "body", text="")
        if settings.body == "FREE":
            layout.prop(settings, "mass")
            layout.column().prop(settings, "velocity")
            layout.column().prop(settings, "angular_velocity")
        if settings.body == "PARENT" and context.object.parent is None:
            sentences(
                layout, "It has no parent: select the object it is fixed to last, and use Object › Parent.", "ERROR", context
            )


PARTS = (Body,)
