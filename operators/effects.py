# SPDX-License-Identifier: GPL-3.0-or-later
"""Put effects on a sensor, take them off, and move them."""

import bpy
from bpy.props import EnumProperty, IntProperty

from ..addon.properties import effect_stack
from ..addon.session import transforms
from ..core.effects.engine import registry
from . import support


class PALPATE_OT_effect_add(support.PalpateOperator, bpy.types.Operator):
    """Add an effect of real sensors that the base model lacks: creep, hysteresis, noise and more"""

    bl_idname = "palpate.effect_add"
    bl_label = "Add Effect"
    needs = support.EDITABLE_SENSOR

    effect: EnumProperty(name="Effect", description="What to add", items=effect_stack.kind_items(), options={"SKIP_SAVE"})

    @classmethod
    def description(cls, _context, properties):
        return registry.kind_of(properties.effect).text.removesuffix(".")

    def run(self, context):
        obj = context.object
        gain = transforms.as_typed(obj.palpate.gain)
        effect_stack.add(obj, registry.effect(self.effect, gain=gain))
        self.report({"INFO"}, f"'{obj.name}' has {registry.kind_of(self.effect).title.lower()}")


HAS_EFFECTS = support.Condition(
    lambda context: bool(context.object.palpate.effects), "'{name}' has no effects: use Add Effect first"
)


class PALPATE_OT_effect_remove(support.PalpateOperator, bpy.types.Operator):
    """Remove the effect from the sensor"""

    bl_idname = "palpate.effect_remove"
    bl_label = "Remove Effect"
    needs = (*support.EDITABLE_SENSOR, HAS_EFFECTS)

    index: IntProperty(name="Index", description="Place in the stack", min=0, options={"SKIP_SAVE"})

    def run(self, context):
        context.object.palpate.effects.remove(self.index)


class PALPATE_OT_effect_move(support.PalpateOperator, bpy.types.Operator):
    """Move the effect in the stack. Different effects act in a fixed order; the stack orders effects of one kind"""

    bl_idname = "palpate.effect_move"
    bl_label = "Move Effect"
    needs = (*support.EDITABLE_SENSOR, HAS_EFFECTS)

    index: IntProperty(name="Index", description="Place in the stack", min=0, options={"SKIP_SAVE"})
    way: EnumProperty(
        name="Direction",
        description="Where to",
        items=(("UP", "Up", "Towards the first"), ("DOWN", "Down", "Towards the last")),
        options={"SKIP_SAVE"},
    )

    def run(self, context):
        stack = context.object.palpate.effects
        to = self.index + (-1 if self.way == "UP" else 1)
        stack.move(self.index, min(max(to, 0), len(stack) - 1))
