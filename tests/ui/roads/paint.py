# SPDX-License-Identifier: GPL-3.0-or-later
"""A fingertip is painted with real strokes and gets a probe."""

import bpy
from steps import add, adjust, key_over_view


def road(ui):
    view = ui.area("VIEW_3D")
    yield from key_over_view(ui, "DEL")
    yield from add(ui, "uv sphere")
    yield from adjust(ui, 64, 48, 0.01, None, None, None)
    yield from key_over_view(ui, "NUMPAD_PERIOD")
    yield 1.0
    finger = bpy.context.object
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.weight_paint")
    ui.check(finger.mode == "WEIGHT_PAINT" and finger.palpate.role == "SENSOR", "Paint a Sensor enters Weight Paint")
    x, y = ui.centre(view)
    for dy in (70, 0, -70):
        yield from ui.drag((x - 130, y + dy), (x + 130, y + dy), steps=8)
    painted = sum(1 for v in finger.data.vertices for g in v.groups if g.weight >= 0.5)
    ui.check(painted > 20, f"three strokes painted {painted} vertices")
    yield from ui.screenshot("painted")
    yield from ui.press("palpate.probe_add")
    ui.check(bpy.data.objects["Probe"].palpate.role == "TARGET", "Add Probe adds something that presses")
    ui.check(finger.mode == "OBJECT", "and leaves Weight Paint")
