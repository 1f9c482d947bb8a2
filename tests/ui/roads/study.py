# SPDX-License-Identifier: GPL-3.0-or-later
"""A stiffness is put into the study by right-click, undone and put in again; the study is written, run, stopped and finished.

A script stands for the command that computes studies, since the Blender of these tests has no other Python.
"""

import bpy

RUNS = 1000
"""More than any machine does before ESC comes; when the study goes on, the rest is done at once."""
STANDS_FOR_SWEEP = f"""#!/bin/sh
# called as: sweep FILE --out DIR
trap 'exit 130' INT
mkdir -p "$4/parts"
printf 'format = "palpate-sweep/1"\\n[frozen]\\nruns = {RUNS}\\n' > "$4/study.toml"
i=$(ls "$4/parts" | wc -l)
pause=0.3
[ $i -gt 0 ] && pause=0
while [ $i -lt {RUNS} ]; do
    touch "$4/parts/$(printf '%07d-%016x-1-0.parquet' $i $i)"; i=$((i + 1)); [ $pause = 0 ] || sleep $pause
done
touch "$4/report.html"
echo "{RUNS} runs: {RUNS} done, 0 failed, 0 left"
"""


def varied():
    return [item.name for item in bpy.context.scene.palpate.study.variables]


def progress():
    from bl_ext.user_default.palpate.addon.session import session_state

    return session_state.session.study_progress


def vary(ui, name):
    """Right-click on a field and choose the entry."""
    x, y = yield from ui.find(name)
    yield from ui.click(x, y, button="RIGHTMOUSE")
    yield 0.5
    yield from ui.screenshot("1-menu")
    yield from ui.key("V")
    yield 0.5


def road(ui):
    command = ui.out / "palpate"
    command.write_text(STANDS_FOR_SWEEP)
    command.chmod(0o755)
    blend, file = ui.out / "scene.blend", ui.out / "stiffness.toml"
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.sensor_add()")

    # 1. What varies
    yield from ui.filter("Stiffness k")
    yield from vary(ui, "palpate.k")
    ui.check(varied() == ["Cube.k"], "Vary in Study puts the stiffness into the study")
    yield from ui.move(*ui.centre(ui.area("VIEW_3D")))
    yield from ui.key("Z", ctrl=True)
    ui.check(varied() == [], "Ctrl Z takes it out")
    yield from vary(ui, "palpate.k")
    ui.check(varied() == ["Cube.k"], "and it is put in again")

    # 2. The panel and its file
    bpy.context.scene.palpate.study.file = str(file)
    bpy.context.preferences.addons["bl_ext.user_default.palpate"].preferences.study_command = str(command)
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    yield from ui.filter("Study File")
    yield from ui.press("palpate.study_write")
    yield from ui.screenshot("2-panel")
    ui.check(file.exists(), "Write Study writes the file")
    ui.value("file", file.read_text())

    # 3. Run, stop, go on
    yield from ui.press("palpate.study_run")
    yield from ui.wait_until(lambda: progress() is not None and progress().done > 2, "some runs are done", timeout=60)
    yield from ui.screenshot("3-running")
    yield from ui.key("ESC")
    yield from ui.wait_until(lambda: progress() is None, "ESC stops the study")
    done = len(list((ui.out / "stiffness" / "parts").iterdir()))
    ui.check(2 < done < RUNS, "the study is stopped in its middle")
    yield from ui.press("palpate.study_run")
    yield from ui.wait_until(lambda: (ui.out / "stiffness" / "report.html").exists(), "the study is done", timeout=60)
    yield from ui.wait_until(lambda: progress() is None, "and its button is there again")
    yield 0.5
    yield from ui.screenshot("4-done")
