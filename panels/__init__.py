# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels and menus: they draw what is there and compute nothing."""


def _classes():
    from . import bake, body, sensor

    return (*sensor.CLASSES, *body.CLASSES, *bake.CLASSES)


def register():
    import bpy

    from . import menus

    for cls in _classes():
        bpy.utils.register_class(cls)
    menus.register()


def unregister():
    import bpy

    from . import menus

    menus.unregister()
    for cls in reversed(_classes()):
        bpy.utils.unregister_class(cls)
