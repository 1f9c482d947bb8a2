# SPDX-License-Identifier: GPL-3.0-or-later
"""Add a probe that presses on a sensor, to try the sensor out."""

import bpy
from bpy.props import EnumProperty, FloatProperty

from ..addon.authoring import probes, sensors
from . import support


class PALPATE_OT_probe_add(support.PalpateOperator, bpy.types.Operator):
    """Add an object that presses on the middle of the active sensor, holds and retracts within the scene's frame range"""

    bl_idname = "palpate.probe_add"
    bl_label = "Add Probe"
    needs = support.SENSOR

    shape: EnumProperty(
        name="Shape",
        description="Of the probe",
        items=(
            ("BALL", "Ball", "A sphere"),
            ("ROD", "Rod", "A cylinder that lies on the sensor"),
            ("BOX", "Box", "A cube, flat on the sensor"),
        ),
    )
    size: FloatProperty(
        name="Radius (m)",
        description="Of a ball or rod, half of a box's side, m; 0 is a third of the sensor's extent",
        min=0.0,
        precision=5,
        step=0.1,
    )
    depth: FloatProperty(
        name="Depth (m)",
        description="Depth of the press, m; 0 is a quarter of the maximum penetration",
        min=0.0,
        precision=5,
        step=0.01,
    )

    def run(self, context):
        support.leave_edit_mode(context)
        note = sensors.follow_size(context.scene, context.object)  # of a region that was painted
        probe = probes.add_probe(context, context.object, self.shape, self.size, self.depth)
        context.scene.frame_set(context.scene.frame_start)
        self.report(
            {"INFO"}, f"'{probe.name}' presses on '{context.object.name}': press Space to play. {note}".removesuffix(". ")
        )
