# SPDX-License-Identifier: GPL-3.0-or-later
"""What is played and baked follows what is done: jumps, ESC, undo, edits, saving, opening, renaming and copies."""

import bpy
from steps import forces, key_over_view, obj, palpate, press_scene, solver, status, timeline, undo


def says(words):
    return lambda: words in status().text


def road(ui):
    yield from press_scene(ui)
    for name in ("Pad", "Pad 2"):
        obj(name).palpate.role = "SENSOR"
    scene = bpy.context.scene
    yield from ui.tab("PHYSICS")
    yield from solver(ui)
    yield from play(ui, scene)
    yield from render(ui, scene)
    yield from jump(ui, scene)
    yield from bake(ui, scene)
    yield from figures(ui)
    yield from change(ui)
    yield from open_again(ui)
    yield from copy(ui)


def play(ui, scene):
    """Space plays and computes, and arrows show what is known; an edit renews it."""
    scene.frame_end = 100_000  # however slow or fast the machine is, playing does not start again, nor ends a bake before ESC
    yield from key_over_view(ui, "SPACE")
    yield from ui.wait_until(lambda: scene.frame_current >= 25, "the timeline played to frame 25")
    yield from ui.key("SPACE")
    frame = scene.frame_current
    ui.check(max(forces("Pad")) > 0.0, "playing computed forces")
    ui.check(obj("Cube").location.z < 0.45, "playing moved the free body")
    yield from ui.screenshot("played")
    height = obj("Cube").location.z
    yield from ui.key("LEFT_ARROW")
    ui.check(scene.frame_current == frame - 1, "an arrow key goes one frame back")
    yield from ui.key("RIGHT_ARROW")
    ui.check(obj("Cube").location.z == height, "and forward again shows the same")
    before = status().frame
    obj("Pad").palpate.k *= 2
    renewed = lambda: status().frame is not None and status().frame is not before and status().frame.frame == frame  # noqa: E731
    yield from ui.becomes(renewed, "a stiffer skin renews the numbers by itself")
    ui.check(scene.frame_current == frame, "at the same frame")


def render(ui, scene):
    """Ctrl F12 on a scene that is not baked: the window of the render says that free bodies stay."""
    session = palpate("addon.session.session_state").session
    scene.frame_set(1)
    scene.render.engine, scene.render.filepath, scene.frame_end = "BLENDER_WORKBENCH", str(ui.out / "frame_"), 3
    scene.render.resolution_x, scene.render.resolution_y = 800, 500
    bpy.ops.object.camera_add(location=(0.0, -9.0, 3.0), rotation=(1.3, 0.0, 0.0))
    scene.camera = bpy.context.object
    ui.window.view_layer.objects.active = obj("Pad")
    with ui.context(ui.area("VIEW_3D")):
        bpy.ops.render.render("INVOKE_DEFAULT", animation=True)
    yield from ui.wait_until(
        lambda: (ui.out / "frame_0003.png").is_file() and not session.rendering, "three frames are rendered"
    )
    ui.check("is rendered without forces" in session.render_note, "it says what the frames lack")
    yield 1.0
    yield from ui.screenshot("render")
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
        bpy.ops.wm.window_close()
    yield 1.0
    bpy.data.objects.remove(scene.camera)
    obj("Pad").select_set(True)
    scene.frame_end = 100_000


def jump(ui, scene):
    """A jump computes what is missing, and a key ends that and does what it always does."""
    scene.frame_set(1)
    yield from timeline(ui, "frame_current", 90_000)
    yield from ui.wait_until(lambda: ui.works("palpate.catch_up"), "the frames up to the jump are computed")
    yield from key_over_view(ui, "G")
    ui.check(ui.works("transform.translate"), "G moves the pad meanwhile")
    ui.check(not ui.works("palpate.catch_up"), "and ends the computation")
    ui.check(scene.frame_current == 90_000, "at the frame that was jumped to")
    yield from ui.key("ESC")
    scene.frame_set(1)


