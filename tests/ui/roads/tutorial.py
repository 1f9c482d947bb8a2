# SPDX-License-Identifier: GPL-3.0-or-later
"""The README's "Five minutes in the window", step by step, with real mouse and keyboard."""

import math

import bpy
import solver


def grid():
    return bpy.data.objects["Grid"]  # looked up each time: undo makes a new one


def timeline(ui, name, value):
    """Type a value into a field of the timeline's header."""
    area = ui.area("DOPESHEET_EDITOR")
    header = ui.region(area, "HEADER")
    y = header.y + header.height // 2
    for x in range(header.x + header.width - 10, header.x, -24):
        yield from ui.move(x, y)
        if ui.button_here(area, "HEADER") == name:
            break
    yield from ui.move(x - 25, y)  # at its ends a number field has arrows, which Enter would press
    ui.check(ui.button_here(area, "HEADER") == name, f"the timeline has the field {name}")
    yield from ui.key("RET")
    yield from ui.key("A", ctrl=True)
    yield from ui.type(str(value))
    yield from ui.key("RET")
    yield 0.3


def add(ui, words):
    """Shift A over the 3D view, then type what to add."""
    yield from ui.move(*ui.centre(ui.area("VIEW_3D")))
    yield from ui.key("A", shift=True)
    yield 0.5
    yield from ui.type(words)
    yield 0.5
    yield from ui.key("RET")
    yield 0.5


def adjust(ui, *values):
    """Open the box at the lower left of the 3D view by its title, and type into its fields from the top; None: leave it."""
    area = ui.area("VIEW_3D")
    if ui.region(area, "HUD").height < 60:
        yield from ui.click(*ui.centre(area, "HUD"))
        yield 0.5
    box = ui.region(area, "HUD")
    yield from ui.move(box.x + 0.68 * box.width, box.y + box.height - 45)  # the first field; Tab leads to the next
    yield from ui.key("RET")
    for index, value in enumerate(values):
        if index > 0:
            yield from ui.key("TAB")
        if value is not None:
            yield from ui.key("A", ctrl=True)
            yield from ui.type(str(value))
    yield from ui.key("RET")
    yield 0.5


def road(ui):
    view = ui.area("VIEW_3D")
    # 1. A pad
    yield from ui.move(*ui.centre(view))
    yield from ui.key("DEL")
    ui.check("Cube" not in bpy.data.objects, "the cube is deleted")
    yield from add(ui, "grid")
    yield from ui.screenshot("1a-grid-added")
    yield from adjust(ui, 5, 13, 0.05)
    yield from ui.screenshot("1b-box")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("S")
    yield from ui.key("X")
    yield from ui.type("0.4")
    yield from ui.key("RET")
    yield from ui.key("NUMPAD_PERIOD")
    yield 1.0
    yield from ui.screenshot("1c-grid-shaped")
    ui.value("vertices", len(grid().data.vertices))
    ui.value("size", list(grid().dimensions))

    # 2. A sensor
    yield from ui.tab("PHYSICS")
    yield from ui.screenshot("2a-physics-tab")
    yield from ui.press("palpate.sensor_add()")
    ui.check(grid().palpate.role == "SENSOR", "Make Sensor makes the grid a sensor")
    yield from ui.screenshot("2b-sensor")
    yield from ui.filter("Bristles")  # the search opens the subpanel that it finds something in
    yield from ui.screenshot("2c-friction")
    yield from ui.filter("")

    # 3. Something that presses
    yield from add(ui, "uv sphere")
    yield from adjust(ui, None, None, 0.015, None, None, 0.02)
    yield from ui.screenshot("3a-sphere")
    yield from ui.press("palpate.role_set(role='TARGET')")
    ui.check(bpy.data.objects["Sphere"].palpate.role == "TARGET", "the sphere is a target")
    yield from ui.screenshot("3b-target")

    # 4. A motion
    yield from ui.move(*ui.centre(view))
    yield from ui.key("I")
    yield 0.5
    yield from ui.screenshot("4a-after-I")
    yield from timeline(ui, "frame_current", 30)
    yield from ui.move(*ui.centre(view))
    yield from ui.key("G")
    yield from ui.key("Z")
    yield from ui.type("-0.0075")
    yield from ui.key("RET")
    yield from ui.key("I")
    yield from timeline(ui, "frame_end", 60)
    ui.check(math.isclose(bpy.data.objects["Sphere"].location.z, 0.0125, abs_tol=1e-6), "the sphere is 2.5 mm deep")
    ui.check(bpy.context.scene.frame_end == 60, "60 frames")
    ui.value("end", bpy.context.scene.frame_end)
    yield from ui.screenshot("4b-keyframes")

    # 5. Feel it
    yield from timeline(ui, "frame_current", 1)
    yield from ui.click(*ui.at((0.008, -0.023, 0)))
    ui.check(bpy.context.view_layer.objects.active == grid(), "a click selects the grid")
    yield from ui.screenshot("5a-before-play")
    yield from solver.wait(ui)
    yield from ui.move(*ui.centre(view))
    yield from ui.key("SPACE")
    yield from ui.wait_until(lambda: bpy.context.scene.frame_current >= 40, "frame 40 plays", timeout=120)
    yield from ui.screenshot("5b-playing")
    yield from ui.wait_until(lambda: bpy.context.scene.frame_current >= 58, "frame 58 plays", timeout=120)
    yield from ui.wait_until(lambda: bpy.context.scene.frame_current < 30, "it plays again from its start", timeout=120)
    yield from ui.move(*ui.centre(view))
    yield from ui.key("SPACE")
    ui.check(not ui.window.screen.is_animation_playing, "Space stops")
    yield from timeline(ui, "frame_current", 60)
    yield from ui.screenshot("5c-frame-60")
    ui.value("force", sum(v.value for v in grid().data.attributes["palpate_force"].data))
    ui.check(bpy.context.scene.frame_current == 60, "at frame 60")
    yield from ui.filter("Gain")
    yield from ui.screenshot("5c-readout")
    yield from ui.filter("")
    yield from timeline(ui, "frame_current", 20)
    yield from ui.screenshot("5d-scrubbed-20")

    yield from timeline(ui, "frame_current", 60)

    # 6. Bake it
    folder = ui.out / "mine"
    folder.mkdir()
    with ui.context(ui.area("VIEW_3D")):
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "mine.blend"))
    yield 0.5
    yield from ui.press("palpate.bake")
    yield 0.3
    yield from ui.wait_until(lambda: grid().palpate.is_baked, "the bake is done", timeout=120)
    yield 1.0
    yield from ui.screenshot("6c-baked")
    ui.value("files", len(list((folder / "palpate-bake" / "Grid").iterdir())))
    yield from ui.move(*ui.centre(ui.area("VIEW_3D")))
    yield from ui.key("Z")
    yield 0.5
    yield from ui.key("M")
    yield 5.0
    yield from ui.screenshot("6e-material-preview")
    ui.check(ui.area("VIEW_3D").spaces.active.shading.type == "MATERIAL", "Material Preview")
    yield from timeline(ui, "frame_current", 24)
    yield from ui.screenshot("6f-frame-24")
    yield from ui.filter("Gain")
    yield from ui.screenshot("6g-readout-24")
    yield from ui.filter("")
