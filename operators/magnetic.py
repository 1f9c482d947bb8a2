# SPDX-License-Identifier: GPL-3.0-or-later
"""Place the magnets and magnetometers of a magnetic skin below a sensor."""

import bpy
from bpy.props import EnumProperty

from ..addon.authoring import magnetic_skins
from ..core.skins.skin_presets import PRESETS
from . import support


class PALPATE_OT_magnetic_skin_place(support.PalpateOperator, bpy.types.Operator):
    """Place the magnets and magnetometers of a skin as it is built below the texels, as empties that you may move"""

    bl_idname = "palpate.magnetic_skin_place"
    bl_label = "Place Magnetic Skin"
    needs = (
        *support.EDITABLE_SENSOR,
        support.Condition(
            lambda context: context.object.palpate.role == "SENSOR",
            "'{name}' is a pad, which is not read out: change its role to Sensor first",
        ),
    )

    preset: EnumProperty(
        name="Skin",
        description="Which magnets and magnetometers",
        items=tuple((name, name, one.text) for name, one in PRESETS.items()),
    )

    def run(self, context):
        obj = context.object
        support.leave_edit_mode(context)
        collection = magnetic_skins.place_skin(context, obj, self.preset)
        count = sum(part.palpate.magnetic.part == "MAGNETOMETER" for part in collection.objects)
        magnets = len(collection.objects) - count
        text = f"'{collection.name}' has {magnets} magnets over {count} magnetometers: '{obj.name}' has {3 * count} channels"
        self.report({"INFO"}, text)
