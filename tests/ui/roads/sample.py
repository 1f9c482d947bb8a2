# SPDX-License-Identifier: GPL-3.0-or-later
"""A sample scene opens to a picture: in its camera's view, its sensor active, and its forces computed without a click."""

import shutil
from pathlib import Path

import bpy
from steps import palpate, solver, status


def road(ui):
    path = ui.out / "sample.blend"
    shutil.copy(Path(palpate().__file__).parent / "sample_blends" / "fingertip.blend", path)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    yield 1.0
    yield from solver(ui)
    scene, view = bpy.context.scene, ui.area("VIEW_3D").spaces.active
    seen = view.region_3d.view_perspective, view.shading.type
    ui.check(seen == ("CAMERA", "MATERIAL"), "in the camera's view, with materials")
    ui.check(bpy.context.object.name == "Fingertip", "the sensor is active")
    ui.check(ui.area("PROPERTIES").spaces.active.context == "PHYSICS", "its Physics tab is shown")
    ui.check(scene.frame_current == 24, "at a frame of contact")

    def force():
        frame = status().frame
        return frame is not None and frame.frame == 24 and frame.sensors["Fingertip"].normal_force.sum()

    yield from ui.wait_until(force, "its forces are computed")
    ui.check(abs(force() - 0.393) < 0.005, f"{force():.3f} N")
