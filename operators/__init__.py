# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons: check the context, call one function, report."""


def _classes():
    from . import bake, debug, sensor

    return (*sensor.CLASSES, *bake.CLASSES, *debug.CLASSES)


def register():
    import bpy

    for cls in _classes():
        bpy.utils.register_class(cls)


def unregister():
    import bpy

    for cls in reversed(_classes()):
        bpy.utils.unregister_class(cls)