def bake(ui, scene):
    """ESC leaves nothing; undo takes a bake away, and redo brings it back with its numbers."""
    yield from ui.press("palpate.bake()")
    yield from ui.stop("palpate.bake")
    ui.check(not obj("Pad").palpate.is_baked, "nothing is baked")
    yield from ui.becomes(lambda: not list((ui.out / "palpate-bake").glob("*")), "and no files are left")
    scene.frame_end = 20
    yield from ui.press("palpate.bake()")
    yield from ui.wait_until(lambda: obj("Pad").palpate.is_baked, "the bake is done")
    scene.frame_set(20)
    yield from ui.becomes(says("Frame 20 of the bake."), "the panel says which frame it shows")
    ui.check(obj("Net Force Pad").scale[0] > 0.0, "there is a force arrow")
    yield from ui.screenshot("baked")
    yield from undo(ui)
    yield from ui.becomes(lambda: not obj("Pad").palpate.is_baked, "Ctrl Z takes the bake out of the scene")
    ui.check("Net Force Pad" not in bpy.data.objects, "with its arrow")
    yield from undo(ui, shift=True)
    yield from ui.becomes(lambda: obj("Pad").palpate.is_baked, "Ctrl Shift Z brings it back")
    yield from ui.becomes(says("of the bake."), "and its numbers at once")


def figures(ui):
    """Make Figures renders beside the window; ESC stops it, and the scene is as it was."""
    scene = bpy.context.scene  # undo has made a new one
    place, settings, frame = ui.out / "figures", scene.palpate.figures, scene.frame_current
    settings.kinds |= {"VIDEO"}
    settings.engine, settings.size = "WORKBENCH", (480, 360)
    ui.window.view_layer.objects.active = obj("Pad")
    yield from ui.filter("Make Figures")
    yield from ui.press("palpate.figures_make()")
    yield from ui.wait_until(lambda: list(place.glob("**/scene*.png")), "the first figure waits for the others")
    yield from ui.screenshot("figures")
    yield from ui.stop("palpate.figures_make")  # many figures and a video are still to come
    ui.check(scene.camera is None and "Palpate Camera" not in bpy.data.objects, "the scene has no camera, as before")
    ui.check(scene.frame_current == frame, "and the frame as before")
    yield from ui.becomes(lambda: not list(place.glob("**/scene*.png")), "and no figure of an unfinished set stays")
    yield from ui.filter("")


def change(ui):
    """The file is saved, and a setting that is changed makes the bake out of date."""
    yield from key_over_view(ui, "S", ctrl=True)
    yield from ui.becomes(lambda: not bpy.data.is_dirty, "Ctrl S saves the file")
    obj("Pad").palpate.mus = 0.123
    yield from ui.becomes(says("has changed since this bake"), "a changed friction makes it out of date at once")
    yield from ui.screenshot("out-of-date")


def open_again(ui):
    """The file shows its bake when it is opened, under a new name, too."""
    palpate("addon.session.frame_status").forget()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    frame = bpy.context.scene.frame_current
    yield from ui.becomes(says(f"Frame {frame} of the bake."), "a baked file that is opened shows its numbers at once")
    obj("Pad").name = "Palm"
    yield from ui.becomes(lambda: "Net Force Palm" in bpy.data.objects, "a renamed sensor renames its arrow")
    ui.check("Palm" in status().frame.sensors, "and is called so in the panel")
    yield from ui.becomes(says("of the bake."), "its bake is not out of date")
    yield from ui.screenshot("renamed")


def copy(ui):
    """A duplicate is not baked; a full copy of the scene is, and can be cleared without the original."""
    scene = bpy.context.scene
    for thing in scene.objects:
        thing.select_set(thing.name == "Palm")
    ui.window.view_layer.objects.active = obj("Palm")
    with ui.context(ui.area("VIEW_3D")):
        bpy.ops.object.duplicate()
    ui.window.view_layer.update()  # as the redraw after a key does
    yield from ui.becomes(lambda: not obj("Palm.001").palpate.is_baked, "the duplicate is not baked")
    ui.check(obj("Palm").palpate.is_baked, "and the original is")
    with ui.context(ui.area("VIEW_3D")):
        bpy.ops.scene.new(type="FULL_COPY")
    yield 1.0
    yield from ui.search("Clear Bake")
    arrows = lambda: [thing.name for thing in bpy.context.scene.objects if "Net Force" in thing.name]  # noqa: E731
    yield from ui.becomes(lambda: not arrows(), "F3 › Clear Bake takes every arrow out of the copy")
    ui.window.scene = scene
    yield 1.0
    ui.check(arrows() and obj("Palm").palpate.is_baked, "the original keeps its own")
