# SPDX-License-Identifier: GPL-3.0-or-later
"""Make Figures renders beside the window; ESC stops it, and the scene is as it was."""

import bpy
from steps import palpate, solver


def road(ui):
    scene, place = bpy.context.scene, ui.out / "figures"
    palpate("sample_blends.grasp").build(scene)
    scene.frame_start, scene.frame_end = 8, 16
    bpy.context.view_layer.objects.active = scene.objects["Left finger"]
    bpy.ops.wm.save_as_mainfile(filepath=str(ui.out / "grasp.blend"))
    scene.frame_set(8)
    yield from solver(ui)
    bpy.ops.palpate.bake("EXEC_DEFAULT")
    bpy.ops.wm.save_mainfile()
    scene.frame_set(12)
    settings, camera = scene.palpate.figures, scene.camera.name
    settings.kinds |= {"VIDEO"}
    settings.engine, settings.size = "WORKBENCH", (480, 360)
    yield from ui.tab("PHYSICS")
    yield from ui.filter("Make Figures")
    yield from ui.press("palpate.figures_make()")
    yield from ui.wait_until(lambda: list(place.glob("**/scene*.png")), "the first figure waits for the others")
    yield from ui.screenshot("at-work")
    yield from ui.stop("palpate.figures_make")  # many figures and a video are still to come
    ui.check(scene.camera.name == camera and "Palpate Camera" not in bpy.data.objects, "the camera is the scene's own")
    ui.check(scene.frame_current == 12, "and the frame as before")
    yield from ui.becomes(lambda: not list(place.glob("**/scene*.png")), "and no figure of an unfinished set stays")

    settings.kinds = {"SCENE"}
    yield from ui.press("palpate.figures_make()")
    yield from ui.becomes(lambda: list(place.glob("scene*.png")), "the figures of the scene are there")
    yield from ui.wait_until(lambda: not ui.works("palpate.figures_make"), "all is made")
    ui.check(scene.frame_current == 12 and scene.camera.name == camera, "the scene is as before")
