# SPDX-License-Identifier: GPL-3.0-or-later
"""The Figures panel: all that can be chosen is chosen by hand and made, ESC stops it, and the scene is as it was."""

import importlib

import bpy
import solver

PACKAGE = "bl_ext.user_default.palpate"
SENSOR = "Left finger"


def build(ui):
    """The sample grasp, as far as the fingers have closed, baked."""
    scene = bpy.context.scene
    importlib.import_module(f"{PACKAGE}.sample_blends.grasp").build(scene)
    scene.frame_start, scene.frame_end = 8, 16
    bpy.context.view_layer.objects.active = scene.objects[SENSOR]
    bpy.ops.wm.save_as_mainfile(filepath=str(ui.out / "grasp.blend"))
    scene.frame_set(scene.frame_start)
    yield from solver.wait(ui)
    bpy.ops.palpate.bake("EXEC_DEFAULT")
    bpy.ops.wm.save_mainfile()


def own():
    return bpy.context.scene.palpate.figures


def turn_to(ui, name, value):
    """Choose from a menu with Ctrl and the wheel."""
    yield from ui.find(f"palpate.figures.{name}")
    for _ in own().bl_rna.properties[name].enum_items:
        if getattr(own(), name) == value:
            break
        ui.event("WHEELDOWNMOUSE", ctrl=True)
        yield 0.2
    ui.check(getattr(own(), name) == value, f"{name} is {value}")


def road(ui):
    yield from build(ui)
    scene, place = bpy.context.scene, ui.out / "figures"
    camera = scene.camera.name
    scene.frame_set(12)
    view = ui.area("VIEW_3D")
    with ui.context(view):
        bpy.ops.view3d.view_camera()
    yield from ui.tab("PHYSICS")
    yield from ui.filter("Make Figures")
    yield from ui.find("palpate.figures_make()")  # at the end of the panel: above it, all of the panel is in sight
    yield from ui.screenshot("panel")
    yield from ui.press("palpate.figures.exports")
    ui.check(own().exports == {"CSV"}, "tables are chosen")
    own().kinds |= {"VIDEO"}  # by hand it takes Shift, which no event can hold
    yield from turn_to(ui, "engine", "WORKBENCH")
    own().size = 480, 360
    yield from ui.screenshot("chosen")

    yield from ui.press("palpate.figures_make()")
    yield from ui.wait_until(lambda: list(place.glob("**/scene*.png")), "the first figure waits for the others", timeout=180)
    yield from ui.stop("palpate.figures_make")  # many figures and a video are still to come
    ui.check(not (place / "video.mp4").exists(), "before the video")
    ui.check(scene.camera.name == camera and "Palpate Camera" not in bpy.data.objects, "and the camera is the scene's own")
    ui.check(scene.frame_current == 12, "and the frame as before")
    yield from ui.becomes(lambda: not list(place.glob("**/scene*.png")), "and no figure of an unfinished set stays")
    ui.check(not list(place.glob("*.part*")), "and nothing half-made stays")
    yield from ui.screenshot("stopped")

    yield from ui.press("palpate.figures_make()")
    yield from ui.screenshot("at-work")
    yield from ui.wait_until(lambda: (place / "video.mp4").exists(), "the video is there", timeout=300)
    yield from ui.wait_until(lambda: not ui.works("palpate.figures_make"), "all is made")
    ui.value("files", sorted(path.name for path in place.iterdir()))
    ui.check(scene.frame_current == 12 and scene.camera.name == camera, "the scene is as before")
    yield from ui.screenshot("made")
    yield from ui.filter("")
