# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators. Each checks the context, calls one function and reports."""

import importlib
import pkgutil


def _classes() -> list[type]:
    """Return the classes for Blender of all modules here: those whose names begin with PALPATE_."""
    modules = [importlib.import_module(f".{item.name}", __package__) for item in pkgutil.iter_modules(__path__)]
    return [found for module in modules for name, found in vars(module).items() if name.startswith("PALPATE_")]


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
