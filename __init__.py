# SPDX-License-Identifier: GPL-3.0-or-later
"""Palpate: make any mesh a tactile sensor in Blender.

Nothing of Blender is imported here at module level, so that ``palpate.core`` loads in a plain Python.
"""

import atexit

from .core.version import VERSION as __version__  # noqa: F401


def _rooms():
    """What registers, in order; each has register() and unregister()."""
    from .addon.session import dependencies

    if dependencies.missing_modules():
        from .panels import missing

        return [missing]
    from . import operators, panels
    from .addon.events import handlers
    from .addon.properties import registration
    from .addon.session import library_folders, openexr_check

    return [library_folders, openexr_check, registration, operators, panels, handlers, _CommandLine]


class _CommandLine:
    """``blender --command palpate …``, in Blenders that have commands."""

    handle = None

    @classmethod
    def register(cls):
        import bpy

        if hasattr(bpy.utils, "register_cli_command"):
            cls.handle = bpy.utils.register_cli_command("palpate", cls.run)

    @classmethod
    def unregister(cls):
        import bpy

        if cls.handle is not None:
            bpy.utils.unregister_cli_command(cls.handle)
            cls.handle = None

    @staticmethod
    def run(argv):
        from .commands import main

        return main(argv)


def register():
    """Called by Blender when the add-on is enabled; a second call changes nothing."""
    if _registered:
        return
    atexit.register(unregister)  # as a Python module, Blender 4.5 hangs at exit when classes are still registered
    try:
        for room in _rooms():
            room.register()
            _registered.append(room)
    except BaseException:
        unregister()
        raise


def unregister():
    """Called by Blender when the add-on is disabled; leaves nothing behind."""
    atexit.unregister(unregister)
    while _registered:
        _registered.pop().unregister()


_registered = []
