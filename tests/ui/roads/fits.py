# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sensor is made of, by clicks alone: a preset from the panel's header, stiffness and friction from measured files."""

import math

import bpy
from tutorial import add

PRESETS = ("Firm_Fingertip", "Foam", "Soft_Fingertip", "Stiff_Skin", "Weiss")
"""Begin of the files' names, in the order of the list."""


def pad():
    return bpy.data.objects["Tactile Pad"]  # looked up each time: undo makes a new one


def write_measurements(folder):
    """Foam that carries 98 kPa with 25 mm, and a curve that the paper's friction makes, on a texel under 0.08 N."""
    rows = "\n".join(f"{0.25 * i},{0.98 * i + 0.02 * math.sin(9 * i)}" for i in range(1, 12))
    (folder / "foam.csv").write_text(f"compression (mm),pressure (kPa)\n{rows}\n", encoding="utf-8")
    speeds = [0.02 * 1.25**i for i in range(24)]
    forces = [0.08 * (0.23 + 0.205 * math.exp(-((v / 0.3) ** 2))) + 0.01 * v for v in speeds]
    rows = "\n".join(f"{v},{f + 1e-5 * math.sin(40 * v)}" for v, f in zip(speeds, forces, strict=True))
    (folder / "slide.csv").write_text(f"velocity (m/s),force (N)\n{rows}\n", encoding="utf-8")


def choose_file(ui, name):
    """Click a file in the file browser, then its button at the lower right."""
    yield 1.0
    browser = ui.area("FILE_BROWSER")
    files, buttons = ui.region(browser), ui.region(browser, "EXECUTE")
    for row in range(2):  # however the list is sorted
        yield from ui.click(files.x + 80, files.y + files.height - 35 - 20 * row)
        yield 0.3
        if browser.spaces.active.params.filename == name:
            break
    yield from ui.screenshot(f"choose-{name.partition('.')[0]}")
    yield from ui.click(buttons.x + buttons.width - 70, buttons.y + buttons.height // 2)
    yield 1.5


def road(ui):
    view = ui.area("VIEW_3D")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("DEL")
    yield from add(ui, "tactile pad")
    write_measurements(ui.out)
    bpy.ops.wm.save_as_mainfile(filepath=str(ui.out / "fits.blend"))
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    yield from ui.tab("PHYSICS")

    # A preset, from the header of the first panel below Blender's own eight buttons and that of Palpate
    panel = ui.region(ui.area("PROPERTIES"))
    x, y = panel.x + panel.width - 47, panel.y + panel.height - 276
    yield from ui.click(x, y)
    yield 0.5
    yield from ui.screenshot("presets")
    yield from ui.click(x - 90, y + 80 + 21 * (len(PRESETS) - 1 - PRESETS.index("Soft_Fingertip")))  # the list opens upwards
    yield 0.5
    ui.value("preset", {"k": pad().palpate.k, "mus": pad().palpate.mus})
    yield from ui.screenshot("preset-chosen")
    yield from ui.key("ESC")  # Blender 5.2 leaves the list open
    yield from ui.move(*ui.centre(view))
    yield from ui.key("Z", ctrl=True)
    yield 0.5
    ui.check(abs(pad().palpate.k - 58.5) < 1e-4, "Ctrl Z takes the preset back")
    yield from ui.search("preset weiss")
    ui.check(pad().palpate.k == 1000.0, "F3 finds presets, too")

    # Stiffness and friction
    yield from ui.filter("Foam")
    yield from ui.press("palpate.stiffness_fit")
    yield from choose_file(ui, "foam.csv")
    ui.value("k", pad().palpate.k)
    ui.check("Palpate Stiffness Fit" in bpy.data.images, "the plot of the stiffness is kept in the file")
    yield from ui.screenshot("stiffness-fit")
    yield from ui.filter("Curve")
    yield from ui.press("palpate.friction_fit")
    yield from choose_file(ui, "slide.csv")
    ui.value("friction", {name: getattr(pad().palpate, name) for name in ("mus", "mud", "x0", "ct")})
    ui.check("Palpate Friction Fit" in bpy.data.images, "the plot of the friction is kept in the file")
    yield from ui.screenshot("friction-fit")
