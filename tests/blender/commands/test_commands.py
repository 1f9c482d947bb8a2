# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: what it makes, what it says, and that a mistake of the user's is one line and changes nothing."""

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from blender_scenes import contents, press, reopen, save, visible
from kills import files_up_to
from processes import PALPATE, interrupted

from palpate.commands import blender, console, main
from palpate.commands.bake import report
from palpate.core.errors import FileError
from palpate.core.io.recording_npz import load_recording
from palpate.core.io.scenario_npz import load_scenario
from palpate.core.solver import simulation


def lines_of(capfd):
    out, err = capfd.readouterr()
    return out.splitlines(), err.splitlines()


# --- usage


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], ""),
        (["frobnicate"], ""),
        (["bake"], ""),
        (["bake", "a.blend", "--frobnicate"], ""),
        (["demo", "--size", "0", "9"], ""),
        (["bake", "a.blend", "b.blend"], "one file at a time"),
        (["bake", "a.blend", "--modle", "x.toml"], "--help"),
    ],
)
def test_wrong_usage_is_status_2(words, says, capfd):
    assert main(words) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.startswith("usage: palpate") and says in err


@pytest.mark.parametrize("words", [["--help"], ["bake", "--help"], ["demo", "--help"], ["--version"]])
def test_help_is_status_0(words, capfd):
    assert main(words) == 0
    assert "palpate" in capfd.readouterr().out


# --- mistakes


def test_files_that_are_no_blend(tmp_path, demo_blend, refused):
    (tmp_path / "folder.blend").mkdir()
    (tmp_path / "words.blend").write_bytes(b"hello world" * 100)
    (tmp_path / "empty.blend").write_bytes(b"")
    whole = demo_blend.read_bytes()
    (tmp_path / "cut.blend").write_bytes(whole[: len(whole) // 2])
    for name, reason in (
        ("missing.blend", "no file"),
        ("folder.blend", "is a folder"),
        ("words.blend", "not a .blend"),
        ("empty.blend", "not a .blend"),
        ("cut.blend", "damaged"),
    ):
        said = refused("bake", tmp_path / name, "--out", tmp_path / "out")
        assert said.startswith("palpate bake: ") and name in said and reason in said
        assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        (["--frames", "9", "3"], "runs backwards"),
        (["--frames", "-5", "3"], "before frame 0"),
        (["--sensor", "Thumb"], "'Finger A', 'Finger B'"),
    ],
)
def test_mistakes_are_one_line(more, reason, demo_blend, refused):
    before = demo_blend.read_bytes()
    assert reason in refused("bake", demo_blend, *more)
    assert demo_blend.read_bytes() == before


