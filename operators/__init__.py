# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons: check the context, call one function, report."""


def _classes():
    from . import bake, debug, effects, exchange, figures, fits, fix, gap, presets, probe, sensor, skin

    rooms = (sensor, skin, presets, effects, fix, probe, fits, gap, exchange, bake, figures, debug)
    return tuple(cls for room in rooms for cls in room.CLASSES)


def register():
    import bpy

    from . import presets

    for cls in _classes():
        bpy.utils.register_class(cls)
    presets.register()


def unregister():
    import bpy

    from . import presets

    presets.unregister()
    for cls in reversed(_classes()):
        bpy.utils.unregister_class(cls)
