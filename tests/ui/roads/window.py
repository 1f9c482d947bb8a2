# SPDX-License-Identifier: GPL-3.0-or-later
"""The window opens with the add-on enabled; tabs, the 3D view, the F3 search and fields answer to real events."""

import bpy


def road(ui):
    names = [addon.module for addon in bpy.context.preferences.addons]
    ui.check("bl_ext.user_default.palpate" in names, "the installed add-on is enabled")
    yield from ui.screenshot("start")

    yield from ui.tab("PHYSICS")
    ui.check(ui.area("PROPERTIES").spaces.active.context == "PHYSICS", "the Physics tab is open")
    yield from ui.screenshot("physics-tab")

    yield from ui.move(*ui.centre(ui.area("VIEW_3D")))
    yield from ui.key("A", alt=True)
    ui.check(not bpy.data.objects["Cube"].select_get(), "Alt A deselects the cube")
    yield from ui.click(*ui.at((0, 0, 0)))
    ui.check(bpy.data.objects["Cube"].select_get(), "a click in the 3D view selects it")
    ui.check(not bpy.data.objects["Camera"].select_get(), "the click selects nothing else")
    yield from ui.search("Select All")
    yield from ui.screenshot("after-search")
    ui.check(bpy.data.objects["Camera"].select_get(), "F3 › Select All selects the camera too")
    yield from ui.key("Z", ctrl=True)
    ui.check(not bpy.data.objects["Camera"].select_get(), "Ctrl Z takes that back")

    yield from ui.tab("OBJECT")
    yield from ui.fill("location[0]", "2.5")
    ui.value("location", list(bpy.data.objects["Cube"].location))
    yield from ui.screenshot("field-filled")
