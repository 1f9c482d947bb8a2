# SPDX-License-Identifier: GPL-3.0-or-later
"""The very first use: the solver is compiled beside the window, which answers meanwhile and computes small scenes slowly."""

import os
import signal

import bpy
from steps import forces, key_over_view, obj, palpate, press_scene


def preparing():
    return palpate("addon.session.first_use")


def hold(what):
    """Stop the compiler where it is, or let it go on."""
    os.kill(preparing()._compilation.process.pid, what)


def road(ui):
    names = [addon.module for addon in bpy.context.preferences.addons]
    ui.check("bl_ext.user_default.palpate" in names, "the installed add-on is enabled")
    ui.check(preparing().progress() is None, "without a sensor nothing is prepared")
    yield from press_scene(ui)
    obj("Cube").palpate.role = "NONE"  # a free body asks for seven times as many steps, and the scene would wait
    scene = bpy.context.scene
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.sensor_add()")
    ui.check(preparing().progress() is not None, "the first sensor starts the compiler")
    # However fast the machine is, it is still being compiled while the road looks at what goes on meanwhile
    hold(signal.SIGSTOP)
    for name, point in (("Cube", (-2.5, 0.0, 0.5)), ("Pad", (1.1, -1.1, 0.0))):
        yield from ui.click(*ui.at(point))
        ui.check(bpy.context.view_layer.objects.active.name == name, f"the window answers: a click selects {name}")
    yield from ui.filter("Bake")
    yield from ui.screenshot("preparing")

    # Playing computes, slowly
    yield from key_over_view(ui, "SPACE")
    yield from ui.wait_until(lambda: max(forces("Pad")) > 0.0, "what plays is computed")
    ui.check(preparing().progress() is not None and not preparing().is_ready(), "by interpreted kernels")
    yield from ui.key("SPACE")

    hold(signal.SIGCONT)
    scene.frame_set(scene.frame_start)
    yield from key_over_view(ui, "SPACE")
    yield from ui.wait_until(preparing().is_ready, "the solver is compiled", timeout=900)
    ui.check(preparing()._gave_up is False, "beside the window")
    kernels = palpate("core.compiled.kernels")
    yield from ui.wait_until(lambda: not kernels.are_interpreted(), "what plays has changed over")
    yield from ui.wait_until(lambda: max(forces("Pad")) > 0.0, "and goes on")
    yield from ui.key("SPACE")
