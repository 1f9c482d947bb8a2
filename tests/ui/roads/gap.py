# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/gap.md on its sample rig: measurements are opened, what is missing is found, shown, and put on the sensor."""

import bpy
from tutorial import add


def pad():
    return bpy.data.objects["Tactile Pad"]


def found():
    from bl_ext.user_default.palpate.addon.measured import gap_results

    return gap_results.of(pad())


def brightest():
    """Largest red of the colours on the sensor."""
    return max(item.color[0] for item in pad().data.color_attributes["Palpate Gap"].data)


def road(ui):
    rig = ui.out.parent / "sample-rig" / "rig.toml"
    view = ui.area("VIEW_3D")
    # 1. A sensor like the one that was measured
    yield from ui.move(*ui.centre(view))
    yield from ui.key("DEL")
    yield from add(ui, "tactile pad")
    ui.check(len(pad().data.vertices) == 84, "Add › Mesh › Tactile Pad makes the 84 texels that were measured")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("NUMPAD_7")
    yield from ui.key("NUMPAD_PERIOD")
    yield from ui.tab("PHYSICS")
    yield from ui.filter("Measured Data")
    yield from ui.screenshot("1-panel")

    # 2. Its measurements
    yield from ui.fill("palpate.measured", str(rig))
    ui.check(pad().palpate.measured == str(rig), "the rig's path is typed in")
    yield from ui.screenshot("2-rig")

    # 3. Find Gap, stopped and begun again
    yield from ui.press("palpate.gap_find()")
    yield from ui.wait_until(lambda: ui.works("palpate.gap_find"), "Find Gap is at work")
    ui.check(not bpy.ops.palpate.gap_find.poll(), "its button is grey meanwhile")
    yield 1.0
    yield from ui.stop("palpate.gap_find")
    ui.check(found() is None, "and nothing is said")
    yield from ui.press("palpate.gap_find()")
    yield 2.0
    yield from ui.screenshot("3a-finding")
    yield from ui.wait_until(found, "the gap is found", timeout=600)
    yield 1.0
    yield from ui.screenshot("3b-found")
    ui.value("headline", found().headline)
    ui.value("named", [named.name for named in found().diagnosis.findings])

    # 4. Where the model is wrong
    timeline = ui.area("DOPESHEET_EDITOR")
    edge = (timeline.x + timeline.width // 2, timeline.y + timeline.height)
    yield from ui.drag(edge, (edge[0], edge[1] + 90))  # room for the markers
    yield from ui.press("palpate.gap_show(amended=False)")
    yield 1.0
    yield from ui.screenshot("4a-error-base")
    before = brightest()
    ui.value("markers", sorted({marker.name for marker in bpy.context.scene.timeline_markers}))
    yield from ui.press("palpate.gap_show(amended=True)")
    yield 1.0
    yield from ui.screenshot("4b-error-amended")
    ui.check(brightest() < 0.5 * before, "the amended sensor is darker on the same scale")

    # 5. Before and after
    yield from ui.press("palpate.gap_curves()")
    yield 3.0
    ui.check("Palpate Gap Curves" in bpy.data.images, "the curves are shown")
    yield from ui.screenshot("5-curves")
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
        bpy.ops.wm.window_close()
    yield 1.0

    # 6. Write Report, beside the window
    folder = ui.out / "report"
    folder.mkdir()
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    yield from ui.press("palpate.gap_report()")
    yield 1.0
    browser = ui.area("FILE_BROWSER")
    browser.spaces.active.params.directory = str(folder).encode()
    yield 1.0
    buttons = ui.region(browser, "EXECUTE")
    yield from ui.click(buttons.x + buttons.width - 70, buttons.y + buttons.height // 2)
    yield from ui.wait_until(lambda: ui.works("palpate.gap_report"), "the report is written beside the window")
    yield from ui.screenshot("6a-writing")
    yield from ui.wait_until(lambda: (folder / "report.html").exists(), "the report is there", timeout=120)
    yield 1.0

    # 7. Add to Sensor
    yield from ui.press("palpate.gap_add()")
    yield 0.5
    ui.value("effects", [effect.kind for effect in pad().palpate.effects])
    ui.value("gain", pad().palpate.gain)
    yield from ui.filter("Effects")
    yield from ui.screenshot("7-added")
    yield from ui.filter("")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("Z", ctrl=True)
    yield 0.5
    ui.check(len(pad().palpate.effects) == 0, "Ctrl Z takes them off again")
