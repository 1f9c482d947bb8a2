# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown follows what is changed at the same frame: live numbers, a bake, after undo and in another scene."""

import importlib

import bpy
import press
import solver


def frame_status():
    return importlib.import_module("bl_ext.user_default.palpate.addon.session.frame_status")


def says(scene, words):
    return lambda: words in frame_status().status_of(scene).text


def road(ui):
    press.build(ui.out)
    scene, view = bpy.context.scene, ui.area("VIEW_3D")
    press.obj("Pad").palpate.role = "SENSOR"
    with ui.context(view):
        bpy.ops.view3d.view_selected()
    yield from ui.tab("PHYSICS")
    yield from solver.wait(ui)
    yield from ui.move(*ui.centre(view))
    for _ in range(9):
        yield from ui.key("RIGHT_ARROW")
    yield from ui.becomes(lambda: scene.frame_current == 10 and frame_status().status_of(scene).frame, "frame 10 has numbers")
    before = frame_status().status_of(scene).frame
    press.obj("Pad").palpate.k *= 2
    yield from ui.becomes(lambda: frame_status().status_of(scene).frame is not before, "a stiffer skin takes them away or anew")
    ui.check(scene.frame_current == 10, "at the same frame")

    scene.frame_end = 20
    yield from ui.press("palpate.bake()")
    yield from ui.wait_until(lambda: press.obj("Pad").palpate.is_baked, "the bake is done", timeout=120.0)
    view.spaces.active.shading.type = "SOLID"
    scene.frame_set(20)
    yield from ui.becomes(says(scene, "Frame 20 of the bake."), "the panel says which frame it shows")
    yield 2.0
    yield from ui.screenshot("solid")

    yield from ui.move(*ui.centre(view))
    yield from ui.key("Z", ctrl=True)
    yield from ui.becomes(lambda: not press.obj("Pad").palpate.is_baked, "Ctrl Z takes the bake away")
    yield from ui.key("Z", ctrl=True, shift=True)
    yield from ui.becomes(lambda: press.obj("Pad").palpate.is_baked, "Ctrl Shift Z brings it back")
    scene = bpy.context.scene
    yield from ui.becomes(says(scene, "of the bake."), "and its numbers at once")

    other = bpy.data.scenes.new("Other")
    ui.window.scene = other
    yield 1.0
    frame_status().forget_all()
    ui.window.scene = scene
    yield from ui.becomes(says(scene, "of the bake."), "so does a change of the scene")

    press.obj("Pad").palpate.mus = 0.123
    yield from ui.becomes(says(scene, "out of date"), "a changed friction makes it out of date at once")
    yield 1.0
    yield from ui.screenshot("out-of-date")