def test_a_part_cannot_be_saved(tmp_path, demo_blend, capfd):
    words = ["bake", str(demo_blend), "--sensor", "Finger A", "--save-as", str(tmp_path / "a.blend")]
    assert main(words) == 2
    assert "--sensor" in capfd.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_the_scene_as_it_was(tmp_path, demo_blend, capfd):
    """A limit on the size of files stands for the disk: Blender itself then writes half a file and calls it saved."""
    bpy.ops.wm.open_mainfile(filepath=str(demo_blend))
    mine, new = tmp_path / "mine.blend", tmp_path / "new.blend"
    mine.write_bytes(demo_blend.read_bytes())
    for path in (mine, new):
        with files_up_to(mine.stat().st_size // 2), pytest.raises(FileError, match=f"'{path}' could not be saved .*space"):
            blender.save_blend(path)
    assert mine.read_bytes() == demo_blend.read_bytes()
    assert not new.exists()
    assert {path.name for path in tmp_path.iterdir()} <= {"mine.blend", "mine.blend1"}
    blender.save_blend(mine)
    blender.open_blend(mine)


@pytest.fixture
def scripts_allowed():
    """Have Blender run scripts of the files that it opens."""
    bpy.context.preferences.filepaths.use_scripts_auto_execute = True
    yield
    bpy.context.preferences.filepaths.use_scripts_auto_execute = False


def test_scripts_in_a_file_do_not_run(tmp_path, demo_blend, scripts_allowed):
    bpy.ops.wm.open_mainfile(filepath=str(demo_blend))
    text = bpy.data.texts.new("evil.py")
    text.write(f"open({str(tmp_path / 'evil')!r}, 'w').close()")
    text.use_module = True
    reopen(save(tmp_path, "a.blend"))
    assert (tmp_path / "evil").exists()  # Blender would
    (tmp_path / "evil").unlink()
    assert main(["bake", str(tmp_path / "a.blend"), "--frames", "1", "2", "--out", str(tmp_path / "out")]) == 0
    assert not (tmp_path / "evil").exists()


# --- what bake makes


def test_a_bake_without_images_has_the_recordings_alone(tmp_path, demo_blend, capfd):
    assert main(["bake", str(demo_blend), "--frames", "1", "3", "--no-images", "--out", str(tmp_path / "out")]) == 0
    for name in ("Finger A", "Finger B"):
        files = {path.name for path in (tmp_path / "out" / name).iterdir()}
        assert files == {"recording.npz", "sensor.npz", "manifest.json"}
    assert main(["export", str(tmp_path / "out"), "--out", str(tmp_path / "csv")]) == 0
    assert (tmp_path / "csv" / "Finger A" / "normal_force.csv").read_text().count("\n") == 4
    assert main(["bake", str(demo_blend), "--no-images", "--save-as", str(tmp_path / "new.blend")]) == 2
    assert "--no-images leaves out what a saved scene shows" in capfd.readouterr().err
    assert not (tmp_path / "new.blend").exists()


def test_bake_writes_images_and_leaves_the_file_alone(tmp_path, demo_blend, capfd):
    before = demo_blend.read_bytes()
    assert main(["bake", str(demo_blend), "--frames", "1", "6", "--out", str(tmp_path / "out")]) == 0
    out, err = lines_of(capfd)
    assert err == []
    assert out[0].startswith("frames 1 to 6")
    assert any(line.startswith("Finger B") and "9.81" in line for line in out)  # the 1 kg cube
    assert not [line for line in out if "Read" in line or "Saved" in line or "Info" in line]  # Blender's own words
    for name in ("Finger A", "Finger B"):
        files = {path.name for path in (tmp_path / "out" / name).iterdir()}
        images = {f"tactile_{frame:04d}.exr" for frame in range(1, 7)}
        assert files == images | {"images.sha256", "recording.npz", "sensor.npz", "manifest.json"}
    assert demo_blend.read_bytes() == before


def test_bake_with_a_model_from_a_file(tmp_path, demo_blend, refused):
    """`--model` puts parameters and effects on a sensor; of several it wants the name."""
    model = tmp_path / "soft.toml"
    model.write_text(
        'format = "palpate-sensor-toml/1"\n[sensor]\nk = 29.25\ncn = 0.0583\nunit = "V"\n'
        '[[effect]]\nname = "offset"\nform = "common"\noffset = 0.5\n',
        encoding="utf-8",
    )
    words = ["bake", str(demo_blend), "--frames", "24", "26"]
    assert main([*words, "--out", str(tmp_path / "plain")]) == 0
    assert "NAME=" in refused(*words, "--out", tmp_path / "no", "--model", model)
    assert not (tmp_path / "no").exists() or not list((tmp_path / "no").iterdir())
    assert main([*words, "--out", str(tmp_path / "soft"), "--model", f"Finger A={model}"]) == 0
    plain, soft = (
        load_recording(tmp_path / name / "Finger A" / "recording.npz").sensors["Finger A"] for name in ("plain", "soft")
    )
    assert soft.normal_force.max() < 0.6 * plain.normal_force.max()  # half as stiff
    assert np.allclose(soft.reading - soft.normal_force, 0.5)


def test_save_as_keeps_the_bake_in_another_file(tmp_path, demo_blend):
    places = ["--out", str(tmp_path / "out"), "--save-as", str(tmp_path / "baked")]
    assert main(["bake", str(demo_blend), "--frames", "1", "4", *places]) == 0
    scene = reopen(tmp_path / "baked.blend")
    assert (scene.frame_start, scene.frame_end) == (1, 4)
    sensors = [obj.name for obj in scene.objects if obj.palpate.is_baked and obj.palpate.role == "SENSOR"]
    assert sensors == ["Finger A", "Finger B"]


def test_the_bake_that_a_saved_file_plays_is_not_replaced_without_it(tmp_path, demo_blend, capfd, refused):
    mine = tmp_path / "mine.blend"
    mine.write_bytes(demo_blend.read_bytes())
    assert main(["bake", str(mine), "--frames", "1", "4", "--save"]) == 0
    before = contents(tmp_path)
    for more in ([], ["--save-as", tmp_path / "other.blend"]):
        assert "add --save to renew both, or --out DIR" in refused("bake", mine, "--frames", "2", "3", *more)
        assert contents(tmp_path) == before
    assert main(["bake", str(mine), "--frames", "2", "3", "--out", str(tmp_path / "elsewhere")]) == 0
    assert "note: bodies and bristles started at frame 2, not at the scene's 1" in capfd.readouterr().out
    assert {name: data for name, data in contents(tmp_path).items() if not name.startswith("elsewhere")} == before


def test_a_file_saved_in_edit_mode_can_be_baked(tmp_path):
    scene, pad, _ = press(frames=2)
    bpy.context.view_layer.objects.active = pad
    bpy.ops.object.mode_set(mode="EDIT")
    mine = save(tmp_path)
    assert main(["bake", str(mine), "--save"]) == 0
    assert reopen(mine).objects["Pad"].palpate.is_baked


def test_one_sensor_alone_feels_the_same(tmp_path, demo_blend):
    both, alone = tmp_path / "both", tmp_path / "alone"
    assert main(["bake", str(demo_blend), "--frames", "1", "5", "--out", str(both)]) == 0
    assert main(["bake", str(demo_blend), "--frames", "1", "5", "--out", str(alone), "--sensor", "Finger B"]) == 0
    assert visible(alone) == ["Finger B"]
    first, second = (load_recording(folder / "Finger B" / "recording.npz").sensors["Finger B"] for folder in (both, alone))
    assert (first.normal_force == second.normal_force).all()


# --- the process


def has_loaded_blender(process):
    """By then the command notes Ctrl-C; before, Python itself is still being loaded."""
    return "/bpy/" in Path(f"/proc/{process.pid}/maps").read_text()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="what a process has loaded is read in /proc")
