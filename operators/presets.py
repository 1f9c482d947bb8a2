# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of a sensor as Blender presets, and copied from one sensor to others."""

from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel
from bpy.props import StringProperty

from ..addon.authoring import exchange, laid_sensors
from ..core.errors import FileError, counted
from . import support

SUBDIR = "palpate/sensor"
EXTENSIONS = {".py", ".toml"}
"""Presets of Blender are Python that it executes; a sensor.toml in the same folder is a preset that is only data."""


class PALPATE_PT_presets(PresetPanel, bpy.types.Panel):
    """Known materials and sensors, and your own"""

    bl_label = "Sensor Presets"
    preset_subdir = SUBDIR
    preset_extensions = EXTENSIONS
    preset_operator = "palpate.preset_load"
    preset_add_operator = "palpate.preset_add"


class PALPATE_MT_presets(bpy.types.Menu):
    bl_label = "Sensor Presets"
    preset_subdir = SUBDIR
    preset_extensions = EXTENSIONS
    preset_operator = "palpate.preset_load"

    def draw(self, context):
        layout = self.layout
        self.draw_preset(context)
        layout.separator()
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator("palpate.sensor_toml_import", text="Load from TOML…", icon="IMPORT")
        layout.operator("palpate.sensor_toml_export", text="Save as TOML…", icon="EXPORT")


class PALPATE_OT_preset_load(support.PalpateOperator, bpy.types.Operator):
    """Give the active sensor the values of this preset"""

    # Blender's own script.execute_preset cannot be undone.
    bl_idname = "palpate.preset_load"
    bl_label = "Load Sensor Preset"
    needs = support.EDITABLE_SENSOR

    filepath: StringProperty(subtype="FILE_PATH", options={"HIDDEN", "SKIP_SAVE"})

    def run(self, context):
        path = Path(self.filepath)
        if not path.is_file():
            raise FileError(f"There is no preset '{path}': choose one from the list in the panel's header.")
        support.leave_edit_mode(context)
        if path.suffix.lower() == ".toml":
            exchange.load_toml(context, path)
        else:
            bpy.utils.execfile(str(path))
        self.report({"INFO"}, f"'{context.object.name}' has the values of '{bpy.path.display_name(path.name)}'")


class PALPATE_OT_preset_add(support.Conditions, AddPresetBase, bpy.types.Operator):
    """Save the parameters of the active sensor as a preset, or remove one"""

    bl_idname = "palpate.preset_add"
    bl_label = "Add Sensor Preset"
    needs = support.EDITABLE_SENSOR
    preset_menu = "PALPATE_MT_presets"
    preset_defines = ["settings = bpy.context.object.palpate"]
    preset_values = [f"settings.{name}" for name in laid_sensors.COPIED]
    preset_subdir = SUBDIR

    def execute(self, context):
        if self.remove_name or self.remove_active:
            found = bpy.utils.preset_find(self.name, self.preset_subdir, display_name=True)
            if found and laid_sensors.FOLDER in Path(found).parents:  # Blender takes an extension's files for the user's own
                self.report({"WARNING"}, f"'{self.name}' is part of Palpate and cannot be removed")
                return {"CANCELLED"}
        return super().execute(context)


def _others(context) -> list:
    return [
        obj
        for obj in context.selected_objects
        if obj != context.object and obj.palpate.role in {"SENSOR", "PAD"} and obj.is_editable
    ]


class PALPATE_OT_parameters_copy(support.PalpateOperator, bpy.types.Operator):
    """Give the other selected sensors and pads the parameters and effects of the active one; regions stay"""

    bl_idname = "palpate.parameters_copy"
    bl_label = "Copy to Selected"
    needs = (
        *support.EDITABLE_SENSOR,
        support.Condition(
            lambda context: bool(_others(context)),
            "No other sensor or pad is selected: select them, and the one to copy from last",
        ),
    )

    def run(self, context):
        support.leave_edit_mode(context)
        others = _others(context)
        for obj in others:
            laid_sensors.copy_parameters(context.object, obj)
        self.report({"INFO"}, f"Copied the parameters of '{context.object.name}' to {counted(len(others), 'other')}")


def register():
    bpy.utils.register_preset_path(str(laid_sensors.FOLDER.parent))


def unregister():
    bpy.utils.unregister_preset_path(str(laid_sensors.FOLDER.parent))
