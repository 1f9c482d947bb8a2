# SPDX-License-Identifier: GPL-3.0-or-later
"""Files through Blender's file browser: measurements that are opened, and a sensor that is written for MuJoCo."""

import math

import bpy
from steps import add, choose_file, obj, over_view

AREA, TEXELS = 13 * 5 * 0.0034**2, 84  # 14 × 6 vertices span 13 × 5 faces


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

    # A sensor for MuJoCo
    folder = ui.out / "mujoco"
    folder.mkdir()
    yield from ui.search("MuJoCo")
    yield from choose_file(ui, folder)
    written = [path.name for path in folder.iterdir() if path.suffix == ".xml"]
    ui.check(len(written) == 1, "File › Export writes MuJoCo's XML")
