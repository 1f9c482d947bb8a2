# SPDX-License-Identifier: GPL-3.0-or-later
"""Files through Blender's file browser: a measured stiffness, and a sensor for MuJoCo and back."""

import math

import bpy
from steps import add, choose_file, obj, over_view, undo

AREA, TEXELS = 13 * 5 * 0.0034**2, 84  # 14 × 6 vertices span 13 × 5 faces


def sensors():
    return [thing for thing in bpy.data.objects if thing.palpate.role == "SENSOR"]


def road(ui):
    bpy.context.preferences.filepaths.use_relative_paths = False
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    yield from over_view(ui)
    yield from ui.key("DEL")
    yield from add(ui, "tactile pad")
    bpy.ops.wm.save_as_mainfile(filepath=str(ui.out / "files.blend"))
    yield from ui.tab("PHYSICS")

    # Foam that carries 98 kPa with 25 mm
    rows = "\n".join(f"{0.25 * i},{0.98 * i + 0.02 * math.sin(9 * i)}" for i in range(1, 12))
    measured = ui.out / "measured"
    measured.mkdir()
    (measured / "foam.csv").write_text(f"compression (mm),pressure (kPa)\n{rows}\n", encoding="utf-8")
    yield from ui.filter("Foam")
    yield from ui.press("palpate.stiffness_fit")
    yield from choose_file(ui, measured, "foam.csv")
    ui.check(
        abs(obj("Tactile Pad").palpate.k / (980.0 / 0.00025 * AREA / TEXELS) - 1.0) < 0.01, "the stiffness is that of Eq. 18"
    )
    ui.check("Palpate Stiffness Fit" in bpy.data.images, "the plot is kept in the file")
    yield from ui.screenshot("stiffness-fit")
    yield from ui.filter("")

    # Out for MuJoCo, and in again
    folder = ui.out / "mujoco"
    folder.mkdir()
    yield from ui.search("MuJoCo")
    yield from choose_file(ui, folder)
    written = [path.name for path in folder.iterdir() if path.suffix == ".xml"]
    ui.check(len(written) == 1, "File › Export writes MuJoCo's XML")
    yield from ui.key("ESC")  # puts the box with what MuJoCo does not have away, which takes all keys in Blender 5.2
    yield from ui.search("Sensor of Another Program")
    yield from choose_file(ui, folder, written[0])
    ui.check([len(thing.data.vertices) for thing in sensors()] == [TEXELS, TEXELS], "File › Import makes a second sensor of it")
    yield from ui.key("ESC")
    yield from undo(ui)
    ui.check(len(sensors()) == 1, "Ctrl Z takes it away again")
