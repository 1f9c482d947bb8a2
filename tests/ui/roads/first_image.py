# SPDX-License-Identifier: GPL-3.0-or-later
"""From enabling the extension to the first tactile image, by a script that does not wait for a person's hands."""

import importlib
import os
import time

import bpy

MODULE = "bl_ext.user_default.palpate"


def processor_time():
    """Seconds of this process and of its children that have ended."""
    return sum(os.times()[:4])


def is_ready():
    return importlib.import_module(f"{MODULE}.addon.session.first_use").is_ready()


def largest_force():
    pads = [obj.data.attributes.get("palpate_force") for obj in bpy.data.objects if obj.type == "MESH"]
    return max((item.value for attribute in pads if attribute for item in attribute.data), default=0.0)


def road(ui):
    view = ui.area("VIEW_3D")
    ui.check(MODULE not in bpy.context.preferences.addons, "the extension is installed and not enabled")
    with ui.context(view):
        bpy.ops.object.delete()
    yield from ui.move(*ui.centre(view))

    began, worked = time.monotonic(), processor_time()
    bpy.ops.preferences.addon_enable(module=MODULE)
    ui.value("seconds to enable", time.monotonic() - began)
    ui.value("CPU seconds to enable", processor_time() - worked)
    with ui.context(view):
        bpy.ops.palpate.pad_mesh_add()
        bpy.ops.palpate.probe_add()
        bpy.ops.view3d.view_selected()
    bpy.ops.screen.animation_play()
    yield from ui.wait_until(lambda: largest_force() > 0.0, "the pad shows forces", timeout=900.0)
    ui.redraw()
    yield None
    ui.value("frame", bpy.context.scene.frame_current)
    ui.value("seconds to the first image", time.monotonic() - began)
    ui.value("CPU seconds to the first image", processor_time() - worked)
    yield from ui.screenshot("first-image")
    yield from ui.wait_until(is_ready, "the solver is compiled", timeout=900.0)
    ui.value("seconds until the solver is compiled", time.monotonic() - began)
    bpy.ops.screen.animation_play()  # ends it
