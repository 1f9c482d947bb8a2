# SPDX-License-Identifier: GPL-3.0-or-later
"""Object › Palpate Tactile Sensors in the 3D view. F3 finds what is in menus, by the words of the whole path."""

import bpy

from ..addon.properties.parameter_properties import CONSTANT
from ..addon.scene import participants
from ..addon.session import session_state
from ..addon.study import property_path


class PALPATE_MT_object(bpy.types.Menu):
    bl_label = "Palpate Tactile Sensors"

    def draw(self, context):
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator("palpate.sensor_add", icon="PHYSICS")
        layout.operator("palpate.role_set", text="Make Target").role = "TARGET"
        layout.operator("palpate.sensor_add", text="Make Pad").role = "PAD"
        layout.operator("palpate.weight_paint", icon="WPAINT_HLT")
        layout.operator("palpate.skin_add", icon="MOD_SHRINKWRAP")
        _draw_operators(layout, "palpate.skin_update", "palpate.probe_add", "palpate.parameters_copy")
        presets = layout.column()
        presets.enabled = context.object is not None and context.object.palpate.role in {"SENSOR", "PAD"}
        presets.menu("PALPATE_MT_presets")
        layout.operator_menu_enum("palpate.fix", "kind")
        layout.operator_menu_enum("palpate.effect_add", "effect")
        layout.operator_menu_enum("palpate.magnetic_skin_place", "preset")
        layout.operator("palpate.sensor_remove", icon="X")
        layout.separator()
        _draw_operators(layout, "palpate.stiffness_fit", "palpate.friction_fit")
        layout.separator()
        layout.operator("palpate.bake", icon="RENDER_ANIMATION")
        _draw_operators(layout, "palpate.bake_clear", "palpate.display_refresh", "palpate.figures_make")
        _draw_operators(layout, "palpate.catch_up", "palpate.reset")
        layout.separator()
        layout.operator("palpate.study_vary", text="Vary in Study…")
        _draw_operators(layout, "palpate.study_remove", "palpate.study_run", "palpate.study_write", "palpate.study_report")
        layout.separator()
        _draw_operators(layout, "palpate.measured_open", "palpate.measured_logs", "palpate.gap_find", "palpate.gap_plan")
        _draw_operators(layout, "palpate.gap_add", "palpate.gap_curves", "palpate.gap_show", "palpate.gap_report")
        layout.separator()
        layout.operator("palpate.debug_info_copy")


def _draw_operators(layout, *names: str) -> None:
    """Draw operators by their own names, one below the other."""
    for name in names:
        layout.operator(name)


def _draw(self, _context):
    self.layout.menu("PALPATE_MT_object")


def _draw_edit(self, _context):
    layout = self.layout
    layout.separator()
    layout.operator("palpate.sensor_add", text="Make Palpate Sensor")
    layout.operator("palpate.skin_add", text="Lay Texels on Selection")


def _draw_add(self, _context):
    self.layout.separator()
    self.layout.operator("palpate.pad_mesh_add", icon="MESH_GRID")


def _draw_import(self, _context):
    self.layout.operator("palpate.openrave_import")
    self.layout.operator("palpate.sensor_toml_import")
    self.layout.operator("palpate.sensor_import", text="Palpate Sensor of Another Program")


def _draw_export(self, _context):
    self.layout.operator("palpate.openrave_export")
    self.layout.operator("palpate.sensor_toml_export")
    self.layout.operator_menu_enum("palpate.sensor_export", "to", text="Palpate Sensors for a Simulator")


def _draw_physics(self, context):
    """Add and remove as Blender's own kinds of physics are, among their buttons."""
    obj = context.object
    if obj is None or obj.type not in participants.OBJECT_TYPES:
        return
    if obj.palpate.role == "NONE":
        self.layout.operator("palpate.sensor_add", text="Tactile Sensor", icon="PHYSICS")
    else:
        self.layout.operator("palpate.sensor_remove", text="Tactile Sensor", icon="X")


def _draw_render(self, context):
    """Say in the window of a render what it lacks: a render runs in a thread, which cannot report anything."""
    image = context.space_data.image
    if session_state.session.render_note and image is not None and image.type == "RENDER_RESULT":
        self.layout.label(text=session_state.session.render_note, icon="ERROR")


VARIABLE_TYPES = {"BOOLEAN", "INT", "FLOAT", "ENUM"}
"""Types of properties that a study may vary."""


def _draw_button(self, context):
    """Offer to vary the property of the button that was right-clicked."""
    pointer, item = getattr(context, "button_pointer", None), getattr(context, "button_prop", None)
    if pointer is None or item is None or item.type not in VARIABLE_TYPES:
        return
    chosen = getattr(context, "property", None)  # data-block, path and component, in Blenders that tell it
    path = property_path.path_of(pointer, item.identifier, chosen[2] if chosen is not None else -1)
    if path:
        self.layout.separator()
        if not item.is_animatable and ".palpate." in path:
            self.layout.label(text=f"{CONSTANT}: vary it in a study", icon="INFO")
        self.layout.operator("palpate.study_vary", icon="MOD_ARRAY").path = path


ENTRIES = (
    ("TOPBAR_MT_file_import", _draw_import),
    ("TOPBAR_MT_file_export", _draw_export),
    ("VIEW3D_MT_mesh_add", _draw_add),
    ("VIEW3D_MT_object", _draw),
    ("VIEW3D_MT_edit_mesh_faces", _draw_edit),
    ("VIEW3D_MT_edit_mesh_vertices", _draw_edit),
    ("VIEW3D_MT_edit_mesh", _draw),
    ("VIEW3D_MT_paint_weight", _draw),
    ("VIEW3D_MT_sculpt", _draw),
    ("UI_MT_button_context_menu", _draw_button),
    ("PHYSICS_PT_add", _draw_physics),
)


def register():
    bpy.utils.register_class(PALPATE_MT_object)
    for menu, draw in ENTRIES:
        getattr(bpy.types, menu).append(draw)
    bpy.types.IMAGE_HT_header.prepend(_draw_render)  # at its beginning: the end is cut off in a small window


def unregister():
    bpy.types.IMAGE_HT_header.remove(_draw_render)
    for menu, draw in reversed(ENTRIES):
        getattr(bpy.types, menu).remove(draw)
    bpy.utils.unregister_class(PALPATE_MT_object)
