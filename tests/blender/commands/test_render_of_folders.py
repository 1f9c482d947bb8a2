# SPDX-License-Identifier: GPL-3.0-or-later
"""`palpate render --bake DIR` shows a bake that was written without its .blend as one that was saved, or refuses it."""

import bpy
import numpy as np
import pytest
from blender_scenes import contents, press_and_drop, reopen, save

from palpate.addon.bake import bake
from palpate.commands import main
from palpate.core.io.bake_reader import read_bake
from palpate.core.jobs import run_job


@pytest.fixture
def written(tmp_path, monkeypatch):
    """A scene with a free ball whose bake lies in a folder, and the same bake in a .blend of its own."""
    press_and_drop(frames=6)
    save(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["bake", "scene.blend", "--out", "files"]) == 0
    assert main(["bake", "scene.blend", "--out", "other", "--save-as", "baked.blend"]) == 0
    return tmp_path


def poses(scene):
    """Return the world matrices of everything that shows, at each frame."""
    found = []
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        found.append([np.array(obj.matrix_world) for obj in sorted(scene.objects, key=lambda obj: obj.name)])
    return np.array(found)


def test_figures_are_those_of_a_saved_bake(written):
    before = contents(written / "files")
    for scene, more, out in (("scene", ["--bake", "files"], "one"), ("baked", [], "two")):
        words = ["render", f"{scene}.blend", *more, "--only", "curves", "--only", "strip", "--format", "svg", "--out", out]
        assert main(words) == 0
    assert contents(written / "files") == before
    for name in ("curves.svg", "strip.svg"):
        assert (written / "one" / name).stat().st_size == (written / "two" / name).stat().st_size
    scene = reopen(written / "scene.blend")
    run_job(bake.show_bake(scene, read_bake(written / "files")))
    shown = poses(scene)
    assert scene.objects["Pad"].palpate.bake_folder
    names = sorted(obj.name for obj in scene.objects)
    scene = reopen(written / "baked.blend")
    assert sorted(obj.name for obj in scene.objects) == names
    np.testing.assert_array_equal(poses(scene), shown)
    assert np.ptp(shown, axis=0).max() > 1e-3  # the free ball falls


def test_a_part_of_the_sensors_and_of_the_frames(written):
    assert main(["bake", "scene.blend", "--out", "part", "--sensor", "Pad", "--frames", "2", "5"]) == 0
    words = "render scene.blend --bake part --only numbers --frame 5 --format svg --out figures"
    assert main(words.split()) == 0
    assert [path.name for path in (written / "figures").glob("*.svg")] == ["numbers_Pad_0005.svg"]


def test_a_bake_of_another_state_is_refused(written, refused):
    def reason(folder):
        return refused("render", "scene.blend", "--bake", folder, "--only", "curves", "--out", "figures")

    scene = reopen(written / "scene.blend")
    scene.objects["Pad"].palpate.k *= 1.01
    save(written)
    said = reason("files")
    assert "not of 'Scene' as it is now" in said and "files" in said
    assert "give the folder of the whole bake" in reason("files/Pad")
    bpy.context.scene.objects["Pad"].name = "Plate"
    save(written)
    assert "sensor 'Pad'" in reason("files")
    assert main(["bake", "scene.blend", "--out", "bare", "--no-images"]) == 0
    assert "no tactile images" in reason("bare")
