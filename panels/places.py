# SPDX-License-Identifier: GPL-3.0-or-later
"""Where panels are: in the Physics tab, and the same ones in the sidebar of the 3D view, under Palpate."""

from __future__ import annotations

import textwrap

import bpy

from ..addon.scene import participants

PLACES = {
    "": {"bl_space_type": "PROPERTIES", "bl_region_type": "WINDOW", "bl_context": "physics"},
    "side_": {"bl_space_type": "VIEW_3D", "bl_region_type": "UI", "bl_category": "Palpate"},
}
ROOT = "physics"


class Part:
    """A subpanel for objects with certain roles; plain, :func:`everywhere` makes panels of it."""

    name: str
    """Of the panel, as in PALPATE_PT_<name>."""
    parent = ROOT
    bl_options = {"DEFAULT_CLOSED"}
    roles = {"SENSOR", "TARGET", "PAD"}
    split = True
    """False puts names inside the number fields: units fit there, beside the fields of a narrow editor they are cut off."""

    @classmethod
    def poll(cls, context):
        obj = context.object
        return obj is not None and obj.type in participants.OBJECT_TYPES and obj.palpate.role in cls.roles

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = self.split
        layout.use_property_decorate = False
        self.draw_part(layout, context.object.palpate, context)


def everywhere(*parts) -> tuple:
    """Return panels that show the parts in all places, parents first."""
    return tuple(_panel(part, prefix, where) for prefix, where in PLACES.items() for part in parts)


def _panel(part, prefix: str, where: dict):
    members = {**where, "__doc__": part.__doc__}
    if part.parent is not None:
        members["bl_parent_id"] = f"PALPATE_PT_{prefix}{part.parent}"
    return type(f"PALPATE_PT_{prefix}{part.name}", (part, bpy.types.Panel), members)


def named(layout, settings, key: str, text: str = "") -> None:
    """Draw a list or a pointer with its name beside it, with room enough for the name in a narrow editor."""
    name = text or settings.bl_rna.properties[key].name
    split = layout.split(factor=0.42)
    split.label(text=f"{name}:")
    split.prop(settings, key, text="")


def sentences(layout, text: str, icon: str, context) -> None:
    """Show text over as many lines as the panel's width asks for."""
    letters = int((context.region.width / context.preferences.system.ui_scale - 70) / 6.2)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for i, line in enumerate(textwrap.wrap(text, max(letters, 20))):
        column.label(text=line, icon=icon if i == 0 else "BLANK1")
