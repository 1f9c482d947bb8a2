# SPDX-License-Identifier: GPL-3.0-or-later
"""Files through Blender's file browser: a log that leaves a question, and a sensor that is written for MuJoCo."""

import math

import bpy
from steps import add, choose_file, close_plots, key_over_view, obj

TEXELS = 84


def pressed():
    """Rows of a log of 14 × 6 texels under a ball that presses to 1.5 mm three times."""
    for sample in range(600):
        time = sample / 50
        depth = 1.5 * max(0.0, math.sin(math.pi * time / 2.0))
        texels = [
            max(0.0, 0.5 * depth - 0.025 * ((i // 6 - 6.5) ** 2 + (i % 6 - 2.5) ** 2)) + 1e-3 * math.sin(7 * sample + i)
            for i in range(TEXELS)
        ]
        yield ",".join(f"{value:.5f}" for value in (time, depth, sum(texels), *texels))


def road(ui):
    bpy.context.preferences.filepaths.use_relative_paths = False
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    yield from key_over_view(ui, "DEL")
    yield from add(ui, "tactile pad")
    bpy.ops.wm.save_as_mainfile(filepath=str(ui.out / "files.blend"))
    yield from ui.tab("PHYSICS")

    measured = ui.out / "measured"
    measured.mkdir()

    # A rig from a log: what it does not say is asked
    columns = ",".join(f"texel_{i}" for i in range(TEXELS))
    (measured / "press.csv").write_text(f"time (s),depth,force (N),{columns}\n" + "\n".join(pressed()) + "\n", encoding="utf-8")
    yield from ui.filter("Measured Data")
    yield from ui.press("palpate.measured_logs")
    yield from choose_file(ui, measured, "press.csv")
    yield from ui.screenshot("question")
    ui.check(not (measured / "rig" / "rig.toml").exists(), "nothing is written while a question is open")
    yield from ui.key("RET")
    yield from ui.becomes(lambda: (measured / "rig" / "rig.toml").exists(), "Enter takes the proposal and the rig is written")
    ui.check(obj("Tactile Pad").palpate.measured.endswith("rig.toml"), "the sensor has it")
    yield 1.0
    yield from ui.screenshot("recordings")
    yield from close_plots()
    yield from ui.filter("")

    # A sensor for MuJoCo
    folder = ui.out / "mujoco"
    folder.mkdir()
    yield from ui.search("MuJoCo")
    yield from choose_file(ui, folder)
    written = [path.name for path in folder.iterdir() if path.suffix == ".xml"]
    ui.check(len(written) == 1, "File › Export writes MuJoCo's XML")
