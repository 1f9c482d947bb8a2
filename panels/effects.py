# SPDX-License-Identifier: GPL-3.0-or-later
"""The stack of a sensor's effects, drawn like modifiers."""

from ..addon.properties import effect_stack
from .subpanels import Subpanel


class Effects(Subpanel):
    """Effects of real sensors that the base model lacks"""

    name = "effects"
    bl_label = "Effects"
    roles = {"SENSOR", "PAD"}

    def draw_part(self, layout, settings, _context):
        layout.use_property_split = False
        layout.operator_menu_enum("palpate.effect_add", "effect", icon="ADD")
        for index, item in enumerate(settings.effects):
            self._draw_entry(layout.box(), item, index)

    def _draw_entry(self, box, item, index: int) -> None:
        kind, form = effect_stack.kind_of(item), effect_stack.form_of(item)
        row = box.row(align=True)
        row.prop(item, "show", text="", icon="DOWNARROW_HLT" if item.show else "RIGHTARROW", emboss=False)
        row.label(text=kind.title, icon=effect_stack.SITE_ICONS[kind.site_of(form)])
        row.prop(item, "use", text="", icon="HIDE_OFF" if item.use else "HIDE_ON", emboss=False)
        for way, icon in (("UP", "TRIA_UP"), ("DOWN", "TRIA_DOWN")):
            move = row.operator("palpate.effect_move", text="", icon=icon, emboss=False)
            move.index, move.way = index, way
        row.operator("palpate.effect_remove", text="", icon="X", emboss=False).index = index
        if not item.show:
            return
        column = box.column()
        column.active = item.use
        column.prop(item, effect_stack.form_key(kind), text="")
        for _parameter, key in effect_stack.parameters(item):
            column.prop(item, key)
        if form.random:
            column.prop(item, "seed")


SUBPANELS = (Effects,)
