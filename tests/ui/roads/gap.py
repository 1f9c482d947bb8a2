# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/gap.md on its sample rig: measurements are opened, what is missing is found, shown, and put on the sensor."""

import bpy
from steps import add, close_plots, key_over_view, obj, palpate, undo


def found():
    return palpate("addon.measured.gap_results").of(obj("Tactile Pad"))


def brightest():
    """Largest red of the colours on the sensor."""
    return max(item.color[0] for item in obj("Tactile Pad").data.color_attributes["Palpate Gap"].data)


def road(ui):
    yield from key_over_view(ui, "DEL")
    yield from add(ui, "tactile pad")
    yield from key_over_view(ui, "NUMPAD_7")
    yield from ui.key("NUMPAD_PERIOD")
    yield from ui.tab("PHYSICS")
    yield from ui.filter("Measured Data")
    yield from ui.fill("palpate.measured", "/palpate-rig/rig.toml")

    yield from ui.press("palpate.gap_find()")
    yield from ui.wait_until(lambda: ui.works("palpate.gap_find"), "Find Gap is at work")
    ui.check(not bpy.ops.palpate.gap_find.poll(), "its button is grey meanwhile")
    yield from ui.wait_until(found, "the gap is found", timeout=900)
    named = sorted(one.name for one in found().diagnosis.findings)
    ui.check(named == ["creep", "gain-mismatch"], f"what is hidden is named: {named}")
    yield 1.0

    # Where the model is wrong, and curves before and after
    yield from ui.press("palpate.gap_show(amended=False)")
    yield 1.0
    yield from ui.screenshot("error")
    before = brightest()
    markers = {marker.name for marker in bpy.context.scene.timeline_markers}
    ui.check({"gap: loading", "gap: hold", "gap: unloading"} <= markers, "the timeline says what the probe does")
    yield from ui.press("palpate.gap_show(amended=True)")
    yield 1.0
    ui.check(brightest() < 0.5 * before, "the amended sensor is darker on the same scale")
    yield from ui.press("palpate.gap_curves()")
    yield 3.0
    ui.check("Palpate Gap Curves" in bpy.data.images, "the curves are shown")
    yield from ui.screenshot("curves")
    yield from close_plots()

    # Use Fitted Sensor
    yield from ui.press("palpate.gap_add()")
    yield 0.5
    ui.check(sorted(one.kind for one in obj("Tactile Pad").palpate.effects) == named, "they are on the sensor")
    yield from ui.filter("Effects")
    yield from ui.screenshot("added")
    yield from undo(ui)
    ui.check(len(obj("Tactile Pad").palpate.effects) == 0, "Ctrl Z takes them off again")
