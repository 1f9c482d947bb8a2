# SPDX-License-Identifier: GPL-3.0-or-later
"""A stiffness is put into the study by right-click, and the study is written; tests/blender/study/ runs one."""

import bpy
from steps import undo


def varied():
    return [item.name for item in bpy.context.scene.palpate.study.variables]


def vary(ui, name):
    """Right-click on a field and choose the entry."""
    x, y = yield from ui.find(name)
    yield from ui.click(x, y, button="RIGHTMOUSE")
    yield 0.5
    yield from ui.screenshot("menu")
    yield from ui.key("V")
    yield 0.5


def road(ui):
    file = ui.out / "stiffness.toml"
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.sensor_add()")
    yield from ui.filter("Stiffness k")
    yield from vary(ui, "palpate.k")
    ui.check(varied() == ["Cube.k"], "Vary in Study puts the stiffness into the study")
    yield from undo(ui)
    ui.check(varied() == [], "Ctrl Z takes it out")
    yield from vary(ui, "palpate.k")
    bpy.context.scene.palpate.study.file = str(file)
    bpy.ops.wm.save_as_mainfile(filepath=str(ui.out / "scene.blend"))
    yield from ui.filter("Study File")
    yield from ui.press("palpate.study_write")
    text = file.read_text()
    ui.check('scene = "scene.blend"' in text and '"Cube.k"' in text, "Write Study writes the file")
    yield from ui.screenshot("written")
