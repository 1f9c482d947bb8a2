# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor is written for MuJoCo by File › Export and read back by File › Import; a rig is made from two logs by the panel."""

import math

import bpy
from tutorial import add

LOGS = ("press_0.csv", "press_1.csv")


def sensors():
    return [obj for obj in bpy.data.objects if obj.palpate.role == "SENSOR"]


def choose(ui, folder, all_files=False):
    """Show a folder in the file browser, select all of its files if asked to, and click the button at the lower right."""
    yield 1.0
    browser = ui.area("FILE_BROWSER")
    browser.spaces.active.params.directory = str(folder).encode()
    yield 1.0
    yield from ui.move(*ui.centre(browser))
    if all_files:
        yield from ui.key("A")
        yield 0.5
    buttons = ui.region(browser, "EXECUTE")
    yield from ui.screenshot(f"choose-in-{folder.name}")
    yield from ui.click(buttons.x + buttons.width - 70, buttons.y + buttons.height // 2)
    yield 1.5


def write_logs(folder):
    """Two presses of a stage on four texels, as a laboratory's logger may write them."""
    folder.mkdir()
    for name, deepest in zip(LOGS, (0.8, 1.2), strict=True):
        lines = ["t_ms,depth (mm),R1,R2,R3,R4"]
        for sample in range(200):
            depth = deepest * math.sin(math.pi * sample / 199)
            lines.append(f"{10 * sample},{depth:.5f}," + ",".join(f"{100 * depth * share:.3f}" for share in (1, 0.8, 0.6, 0.4)))
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def answered(path):
    """Answer what no log says, as in a text editor."""
    template = path.read_text(encoding="utf-8")
    path.write_text(template.replace('pitch = ["?", "?"]', "pitch = [0.004, 0.004]"), encoding="utf-8")
    return template


def road(ui):
    bpy.context.preferences.filepaths.use_relative_paths = False
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    view = ui.area("VIEW_3D")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("DEL")
    yield from add(ui, "tactile pad")
    ui.check(len(sensors()) == 1, "there is one sensor")

    # 1. Out: for MuJoCo
    folder = ui.out / "mujoco"
    folder.mkdir()
    yield from ui.search("MuJoCo")
    yield from choose(ui, folder)
    written = sorted(path.name for path in folder.iterdir())
    ui.value("written", written)
    ui.check(any(name.endswith(".xml") for name in written), "File › Export writes MuJoCo's XML")
    yield from ui.screenshot("1-exported")
    yield from ui.key("ESC")  # puts the box with what MuJoCo does not have away, which takes all keys in Blender 5.2

    # 2. In: the same file
    yield from ui.search("Sensor of Another Program")
    yield from ui.wait_until(lambda: any(a.type == "FILE_BROWSER" for a in ui.window.screen.areas), "a file is asked for")
    browser = ui.area("FILE_BROWSER")
    browser.spaces.active.params.directory = str(folder).encode()
    browser.spaces.active.params.filename = next(name for name in written if name.endswith(".xml"))
    yield from choose(ui, folder)
    ui.check(len(sensors()) == 2, "File › Import makes a second sensor of it")
    ui.value("texels", [len(obj.data.vertices) for obj in sensors()])
    yield from ui.screenshot("2-imported")
    yield from ui.key("ESC")
    yield from ui.move(*ui.centre(ui.area("VIEW_3D")))
    yield from ui.key("Z", ctrl=True)
    yield 0.5
    ui.check(len(sensors()) == 1, "Ctrl Z takes it away again")

    # 3. Logs: the first try asks, the second writes the rig
    logs = ui.out / "logs"
    write_logs(logs)
    bpy.context.view_layer.objects.active = sensors()[0]
    yield from ui.tab("PHYSICS")
    yield from ui.filter("Measured Data")
    yield from ui.press("palpate.measured_logs()")
    yield from choose(ui, logs, all_files=True)
    answers = logs / "rig" / "answers.toml"
    ui.check(answers.exists(), "what no log says is asked in answers.toml")
    yield from ui.screenshot("3a-asked")
    ui.value("asked", answered(answers).count('"?"'))
    yield from ui.move(*ui.centre(view))
    yield from ui.filter("Measured Data")
    yield from ui.press("palpate.measured_logs()")
    yield from choose(ui, logs, all_files=True)
    rig = logs / "rig" / "rig.toml"
    yield from ui.wait_until(rig.exists, "the rig is written", timeout=120)
    yield 3.0
    yield from ui.screenshot("3b-plotted")
    ui.check("Palpate Recordings" in bpy.data.images, "what was read is shown")
    ui.value("trials", rig.read_text(encoding="utf-8").count("[[trial]]"))
    ui.check(sensors()[0].palpate.measured.endswith("rig.toml"), "the sensor has the rig as its measurements")
