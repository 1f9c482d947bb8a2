# SPDX-License-Identifier: GPL-3.0-or-later
"""A sample scene opens to a picture: in its camera's view, its sensor active, and its forces computed without a click."""

import importlib
import shutil
from pathlib import Path

import bpy
import solver

MODULE = "bl_ext.user_default.palpate"


def road(ui):
    path = ui.out / "sample.blend"
    package = importlib.import_module(MODULE)
    shutil.copy(Path(package.__file__).parent / "sample_blends" / "fingertip.blend", path)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    yield 1.0
    yield from solver.wait(ui)
    scene, view = bpy.context.scene, ui.area("VIEW_3D").spaces.active
    ui.check(
        view.region_3d.view_perspective == "CAMERA" and view.shading.type == "MATERIAL", "in the camera's view, with materials"
    )
    ui.check(bpy.context.object.name == "Fingertip", "the sensor is active")
    ui.check(ui.area("PROPERTIES").spaces.active.context == "PHYSICS", "its Physics tab is shown")
    ui.check(scene.frame_current == 24, "at a frame of contact")
    status = importlib.import_module(f"{MODULE}.addon.session.frame_status")

    def force():
        frame = status.status_of(scene).frame
        return frame is not None and frame.frame == 24 and frame.sensors["Fingertip"].normal_force.sum()

    yield from ui.wait_until(force, "its forces are computed", timeout=240)
    ui.value("force", float(force()))
    yield from ui.screenshot("open")
