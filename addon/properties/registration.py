# SPDX-License-Identifier: GPL-3.0-or-later
"""Register and unregister all properties."""

import bpy
from bpy.props import PointerProperty

from . import effect_stack, figure_properties, object_properties, scene_properties

CLASSES = (
    effect_stack.PALPATE_PG_effect,
    figure_properties.PALPATE_PG_figures,
    object_properties.PALPATE_PG_skin,
    object_properties.PALPATE_PG_readout,
    object_properties.PALPATE_PG_magnetic,
    scene_properties.PALPATE_AP_preferences,
    scene_properties.PALPATE_PG_study_variable,
    scene_properties.PALPATE_PG_study,
    object_properties.PALPATE_PG_object,
    scene_properties.PALPATE_PG_scene,
)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.palpate = PointerProperty(type=object_properties.PALPATE_PG_object, override={"LIBRARY_OVERRIDABLE"})
    bpy.types.Scene.palpate = PointerProperty(type=scene_properties.PALPATE_PG_scene)


def unregister():
    del bpy.types.Scene.palpate
    del bpy.types.Object.palpate
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
