# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for sensors with their own mesh: tactile pads, and texels that are laid onto another object's surface."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty
from bpy_extras.object_utils import AddObjectHelper, object_data_add

from ..addon.authoring import laid_sensors, sensors
from ..addon.properties import object_properties
from . import support


class PALPATE_OT_pad_mesh_add(support.PalpateOperator, AddObjectHelper, bpy.types.Operator):
    """Add a pad of texels in rows and columns, flat or bent to a radius, as a sensor"""

    bl_idname = "palpate.pad_mesh_add"
    bl_label = "Tactile Pad"
    needs = (support.Condition(lambda context: context.mode == "OBJECT", "Switch to Object Mode first"),)

    rows: IntProperty(name="Rows", description="Texels along +Y", default=14, min=2, soft_max=128)
    columns: IntProperty(name="Columns", description="Texels along +X", default=6, min=2, soft_max=128)
    pitch_x: FloatProperty(
        name="Column Pitch (m)", description="From column to column, m", default=0.0034, min=1e-6, precision=5, step=0.01
    )
    pitch_y: FloatProperty(
        name="Row Pitch (m)", description="From row to row, m", default=0.0034, min=1e-6, precision=5, step=0.01
    )
    radius: FloatProperty(
        name="Radius (m)",
        description="Bend about Y, m: above zero outwards as on a finger, below zero inwards, zero is flat",
        precision=5,
        step=0.1,
    )
    make_sensor: BoolProperty(name="Make Sensor", description="Give it the role Sensor", default=True)

    def run(self, context):
        mesh = laid_sensors.pad_mesh(context, self.rows, self.columns, (self.pitch_x, self.pitch_y), self.radius)
        obj = object_data_add(context, mesh, operator=self)
        if self.make_sensor:
            sensors.make_sensor(obj, "MESH")
        self.report({"INFO"}, f"'{obj.name}' has {self.rows} × {self.columns} texels")

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        column = layout.column()
        for name in ("rows", "columns", "pitch_x", "pitch_y", "radius", "make_sensor", "align", "location", "rotation"):
            column.prop(self, name)


class PALPATE_OT_skin_add(support.PalpateOperator, object_properties.PatternProperties, bpy.types.Operator):
    """Lay texels onto the surface of the active mesh: a sensor of its own that is fixed to it; an object can carry several"""

    bl_idname = "palpate.skin_add"
    bl_label = "Lay Texels"
    needs = support.MESH

    source: EnumProperty(
        name="Region",
        description="Where on the surface texels are laid",
        items=(
            ("AUTO", "Automatic", "Selection in Edit Mode, painted group in Weight Paint, sensor's region, or whole mesh"),
            ("OWN", "Sensor's Region", "The region that the object has as a sensor"),
            ("SELECTION", "Selection", "Selected faces; they are kept in a vertex group"),
            ("GROUP", "Active Vertex Group", "Vertices whose weight reaches the threshold"),
            ("MATERIAL", "Active Material", "Faces with the active material"),
            ("FACE_SET", "Face Set", "Faces of the set that the active face is in"),
            ("MESH", "Whole Mesh", "Everywhere"),
        ),
        default="AUTO",
        options={"SKIP_SAVE"},
    )
    method: EnumProperty(
        name="Pattern", description="How texels are laid", items=object_properties.SKIN_METHODS[1:], default="NOISE"
    )
    spacing: FloatProperty(
        name="Spacing (m)",
        description="From texel to texel, m; 0: after the size of the object",
        min=0.0,
        precision=5,
        step=0.01,
    )

    def run(self, context):
        carrier = context.object
        source = self._source(carrier)
        support.leave_edit_mode(context)
        pattern = {key: getattr(self, key) for key in laid_sensors.PATTERN_PROPERTIES}
        pattern["spacing"] = pattern["spacing"] or laid_sensors.usual_spacing(carrier, context.scene)
        replaces = laid_sensors.is_own_region(carrier, source)
        obj = laid_sensors.lay_texels(context, carrier, source, pattern)
        text = f"'{obj.name}' has {len(obj.data.vertices)} texels"
        if replaces:  # its own texels would bear the same load a second time
            carrier.palpate.role = "TARGET" if carrier.palpate.body == "FREE" else "NONE"
            text += f"; '{carrier.name}' is no longer a sensor"
        self.report({"INFO"}, text)

    def _source(self, carrier) -> str:
        if self.source != "AUTO":
            return self.source
        found = sensors.automatic_source(carrier, carrier.mode)
        return "OWN" if found == "MESH" and carrier.palpate.role in {"SENSOR", "PAD"} else found

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "source")
        layout.prop(self, "method")
        column = layout.column()
        for name in object_properties.FIELDS[self.method]:
            column.prop(self, name)


class PALPATE_OT_skin_update(support.PalpateOperator, bpy.types.Operator):
    """Lay the texels of this sensor again onto the current surface; painted groups and attributes are kept"""

    bl_idname = "palpate.skin_update"
    bl_label = "Lay Again"
    needs = (
        *support.MESH,
        support.Condition(
            lambda context: laid_sensors.is_laid(context.object), "'{name}' was not laid onto a surface: use Lay Texels first"
        ),
    )

    def run(self, context):
        support.leave_edit_mode(context)
        count = laid_sensors.update_texels(context, context.object)
        self.report({"INFO"}, f"'{context.object.name}' has {count} texels")


class PALPATE_OT_object_activate(support.PalpateOperator, bpy.types.Operator):
    """Go to this object: make it the active one"""

    bl_idname = "palpate.object_activate"
    bl_label = "Go to Object"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    name: bpy.props.StringProperty(name="Object", description="Name of the object", options={"SKIP_SAVE"})

    def run(self, context):
        obj = context.scene.objects.get(self.name)
        if obj is not None:
            support.leave_edit_mode(context)
            sensors.choose_alone(context, obj)
