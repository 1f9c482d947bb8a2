# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that import and export sensors: OpenRAVE's XML (paper, Table 2) and Palpate's TOML."""

from pathlib import Path

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from ..addon.authoring import exchange
from ..core.errors import SceneError, counted
from . import support


class PALPATE_OT_openrave_import(support.PalpateOperator, support.FileChooser, bpy.types.Operator):
    """Read the parameters of the active sensor from OpenRAVE's XML (a SimTactileSensor, paper's Table 2)"""

    bl_idname = "palpate.openrave_import"
    bl_label = "OpenRAVE Tactile Sensor (.xml)"
    needs = support.EDITABLE_SENSOR

    filename_ext = ".xml"
    filter_glob: StringProperty(default="*.xml", options={"HIDDEN"})
    sensor: StringProperty(
        name="Sensor",
        description="Its name in the file, when there are several; else the one attached to this object",
        default="",
    )

    def run(self, context):
        from ..core.simulators.openrave_file import read_openrave

        obj = context.object
        found = read_openrave(self.filepath)
        matching = [item for item in found if item.name == self.sensor or (not self.sensor and item.link == obj.name)]
        if len(found) == 1 and not self.sensor:
            matching = found
        if len(matching) != 1:
            names = ", ".join(f"'{item.name}'" for item in found)
            raise SceneError(f"'{Path(self.filepath).name}' has {len(found)} sensors: give the name of one, {names}.")
        exchange.put_parameters(obj, matching[0].parameters)
        self.report({"INFO"}, f"'{obj.name}' has the parameters of '{matching[0].name}'")
        if matching[0].missing:
            self.report({"WARNING"}, f"It leaves out {', '.join(matching[0].missing)}: the defaults are used")


class PALPATE_OT_openrave_export(support.PalpateOperator, ExportHelper, bpy.types.Operator):
    """Write the selected sensors, or all of the scene when none is selected, as OpenRAVE's XML (paper's Table 2)"""

    bl_idname = "palpate.openrave_export"
    bl_label = "OpenRAVE Tactile Sensor (.xml)"
    bl_options = set()
    needs = (support.ANY_SENSOR,)

    filename_ext = ".xml"
    filter_glob: StringProperty(default="*.xml", options={"HIDDEN"})

    def run(self, context):
        from ..core.simulators.openrave_file import OpenRaveSensor, write_openrave

        sensors = [obj for obj in context.selected_objects if obj.palpate.role == "SENSOR"]
        sensors = sensors or [obj for obj in context.scene.objects if obj.palpate.role == "SENSOR"]
        write_openrave(self.filepath, [OpenRaveSensor(o.name, o.name, exchange.parameters_of(o)) for o in sensors])
        self.report({"INFO"}, f"Wrote {counted(len(sensors), 'sensor')} to '{self.filepath}'")


class PALPATE_OT_sensor_toml_import(support.PalpateOperator, support.FileChooser, bpy.types.Operator):
    """Read a sensor.toml: parameters and effects for the active sensor, or a new pad when none is active and it has a grid"""

    bl_idname = "palpate.sensor_toml_import"
    bl_label = "Palpate Sensor (.toml)"

    filename_ext = ".toml"
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})

    def run(self, context):
        obj, effects = exchange.load_toml(context, self.filepath)
        name = Path(self.filepath).name
        self.report({"INFO"}, f"'{obj.name}' has the parameters and {counted(effects, 'effect')} of '{name}'")


class PALPATE_OT_sensor_toml_export(support.PalpateOperator, ExportHelper, bpy.types.Operator):
    """Write the active sensor as TOML: its parameters and effects, and its grid where it is a flat one"""

    bl_idname = "palpate.sensor_toml_export"
    bl_label = "Palpate Sensor (.toml)"
    bl_options = set()
    needs = support.SENSOR

    filename_ext = ".toml"
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})

    def run(self, context):
        exchange.save_toml(context, context.object, self.filepath)
        self.report({"INFO"}, f"Wrote '{context.object.name}' to '{self.filepath}'")
