# SPDX-License-Identifier: GPL-3.0-or-later
"""Subpanels: each is shown twice, in the Physics tab and in the sidebar of the 3D view under Palpate."""

from __future__ import annotations

import textwrap

import bpy

from ..addon.properties.figure_properties import check_box
from ..addon.scene import participants
from ..addon.session import session_state

PLACES = {
    "": {"bl_space_type": "PROPERTIES", "bl_region_type": "WINDOW", "bl_context": "physics"},
    "side_": {"bl_space_type": "VIEW_3D", "bl_region_type": "UI", "bl_category": "Palpate"},
}
ROOT = "physics"
WIDE = 400
"""Pixels from which the longest name with its unit, of 21 letters, fits beside its field."""


class Subpanel:
    """A subpanel for objects with certain roles. :func:`in_all_places` makes Blender panels of its subclasses."""

    name: str
    """Name of the panel, as in PALPATE_PT_<name>."""
    parent = ROOT
    bl_options = {"DEFAULT_CLOSED"}
    roles = {"SENSOR", "TARGET", "PAD"}
    split = True
    """False draws names inside the number fields of a narrow editor. Beside the fields they would be cut off there."""

    @classmethod
    def poll(cls, context):
        obj = context.object
        return obj is not None and obj.type in participants.OBJECT_TYPES and obj.palpate.role in cls.roles

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = self.split or context.region.width >= WIDE * context.preferences.system.ui_scale
        layout.use_property_decorate = False
        self.draw_part(layout, context.object.palpate, context)


def in_all_places(*subpanels) -> tuple:
    """Return Blender panels that show the subpanels in all places, parents first."""
    panels = []
    for prefix, place in PLACES.items():
        for subpanel in subpanels:
            members = {**place, "__doc__": subpanel.__doc__}
            if subpanel.parent is not None:
                members["bl_parent_id"] = f"PALPATE_PT_{prefix}{subpanel.parent}"
            panels.append(type(f"PALPATE_PT_{prefix}{subpanel.name}", (subpanel, bpy.types.Panel), members))
    return tuple(panels)


def draw_named(layout, settings, key: str, text: str = "") -> None:
    """Draw a list or a pointer with its name: in the column of all names in a wide editor, else in 42 % of the row."""
    name = text or settings.bl_rna.properties[key].name
    if layout.use_property_split:
        layout.prop(settings, key, text=name)
        return
    split = layout.split(factor=0.42)
    split.label(text=f"{name}:")
    split.prop(settings, key, text="")


def job_progress(operator: str):
    """Return how far an operator that works beside the window has come; None while it does not work."""
    module, name = operator.split(".")
    return session_state.session.jobs.get(f"{module.upper()}_OT_{name}")


def draw_job(layout, operator: str, **how) -> None:
    """Draw the button of an operator that works beside the window; while it works, how far it has come."""
    progress = job_progress(operator)
    if progress is None:
        layout.operator(operator, **how)
    else:
        draw_progress(layout, progress.text, progress.share)


def draw_progress(layout, text: str, share: float) -> None:
    """Draw how far something has come that ESC stops."""
    layout.progress(text=f"{text} (ESC: stop)", factor=share)


def draw_choices(layout, settings, key: str) -> None:
    """Draw the choices of which several may be taken, one below the other: side by side their names would be cut off."""
    choices = settings.bl_rna.properties[key]
    column = layout.column(heading=choices.name)
    for item in choices.enum_items:
        column.prop(settings, check_box(key, item.identifier))


def draw_operator_fields(layout, context, operator: str, *names: str) -> None:
    """Draw settings of an operator, which its button uses: those of its last run, as Blender keeps them for the session."""
    draw_settings(layout, context.window_manager.operator_properties_last(operator), *names)


def draw_settings(layout, settings, *names: str) -> None:
    """Draw settings one below the other."""
    for name in names:
        layout.prop(settings, name)


def draw_sentences(layout, text: str, icon: str, context) -> None:
    """Draw text, wrapped to the width of the panel."""
    letters = int((context.region.width / context.preferences.system.ui_scale - 70) / 6.2)
    column = layout.column(align=True)
    column.scale_y = 0.8
    indent = "NONE" if icon == "NONE" else "BLANK1"
    for i, line in enumerate(textwrap.wrap(text, max(letters, 20))):
        column.label(text=line, icon=indent if i else icon)
