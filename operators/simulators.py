# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that write sensors for other simulators and read theirs."""

import bpy
from bpy.props import EnumProperty, StringProperty

from ..addon.authoring import sensor_exchange, sensor_import
from ..core.errors import counted
from . import support


def _format_items(_self, _context):
    from ..core.simulators.sensor_format import written_formats

    _format_items.kept = [(name, item.title, item.description) for name, item in written_formats().items()]
    return _format_items.kept  # Blender does not keep the texts itself


class PALPATE_OT_sensor_export(support.PalpateOperator, bpy.types.Operator):
    """Write the selected sensors, or all of the scene when none is selected, into a folder, for another simulator"""

    bl_idname = "palpate.sensor_export"
    bl_label = "Export Sensors"
    bl_options = set()
    needs = (support.ANY_SENSOR,)

    to: EnumProperty(name="Format", description="Simulator or format to write for", items=_format_items)
    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE"})
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def run(self, context):
        from ..core.simulators.sensor_format import export_sensors

        names = [obj.name for obj in context.selected_objects if obj.palpate.role in {"SENSOR", "PAD"}]
        sensors = sensor_exchange.sensors_on_meshes(context.scene, names)
        written = export_sensors(sensors, self.to, bpy.path.abspath(self.directory))
        for note in written.notes:
            self.report({"WARNING"}, note)
        files = f"{counted(len(written.files), 'file')} of {counted(len(sensors), 'sensor')}"
        self.report({"INFO"}, f"Wrote {files} to '{self.directory}'")


class PALPATE_OT_sensor_import(support.PalpateOperator, support.FileChooser, bpy.types.Operator):
    """Read sensors of MuJoCo's MJCF, a URDF, a probe list, OpenRAVE's XML or a .blend of GenTact into the scene"""

    bl_idname = "palpate.sensor_import"
    bl_label = "Import Sensor"
    needs = (support.SCENE,)

    filename_ext = ".xml"
    filter_glob: StringProperty(default="*.xml;*.mjcf;*.urdf;*.json;*.blend", options={"HIDDEN"})

    def run(self, context):
        support.leave_edit_mode(context)
        objects, notes = sensor_import.import_file(context, self.filepath)
        for note in notes:
            self.report({"WARNING"}, note)
        self.report({"INFO"}, f"Read {', '.join(obj.name for obj in objects)}")
