# SPDX-License-Identifier: GPL-3.0-or-later
"""The README's "Five minutes in the window", step by step, with real mouse and keyboard."""

import math

import bpy
from steps import add, adjust, forces, key_over_view, obj, solver, timeline


def road(ui):
    # 1. A pad
    yield from key_over_view(ui, "DEL")
    ui.check("Cube" not in bpy.data.objects, "the cube is deleted")
    yield from add(ui, "grid")
    yield from adjust(ui, 5, 13, 0.05)
    yield from key_over_view(ui, "S")
    yield from ui.key("X")
    yield from ui.type("0.4")
    yield from ui.key("RET")
    yield from ui.key("NUMPAD_PERIOD")
    yield 1.0
    ui.check(len(obj("Grid").data.vertices) == 84, "the grid has 84 vertices")
    ui.check(math.dist(obj("Grid").dimensions, (0.02, 0.05, 0.0)) < 1e-6, "and is 20 by 50 mm")

    # 2. A sensor
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.sensor_add()")
    ui.check(obj("Grid").palpate.role == "SENSOR", "Make Sensor makes the grid a sensor")
    yield from ui.filter("Bristles")  # the search opens the subpanel that it finds something in
    yield from ui.screenshot("2-friction")
    yield from ui.filter("")

    # 3. Something that presses
    yield from add(ui, "uv sphere")
    yield from adjust(ui, None, None, 0.015, None, None, 0.02)
    yield from ui.press("palpate.role_set(role='TARGET')")
    ui.check(obj("Sphere").palpate.role == "TARGET", "the sphere is a target")

    # 4. A motion
    yield from key_over_view(ui, "I")
    yield 0.5
    yield from timeline(ui, "frame_current", 30)
    yield from key_over_view(ui, "G")
    yield from ui.key("Z")
    yield from ui.type("-0.0075")
    yield from ui.key("RET")
    yield from ui.key("I")
    yield from timeline(ui, "frame_end", 60)
    ui.check(math.isclose(obj("Sphere").location.z, 0.0125, abs_tol=1e-6), "the sphere is 2.5 mm deep")
    ui.check(bpy.context.scene.frame_end == 60, "60 frames")
    yield from ui.screenshot("4-keyframes")

    # 5. Feel it
    scene = bpy.context.scene
    yield from timeline(ui, "frame_current", 1)
    yield from ui.click(*ui.at((0.008, -0.023, 0)))
    ui.check(bpy.context.view_layer.objects.active == obj("Grid"), "a click selects the grid")
    yield from solver(ui)
    yield from key_over_view(ui, "SPACE")
    yield from ui.wait_until(lambda: scene.frame_current >= 40, "frame 40 plays")
    yield from ui.screenshot("5-playing")
    yield from ui.wait_until(lambda: scene.frame_current < 30, "it plays again from its start")
    yield from key_over_view(ui, "SPACE")
    ui.check(not ui.window.screen.is_animation_playing, "Space stops")
    yield from timeline(ui, "frame_current", 60)
    ui.check(abs(sum(forces("Grid")) - 0.97) < 0.005, "the pad feels 0.97 N at frame 60")
    yield from ui.filter("Gain")
    yield from ui.screenshot("5-readout")
    yield from ui.filter("")

    # 6. Bake it
    folder = ui.out / "mine"
    folder.mkdir()
    with ui.context(ui.area("VIEW_3D")):
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "mine.blend"))
    yield 0.5
    yield from ui.press("palpate.bake")
    yield from ui.wait_until(lambda: obj("Grid").palpate.is_baked, "the bake is done")
    names = {path.name for path in (folder / "palpate-bake" / "Grid").iterdir()}
    ui.check({f"tactile_{frame:04d}.exr" for frame in range(1, 61)} <= names, "there is an image for each frame")
    ui.check({"manifest.json", "recording.npz", "sensor.npz"} <= names, "with recording, sensor and manifest")
    yield from key_over_view(ui, "Z")
    yield 0.5
    yield from ui.key("M")
    yield 5.0
    ui.check(ui.area("VIEW_3D").spaces.active.shading.type == "MATERIAL", "Material Preview")
    yield from timeline(ui, "frame_current", 24)
    yield from ui.screenshot("6-frame-24")
