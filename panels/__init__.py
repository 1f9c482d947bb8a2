# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels and menus. They only draw; they compute nothing."""

_panels: tuple = ()


def _classes():
    global _panels
    if not _panels:
        from . import bake, body, effects, gap, sensor, study, subpanels, texels

        chosen = (
            sensor.Root,
            bake.Bake,
            *texels.SUBPANELS,
            *sensor.SUBPANELS,
            *effects.SUBPANELS,
            *gap.SUBPANELS,
            *body.SUBPANELS,
            *bake.SUBPANELS,
            *study.SUBPANELS,
        )
        _panels = subpanels.in_all_places(*chosen)
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
