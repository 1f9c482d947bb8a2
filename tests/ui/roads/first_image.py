# SPDX-License-Identifier: GPL-3.0-or-later
"""From enabling the extension to its first tactile image, with a clock; measure_first_image.py plays this."""

import importlib
import resource
import sys
import time

import bpy
import press


def processor_seconds():
    """Return the processor time of this Blender and of the processes that it started and that have ended."""
    return time.process_time() + sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


def is_seen():
    """Tell whether the inset has been drawn with a force in it."""
    inset = importlib.import_module("bl_ext.user_default.palpate.addon.display.inset")
    content = inset._contents.get(bpy.context.scene.session_uid)
    return content and any(one.now > 0.0 and one.texture is not None for one in content.insets)


def road(ui):
    ui.check(not any(name.endswith(".palpate") for name in sys.modules), "the extension is not enabled yet")
    view = ui.area("VIEW_3D")
    began, used = time.monotonic(), processor_seconds()
    bpy.ops.preferences.addon_enable(module="bl_ext.user_default.palpate")
    ui.value("enabled", [time.monotonic() - began, processor_seconds() - used])
    press.build(ui.out, sensors=False)
    press.obj("Pad").palpate.role = "SENSOR"
    with ui.context(view):
        bpy.ops.view3d.view_selected()
    # it plays in a loop: what is passed while the solver is being prepared is computed the next time
    yield from ui.move(*ui.centre(view))
    yield from ui.key("SPACE")
    yield from ui.wait_until(is_seen, "the first tactile image is seen", timeout=600.0)
    ui.value("seen", [time.monotonic() - began, processor_seconds() - used])
    ui.check(True, "it was seen")
    yield from ui.key("SPACE")
    yield from ui.screenshot("seen")
