# SPDX-License-Identifier: GPL-3.0-or-later
"""The forces of a sample scene are computed without a click when it is opened."""

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
    ui.check(bpy.context.scene.frame_current == 24, "it opens at a frame of contact")

    def force():
        frame = status().frame
        return frame is not None and frame.frame == 24 and frame.sensors["Fingertip"].normal_force.sum()

    yield from ui.wait_until(force, "its forces are computed")
    ui.check(abs(force() - 0.393) < 0.005, f"{force():.3f} N")
