# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels and menus: they draw what is there and compute nothing."""

_panels: tuple = ()


def _classes():
    global _panels
    if not _panels:
        from . import bake, body, check, effects, gap, places, sensor

        parts = (sensor.Root, *check.PARTS, *sensor.PARTS, *effects.PARTS, *gap.PARTS, *body.PARTS, *bake.PARTS)
        _panels = places.everywhere(*parts)
    return _panels


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
