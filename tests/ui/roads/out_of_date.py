# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown follows what is changed at the same frame: live numbers, a bake, after undo, in another scene, file or copy."""

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
    yield from ui.becomes(lambda: frame_status().status_of(scene).frame is not before, "a stiffer skin removes or renews them")
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
    yield from ui.move(*ui.centre(ui.area("VIEW_3D")))
    yield from ui.key("S", ctrl=True)
    yield from ui.becomes(lambda: not bpy.data.is_dirty, "Ctrl S saves the file")

    press.obj("Pad").palpate.mus = 0.123
    yield from ui.becomes(says(scene, "has changed since this bake"), "a changed friction makes it out of date at once")
    yield 1.0
    yield from ui.screenshot("out-of-date")

    yield from open_again(ui)
    yield from rename_and_duplicate(ui)
    yield from copy_whole(ui)


def open_again(ui):
    """Open the baked file again."""
    frame_status().forget_all()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    scene = bpy.context.scene
    frame = scene.frame_current
    yield from ui.becomes(says(scene, f"Frame {frame} of the bake."), "a baked file that is opened shows its numbers at once")
    ui.check(scene.frame_current == frame, "at its own frame")
    yield 1.0
    yield from ui.screenshot("opened")


def rename_and_duplicate(ui):
    """Numbers, HUD and arrow take the new name of a sensor; its duplicate is not baked."""
    scene, inset = bpy.context.scene, importlib.import_module("bl_ext.user_default.palpate.addon.display.inset")
    press.obj("Pad").name = "Palm"
    yield from ui.becomes(lambda: "Net Force Palm" in scene.objects, "a renamed sensor renames its arrow")
    names = [one.name for one in inset._contents[scene.session_uid].insets]
    ui.check("Palm" in names and "Pad" not in names, "and is called so in the HUD")
    ui.check("Palm" in frame_status().status_of(scene).frame.sensors, "and in the panel")
    yield from ui.becomes(says(scene, "of the bake."), "its bake is not out of date")
    yield from ui.screenshot("renamed")
    for thing in scene.objects:
        thing.select_set(thing.name == "Palm")
    ui.window.view_layer.objects.active = press.obj("Palm")
    with ui.context(ui.area("VIEW_3D")):
        bpy.ops.object.duplicate()
    yield from ui.becomes(lambda: not press.obj("Palm.001").palpate.is_baked, "the duplicate is not baked")
    ui.check(press.obj("Palm").palpate.is_baked, "and the original is")
    bpy.data.objects.remove(press.obj("Palm.001"))
    press.obj("Palm").name = "Pad"
    yield from ui.becomes(lambda: "Net Force Pad" in scene.objects, "the old name comes back")


def arrows():
    """Return the names of the present scene's force arrows."""
    return sorted(thing.name for thing in bpy.context.scene.objects if "Net Force" in thing.name)


def copy_whole(ui):
    """Bake a full copy of the scene, and clear its bake: no arrow of the original stays in it."""
    count = len(arrows())
    with ui.context(ui.area("VIEW_3D")):
        bpy.ops.scene.new(type="FULL_COPY")
    yield 1.0
    copy = bpy.context.scene
    for thing in copy.objects:
        thing.select_set(thing.name == "Pad.001")
    ui.window.view_layer.objects.active = copy.objects["Pad.001"]
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.bake()")
    yield from ui.wait_until(lambda: ui.works("palpate.bake") or len(arrows()) == count, "the copy is being baked")
    yield from ui.wait_until(lambda: not ui.works("palpate.bake"), "the copy is baked", timeout=120.0)
    yield from ui.becomes(says(bpy.context.scene, "of the bake."), "and its numbers are shown")
    ui.check(len(arrows()) == count, "it has as many arrows as the original")
    yield from ui.search("Clear Bake")
    yield from ui.becomes(lambda: not arrows(), "Clear Bake takes every arrow out of the copy")
    ui.check(not bpy.context.scene.objects["Pad.001"].palpate.is_baked, "and its bake")
    ui.window.scene = bpy.data.scenes["Scene"]
    yield 1.0
    ui.check(len(arrows()) == count, "the original keeps its own")
