# SPDX-License-Identifier: GPL-3.0-or-later
"""What stops a command: limits of time and memory, and what is found before work begins. An earlier bake stays."""

import shutil
import time

import pytest
from blender_scenes import contents
from processes import palpate, python

from palpate.commands import main


@pytest.mark.long("a bake that goes on until its limit of four seconds or of memory")
@pytest.mark.parametrize(("option", "value"), [("--time-limit", "4"), ("--memory-limit", "50")])
def test_a_limit_ends_a_bake(option, value, tmp_path, demo_blend):
    out = tmp_path / "out"
    assert main(["bake", str(demo_blend), "--frames", "1", "2", "--out", str(out)]) == 0
    before = contents(out / "Finger A")
    began = time.monotonic()
    done = palpate("bake", demo_blend, "--frames", "1", "100000", "--out", out, option, value)
    assert time.monotonic() - began < 60
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"palpate bake: The {option[2:].replace('-', ' ')} of {value}")
    assert len(done.stderr.splitlines()) == 1
    assert contents(out / "Finger A") == before


def test_a_call_that_does_not_return_is_ended():
    code = (
        "import time\n"
        "from palpate.commands import console, export, run_process\n"
        "console.GRACE = 0.5\n"
        "export.find_bake = lambda _: time.sleep(60)\n"
        "run_process()\n"
    )
    began = time.monotonic()
    done = python(code, "export", "bake", "--time-limit", "0.5")
    assert time.monotonic() - began < 30
    assert done.returncode == 1
    assert done.stderr.startswith("palpate export: The time limit of 0.5 s is reached: raise --time-limit")


@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "word"])
def test_limits_are_numbers_above_zero(value, capfd):
    assert main(["bake", "a.blend", f"--time-limit={value}"]) == 2
    assert "--time-limit" in capfd.readouterr().err


@pytest.mark.parametrize("frames", [("0", "99999999999"), ("0", "1048575")])
def test_more_frames_than_blender_has_are_refused(frames, demo_blend, refused):
    assert "the last of Blender" in refused("bake", demo_blend, "--frames", *frames)


def test_a_rig_is_not_overwritten_by_its_result(tmp_path, repository, refused):
    shutil.copytree(repository / "docs" / "sample-rig", tmp_path / "rig")
    (tmp_path / "rig" / "rig.toml").rename(tmp_path / "rig" / "sensor.toml")
    before = contents(tmp_path)
    said = refused("gap", tmp_path / "rig" / "sensor.toml", "--out", tmp_path / "rig")
    assert "is read and would be overwritten" in said
    assert contents(tmp_path) == before


def test_a_sensor_definition_is_not_overwritten_by_a_scene(tmp_path, demo_blend, refused):
    demo, xml = str(demo_blend), str(tmp_path / "a.xml")
    assert main(["openrave", "export", demo, "--out", xml]) == 0
    assert "would be overwritten" in refused("openrave", "import", xml, demo, "--from", "Finger A", "--save-as", xml)
