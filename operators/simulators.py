# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that write sensors for other simulators."""

import bpy
from bpy.props import EnumProperty, StringProperty

from ..addon.authoring import sensor_exchange
from . import support


def _format_items(_self, _context):
    from ..core.simulators.registry import written_formats

    _format_items.kept = [(name, item.title, item.description) for name, item in written_formats().items()]
    return _format_items.kept  # Blender does not keep the texts itself


class PALPATE_OT_sensor_export(support.ErrorReporting, bpy.types.Operator):
    """Write the selected sensors, or all of the scene when none is selected, into a folder, for another simulator"""

    bl_idname = "palpate.sensor_export"
    bl_label = "Export Sensors"

    to: EnumProperty(name="Format", description="Simulator or format to write for", items=_format_items)
    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE"})
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        if not any(obj.palpate.role == "SENSOR" for obj in context.scene.objects):
            cls.poll_message_set("There is no sensor in this scene: use Make Sensor first")
            return False
        return True

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def run(self, context):
        from ..core.simulators.registry import export_sensors

        names = [obj.name for obj in context.selected_objects if obj.palpate.role in {"SENSOR", "PAD"}]
        sensors = sensor_exchange.sensors_on_meshes(context.scene, names)
        written = export_sensors(sensors, self.to, bpy.path.abspath(self.directory))
        for note in written.notes:
            self.report({"WARNING"}, note)
        self.report({"INFO"}, f"Wrote {len(written.files)} files of {len(sensors)} sensors to '{self.directory}'")


CLASSES = (PALPATE_OT_sensor_export,)
