# SPDX-License-Identifier: GPL-3.0-or-later
"""A stiffness is put into the study by right-click; the study is written, run beside the window, and stopped by ESC.

A script stands for the command that computes studies, since the Blender of these tests has no other Python.
"""

import bpy
from steps import palpate, undo

RUNS = 1000
"""More than any machine does before ESC comes."""
STANDS_FOR_SWEEP = f"""#!/bin/sh
# called as: sweep FILE --out DIR
trap 'exit 130' INT
mkdir -p "$4/parts"
printf 'format = "palpate-sweep/1"\\n[frozen]\\nruns = {RUNS}\\n' > "$4/study.toml"
for i in $(seq {RUNS}); do touch "$4/parts/$(printf '%07d-%016x-1-0.parquet' $i $i)"; sleep 0.3; done
"""


def varied():
    return [item.name for item in bpy.context.scene.palpate.study.variables]


def progress():
    return palpate("addon.session.session_state").session.jobs.get("PALPATE_OT_study_run")


def vary(ui, name):
    """Right-click on a field and choose the entry."""
    x, y = yield from ui.find(name)
    yield from ui.click(x, y, button="RIGHTMOUSE")
    yield 0.5
    yield from ui.screenshot("menu")
    yield from ui.key("V")
    yield 0.5


def road(ui):
    command, file = ui.out / "palpate", ui.out / "stiffness.toml"
    command.write_text(STANDS_FOR_SWEEP)
    command.chmod(0o755)
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.sensor_add()")
    yield from ui.filter("Stiffness k")
    yield from vary(ui, "palpate.k")
    ui.check(varied() == ["Cube.k"], "Vary in Study puts the stiffness into the study")
    yield from undo(ui)
    ui.check(varied() == [], "Ctrl Z takes it out")
    yield from vary(ui, "palpate.k")
    ui.check(varied() == ["Cube.k"], "and it is put in again")

    bpy.context.scene.palpate.study.file = str(file)
    bpy.context.preferences.addons["bl_ext.user_default.palpate"].preferences.study_command = str(command)
    bpy.ops.wm.save_as_mainfile(filepath=str(ui.out / "scene.blend"))
    yield from ui.filter("Study File")
    yield from ui.press("palpate.study_write")
    text = file.read_text()
    ui.check('scene = "scene.blend"' in text and '"Cube.k"' in text, "Write Study writes the file")
    yield from ui.press("palpate.study_run")
    yield from ui.wait_until(lambda: progress() is not None and progress().done > 2, "some runs are done")
    yield from ui.screenshot("running")
    yield from ui.key("ESC")
    yield from ui.wait_until(lambda: progress() is None, "ESC stops the study")
    done = len(list((ui.out / "stiffness" / "parts").iterdir()))
    ui.check(2 < done < RUNS, "in its middle")
