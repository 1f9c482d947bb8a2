# SPDX-License-Identifier: GPL-3.0-or-later
"""Python in a .blend, and how processes end: with drivers, Ctrl-C and closed pipes."""

import os
import subprocess
import sys

import bpy
import pytest
from blender_scenes import press, save
from processes import interrupted, palpate, python

from palpate.commands import main

DRIVEN = """
import bpy, sys
bpy.ops.wm.open_mainfile(filepath=sys.argv[1], load_ui=False)
for number, expression in enumerate(("frame * 0.0", "__import__('math').sin(frame) * 0.0 + 0.5")):
    curve = bpy.data.objects["Finger A"].driver_add(("color", "delta_scale")[number], 0)
    curve.driver.type = "SCRIPTED"
    curve.driver.expression = expression
bpy.data.objects["Finger A"].name = "Finger A"
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2])
import os; os._exit(0)
"""


@pytest.fixture(scope="module")
def driven(tmp_path_factory, repository):
    """The demo with one driver that Blender evaluates itself and one that needs Python."""
    path = tmp_path_factory.mktemp("driven") / "driven.blend"
    python(DRIVEN, repository / "sample_blends" / "demo.blend", path, check=True)
    return path


def test_a_driver_that_needs_python_is_named_and_refused(driven, tmp_path):
    done = palpate("bake", driven, "--frames", "1", "2", "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (1, "")
    assert "delta_scale of 'Finger A' (__import__('math').sin(frame) * 0.0 + 0.5)" in done.stderr
    assert "color" not in done.stderr  # Blender evaluates that one without Python
    assert "--allow-scripts" in done.stderr and "--ignore-scripts" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.slow("starts Blender in a process of its own")
@pytest.mark.parametrize("option", ["--allow-scripts", "--ignore-scripts"])
def test_commands_end_after_a_driver_that_needs_python(driven, tmp_path, option):
    """With Blender 4.5 the interpreter itself would wait for ever."""
    done = palpate("bake", driven, "--frames", "1", "2", "--out", tmp_path / "out", option)
    if option == "--allow-scripts":
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith("frames 1 to 2")
    else:  # half the width by the driver, none without it
        assert done.returncode == 1 and "zero" in done.stderr


def test_a_script_that_was_not_run_is_named(tmp_path, capfd):
    press()
    bpy.data.texts.new("rig_ui.py").use_module = True
    path = save(tmp_path)
    capfd.readouterr()
    assert main(["openrave", "export", str(path)]) == 0
    assert capfd.readouterr().err == f"note: scripts in '{path}' were not run: 'rig_ui.py'; --allow-scripts runs them\n"


# --- the end of a process


def test_a_closed_pipe_ends_a_command_without_a_word(demo_blend):
    reader, writer = os.pipe()
    os.close(reader)
    done = palpate("openrave", "export", demo_blend, stdout=writer, stderr=subprocess.PIPE, capture_output=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no device that is full")
def test_output_to_a_full_disk_is_one_line(demo_blend):
    with open("/dev/full", "w") as full:
        done = palpate("openrave", "export", demo_blend, stdout=full, stderr=subprocess.PIPE, capture_output=False)
    assert done.returncode == 1
    assert done.stderr.startswith("palpate openrave: The output could not be written (no space")
    assert len(done.stderr.splitlines()) == 1


def test_ctrl_c_ends_work_that_looks_at_no_keyboard(tmp_path):
    """Reading stands for the work: it waits until it is stopped."""
    code = (
        "import time, pathlib\n"
        "from palpate import commands\n"
        "from palpate.core.gap.dataset import rig\n"
        "def wait(*_):\n"
        "    pathlib.Path('begun').touch()\n"
        "    time.sleep(60)\n"
        "rig.read_rig = wait\n"
        "commands.run_process()\n"
    )
    command = [sys.executable, "-c", code, "gap", "rig.toml", "--out", "out"]
    found, seconds = interrupted(command, lambda _: (tmp_path / "begun").exists(), cwd=tmp_path)
    assert found == (130, "", "palpate gap: stopped; an earlier bake is unchanged.\n") and seconds < 20
