# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators. Each checks the context, calls one function and reports."""


def _classes():
    from . import (
        bake,
        debug,
        effects,
        exchange,
        figures,
        fits,
        fix,
        gap,
        laid_sensor,
        magnetic,
        presets,
        probe,
        sensor,
        simulators,
        study,
    )

    modules = (
        sensor,
        laid_sensor,
        magnetic,
        presets,
        effects,
        fix,
        probe,
        fits,
        gap,
        exchange,
        simulators,
        bake,
        figures,
        study,
        debug,
    )
    return tuple(cls for module in modules for cls in module.CLASSES)


def register():
    import bpy

    from . import presets

    for cls in _classes():
        if cls.__doc__:
            cls.bl_description = " ".join(cls.__doc__.split())  # a tooltip keeps the line breaks and the indent of its text
        bpy.utils.register_class(cls)
    presets.register()


def unregister():
    import bpy

    from . import presets

    presets.unregister()
    for cls in reversed(_classes()):
        bpy.utils.unregister_class(cls)
