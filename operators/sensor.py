# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that give objects their roles and sensors their regions."""

import bpy
import numpy as np
from bpy.props import EnumProperty

from ..addon.authoring import sensors
from ..addon.scene import sensor_regions
from . import support


class PALPATE_OT_sensor_add(support.PalpateOperator, bpy.types.Operator):
    """Make the active mesh a tactile sensor: each vertex of the region becomes a texel"""

    bl_idname = "palpate.sensor_add"
    bl_label = "Make Sensor"
    needs = support.MESH

    source: EnumProperty(
        name="Region",
        description="Which vertices become texels",
        items=(
            ("AUTO", "Automatic", "The selection in Edit Mode, the painted group in Weight Paint, else the whole mesh"),
            ("SELECTION", "Selection", "Selected faces or vertices; they are kept in a vertex group"),
            ("GROUP", "Active Vertex Group", "Vertices whose weight reaches the threshold"),
            ("MATERIAL", "Active Material", "Faces with the active material"),
            ("FACE_SET", "Face Set", "Faces of the set that the active face is in"),
            ("MESH", "Whole Mesh", "Every vertex"),
        ),
        default="AUTO",
        options={"SKIP_SAVE"},
    )
    role: EnumProperty(
        name="Role",
        description="With or without read-out",
        items=(("SENSOR", "Sensor", "Measures contact forces"), ("PAD", "Pad", "Compliant, without read-out")),
        default="SENSOR",
        options={"SKIP_SAVE"},
    )

    def run(self, context):
        obj = context.object
        source = sensors.automatic_source(obj, obj.mode) if self.source == "AUTO" else self.source
        support.leave_edit_mode(context)
        count = sensors.make_sensor(obj, source, self.role)
        note = sensors.follow_size(context.scene, obj)
        text = f"'{obj.name}' is a {self.role.lower()} of {count} texels"
        self.report({"INFO"}, f"{text}. {note}" if note else text)


class PALPATE_OT_role_set(support.PalpateOperator, bpy.types.Operator):
    """Set the role of the selected objects"""

    bl_idname = "palpate.role_set"
    bl_label = "Set Role"
    needs = support.SURFACE

    role: EnumProperty(
        name="Role",
        description="Role of the objects",
        items=(
            ("TARGET", "Target", "Can touch sensors and pads"),
            ("PAD", "Pad", "Compliant like a sensor, without read-out"),
            ("SENSOR", "Sensor", "Measures contact forces"),
        ),
        default="TARGET",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, _context, properties):
        return {
            "TARGET": "Make the active and the selected objects targets: sensors measure contact with them",
            "PAD": "Make the active object a pad: compliant like a sensor, without read-out",
            "SENSOR": "Make the active object a sensor again, on the region it has",
        }[properties.role]

    def run(self, context):
        support.leave_edit_mode(context)
        chosen = [context.object]
        if self.role == "TARGET":
            chosen += [obj for obj in context.selected_objects if obj.palpate.role == "NONE" and obj.type == "MESH"]
        for obj in dict.fromkeys(chosen):
            if self.role != "TARGET" and obj.type != "MESH":
                sensors.make_sensor(obj, "MESH")  # says why not
            obj.palpate.role = self.role


class PALPATE_OT_sensor_remove(support.PalpateOperator, bpy.types.Operator):
    """Remove the active object from the simulation, with its heat map, arrow and baked keyframes; vertex groups stay"""

    bl_idname = "palpate.sensor_remove"
    bl_label = "Remove Role"
    needs = (*support.SURFACE, support.Condition(lambda context: context.object.palpate.role != "NONE", "'{name}' has no role"))

    def run(self, context):
        support.leave_edit_mode(context)
        sensors.remove_role(context.scene, context.object)


class PALPATE_OT_weight_paint(support.PalpateOperator, bpy.types.Operator):
    """Paint the region of a sensor, with a brush of full weight. Vertices painted at or above the threshold become texels"""

    bl_idname = "palpate.weight_paint"
    bl_label = "Paint Region"
    needs = support.MESH

    def run(self, context):
        support.leave_edit_mode(context)
        sensors.group_to_paint(context.object)
        bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
        sensors.set_full_weight_brush(context.tool_settings)


def _face_sets(_operator, context):
    """Return items of a menu. Blender needs the list to stay alive."""
    obj = context.object
    if obj is None or obj.type != "MESH":
        return []
    numbers, counts = np.unique(sensor_regions.face_sets(obj.data), return_counts=True)
    _items[:] = [(str(n), f"Face Set {n}", f"{c} faces", int(n)) for n, c in zip(numbers, counts, strict=True)]
    return _items


_items: list = []


class PALPATE_OT_face_set_choose(support.PalpateOperator, bpy.types.Operator):
    """Choose the face set that is the sensor"""

    bl_idname = "palpate.face_set_choose"
    bl_label = "Choose Face Set"
    needs = (*support.MESH, support.IS_SENSOR)

    face_set: EnumProperty(name="Face Set", description="Face set that is the sensor", items=_face_sets)

    def run(self, context):
        settings = context.object.palpate
        settings.region, settings.face_set = "FACE_SET", int(self.face_set)
