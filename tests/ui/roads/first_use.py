# SPDX-License-Identifier: GPL-3.0-or-later
"""The very first use: the solver is compiled beside the window, which answers meanwhile and computes small scenes slowly."""

import importlib
import os
import signal
import sys
import time

import bpy
import press


def preparing():
    return importlib.import_module("bl_ext.user_default.palpate.addon.session.first_use")


def hold(what):
    """Stop the compiler where it is, or let it go on."""
    os.kill(preparing()._compilation.process.pid, what)


def pad_forces():
    attribute = press.obj("Pad").data.attributes.get("palpate_force")
    return [item.value for item in attribute.data] if attribute else []


def road(ui):
    ui.check(not {"numba", "scipy"} & set(sys.modules), "enabling has loaded neither numba nor scipy")
    ui.check(preparing().progress() is None, "without a sensor nothing is prepared")
    press.build(ui.out, sensors=False)
    press.obj("Cube").palpate.role = "NONE"  # a free body asks for seven times as many steps, and the scene would wait
    view = ui.area("VIEW_3D")
    scene = bpy.context.scene
    for thing in scene.objects:
        thing.select_set(thing.type == "MESH")
    with ui.context(view):
        bpy.ops.view3d.view_selected()
    yield 0.5
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.sensor_add()")
    ui.check(preparing().progress() is not None, "the first sensor starts the compiler")

    # The window answers
    longest = 0.0
    for name, point in (("Cube", (-2.5, 0.0, 0.5)), ("Pad", (1.1, -1.1, 0.0)), ("Cube", (-2.5, 0.0, 0.5))):
        began = time.monotonic()
        yield from ui.click(*ui.at(point))
        longest = max(longest, time.monotonic() - began)
        ui.check(bpy.context.view_layer.objects.active.name == name, f"a click selects {name}")
    ui.value("longest click", longest)
    # However fast the machine is, it is still being compiled while the road looks at what goes on meanwhile
    hold(signal.SIGSTOP)
    yield from ui.click(*ui.at((1.1, -1.1, 0.0)))
    yield from ui.filter("Bake")
    yield 1.0
    yield from ui.screenshot("preparing")

    # Playing computes, slowly
    yield from ui.move(*ui.centre(view))
    yield from ui.key("SPACE")
    yield from ui.wait_until(lambda: max(pad_forces(), default=0.0) > 0.0, "what plays is computed", timeout=60)
    ui.check(preparing().progress() is not None and not preparing().is_ready(), "by interpreted kernels")
    ui.value("frame while compiling", scene.frame_current)
    yield from ui.screenshot("playing")
    yield from ui.key("SPACE")

    # So does a bake, which ESC stops
    yield from ui.press("palpate.bake()")
    yield 1.0
    ui.check(preparing().progress() is not None, "it is still being compiled")
    yield from ui.screenshot("bake-slowly")
    yield from ui.stop("palpate.bake")
    ui.check(not press.obj("Pad").palpate.is_baked, "and nothing is baked")

    hold(signal.SIGCONT)
    scene.frame_set(scene.frame_start)
    yield from ui.move(*ui.centre(view))
    yield from ui.key("SPACE")
    yield from ui.wait_until(preparing().is_ready, "the solver is compiled", timeout=600)
    ui.check(preparing()._gave_up is False, "beside the window")
    kernels = importlib.import_module("bl_ext.user_default.palpate.core.compiled.kernels")
    yield from ui.wait_until(lambda: not kernels.are_interpreted(), "what plays has changed over", timeout=30)
    ui.check(max(pad_forces(), default=0.0) > 0.0, "and goes on")
    yield from ui.screenshot("computed")
    yield from ui.key("SPACE")