def test_ctrl_c_keeps_the_earlier_bake(tmp_path, demo_blend):
    out = tmp_path / "out"
    assert main(["bake", str(demo_blend), "--frames", "1", "2", "--out", str(out)]) == 0
    before = contents(out)
    command = [*PALPATE, "bake", str(demo_blend), "--frames", "1", "100000", "--out", str(out)]
    found, _ = interrupted(command, has_loaded_blender, pause=1.0)
    assert found == (130, "", "palpate bake: stopped; an earlier bake is unchanged.\n")
    assert contents(out) == before


def test_ctrl_c_ends_a_call_into_blender_at_once(tmp_path):
    """A render of a minute must not keep the user waiting for that minute."""
    code = (
        "import time, pathlib; from palpate.commands import console\n"
        f"path = pathlib.Path({str(tmp_path / 'unfinished')!r}); path.touch()\n"
        "interrupted = console.exit_on_interrupt('stopped while rendering', path.unlink)\n"
        "with console.Interrupt.noted(), interrupted, console.blender_output_hidden():\n"
        "    print('chatter'); end = time.monotonic() + 30\n"
        "    while time.monotonic() < end: time.sleep(0.01)\n"
    )
    command = [sys.executable, "-c", code]
    (status, out, err), seconds = interrupted(command, lambda _: (tmp_path / "unfinished").exists(), pause=0.3)
    assert seconds < 5
    assert (status, out, err.strip()) == (130, "", "stopped while rendering")
    assert not (tmp_path / "unfinished").exists()


def test_blenders_words_come_back_when_something_is_wrong(capfd):
    with pytest.raises(ZeroDivisionError), console.blender_output_hidden():
        os.write(1, b"what Blender said\n")
        print(1 / 0)
    out, err = capfd.readouterr()
    assert "what Blender said" in err
    assert out == ""
    with console.blender_output_hidden():
        os.write(1, b"chatter\n")
        os.write(2, b"chatter\n")
        print("chatter")
    assert capfd.readouterr() == ("", "")


def test_peak_shear_adds_forces_and_not_numbers_of_different_axes():
    """Two texels whose x axes point against each other, each pushed along its own by 1 N: the sensor feels nothing."""
    texels = SimpleNamespace(tangent=np.array([[1.0, 0, 0], [-1.0, 0, 0]]), bitangent=np.array([[0, 1.0, 0], [0, 1.0, 0]]))
    readings = SimpleNamespace(normal_force=np.ones((1, 2)), shear=np.array([[[1.0, 0.0], [1.0, 0.0]]]))
    recording = SimpleNamespace(frames=[1], times=[0.0], dt=1e-3, warnings=(), sensors={"Tip": readings})
    recording.blocks = lambda: [recording]
    scenario = SimpleNamespace(sensors=[SimpleNamespace(name="Tip", texels=texels)])
    row = report(SimpleNamespace(recording=recording, scenario=scenario, folders={"Tip": None}, notes=())).splitlines()[-1]
    assert row.split() == ["Tip", "2", "1.0000", "N", "2.0000", "N", "0.0000", "N", "2.0000", "N"]


def test_export_of_what_is_not_baked_is_one_line(tmp_path, refused):
    press(frames=3)
    assert "is not baked" in refused("export", save(tmp_path))


# --- scenarios for palpate sweep


def test_a_scenario_is_what_a_bake_computes(tmp_path, scene, capfd):
    """Solved without Blender it gives the very numbers of the bake; writing it leaves no bake and changes no file."""
    press()
    blend = save(tmp_path)
    before = contents(tmp_path)
    assert main(["bake", str(blend), "--scenario", str(tmp_path / "made" / "scene.npz")]) == 0
    assert all("preparing its solver" in line for line in lines_of(capfd)[1])  # where it was not yet compiled
    assert contents(tmp_path) == {**before, "made/scene.npz": (tmp_path / "made" / "scene.npz").read_bytes()}
    recording = simulation.run(load_scenario(tmp_path / "made" / "scene.npz"))
    assert main(["bake", str(blend), "--out", str(tmp_path / "baked")]) == 0
    baked = load_recording(tmp_path / "baked" / "Pad" / "recording.npz")
    assert baked.digest == recording.digest
    for name in ("normal_force", "shear", "reading"):
        np.testing.assert_array_equal(getattr(recording.sensors["Pad"], name), getattr(baked.sensors["Pad"], name))
    assert baked.sensors["Pad"].normal_force.max() > 0


@pytest.mark.parametrize(("name", "reason"), [("folder", "is a folder"), ("", "not the name of a file")])
def test_a_scenario_that_cannot_be_written_is_one_sentence(tmp_path, scene, refused, name, reason):
    press()
    blend = save(tmp_path)
    (tmp_path / "folder").mkdir()
    assert reason in refused("bake", blend, "--scenario", tmp_path / name if name else "")
