# SPDX-License-Identifier: GPL-3.0-or-later
"""A .blend that is saved with its bake: both are the old ones or both the new ones, and a kill between the two is said."""

import gc
import shutil
from contextlib import ExitStack

import bpy
import pytest
from blender_scenes import baked, press, press_and_drop, save, visible
from kills import stopped_at

from palpate.addon.bake import bake_files, scene_writer
from palpate.addon.bake.bake import bake
from palpate.addon.display import bake_identity, baked_scene
from palpate.addon.session import fcurves
from palpate.commands import blender, main
from palpate.core.errors import FileError
from palpate.core.io.bake_reader import read_bake
from palpate.core.io.hidden_folder import LOCK_NAME, PRIVATE_FOLDER
from palpate.core.jobs import run_job


def bake_and_save(path, k=None):
    scene = blender.open_scene(path)
    if k is not None:
        scene.objects["Pad"].palpate.k = k
    return run_job(bake(scene, blend=blender.blend_to_save(path))).recording.digest


@pytest.fixture
def saved(tmp_path):
    """A baked and saved .blend, and the digest of its bake."""
    press(frames=2)
    path = save(tmp_path)
    return path, bake_and_save(path)


def found(path):
    """Check that .blend and bake belong together as a later process finds them; return their digest."""
    scene = blender.open_scene(path)
    read = read_bake(path.parent / "palpate-bake")
    (folder,) = baked_scene.bake_folders(scene).values()
    assert folder == read.folders["Pad"] == path.parent / "palpate-bake" / "Pad"
    assert scene.palpate.baked_digest == read.recording.digest
    return read.recording.digest


def test_the_first_bake_is_saved_with_the_blend(saved):
    path, digest = saved
    assert found(path) == digest
    image = next(image for image in bpy.data.images if image.name == "Palpate Pad")
    assert (image.filepath, image.source, image.colorspace_settings.name) == (
        "//palpate-bake/Pad/tactile_0001.exr",
        "SEQUENCE",
        "Non-Color",
    )
    assert sorted(name.name for name in path.parent.iterdir()) == ["palpate-bake", "scene.blend", "scene.blend1"]
    assert visible(path.parent / "palpate-bake") == ["Pad"]


def bake_stopped(path, number):
    """Bake and save; once all files are complete, the process is killed at a step of this number. Return all steps."""
    replace, steps = bake_files.publish_bake, []
    with pytest.MonkeyPatch.context() as patch, ExitStack() as stack:

        def begin(*arguments):
            steps.append(stack.enter_context(stopped_at(number)))
            replace(*arguments)

        patch.setattr(bake_files, "publish_bake", begin)
        bake_and_save(path, k=77.0)
    gc.collect()  # the lock of the stopped process
    return steps[0]


@pytest.mark.long("bakes once for each step")
def test_stopped_at_every_step_of_the_last_one(saved, tmp_path):
    """Bake and .blend are the earlier ones, or the new ones, or whoever finds them says that they do not belong together."""
    path, earlier = saved
    digests, said, steps, number = [], 0, [""], 0
    while len(steps) >= number:
        number += 1
        home = tmp_path / f"copy {number}"
        home.mkdir()
        shutil.copy(path, home)
        shutil.copytree(path.parent / "palpate-bake", home / "palpate-bake")
        copy = home / path.name
        steps = bake_stopped(copy, number)
        scene = blender.open_scene(copy)
        try:
            digests.append(read_bake(home / "palpate-bake").recording.digest)
        except FileError as error:
            assert "was interrupted" in str(error)
            said += 1
        if digests[-1] != scene.palpate.baked_digest:
            assert bake_identity.other_bake(scene)
            said += 1
        (home / "palpate-bake" / "Pad").mkdir(exist_ok=True)
        (home / "palpate-bake" / "Pad" / "notes.txt").write_text("mine")
    assert number > 8 and said >= 2
    assert digests == sorted(digests, key=lambda digest: digest != earlier) and digests[0] == earlier
    assert bake_and_save(copy, k=88.0) == found(copy)
    assert sorted(item.name for item in home.iterdir() if not item.name.startswith("scene.blend")) == ["palpate-bake"]
    assert [item.name for item in (home / "palpate-bake" / PRIVATE_FOLDER).iterdir()] == [LOCK_NAME]
    assert (home / "palpate-bake" / "Pad" / "notes.txt").read_text() == "mine"


def test_a_blend_that_is_saved_is_there_at_every_moment(saved):
    path, _ = saved
    blender.open_scene(path)
    for number in range(1, 100):
        with stopped_at(number) as calls:
            blender.save_blend(path)
        assert path.read_bytes().startswith(b"\x28\xb5\x2f\xfd") or path.read_bytes().startswith(b"BLENDER")
        if len(calls) < number:
            break
    assert 2 < number < 99
    blender.open_blend(path)


def test_what_a_killed_save_has_left_is_removed_by_the_next_one(saved):
    path, _ = saved
    left = [path.with_name(f".{path.name}.palpate-partial{end}") for end in ("", "@")]
    mine = path.with_name(f".{path.name}.notes.partial")
    for file in (*left, mine):
        file.write_text("half")
    blender.open_scene(path)
    blender.save_blend(path)
    assert not any(file.exists() for file in left) and mine.exists()


def test_very_many_keyframes_are_said_before_they_are_made(tmp_path, monkeypatch):
    """As many as there are then: of a free cube and of two markers on each of two sensors."""
    scene, *_ = press_and_drop(frames=8)
    scene.palpate.overlays = {"FORCE", "CENTRE"}
    save(tmp_path)
    assert scene_writer.keyframe_warning(scene) == ""
    monkeypatch.setattr(scene_writer, "MANY_KEYFRAMES", 39)
    said = scene_writer.keyframe_warning(scene)
    assert said.startswith("The bake puts 40 keyframes into the scene (8 frames, bodies that forces move: 1, markers: 4): ")
    before = {curve for obj in scene.objects for curve in fcurves.of_object(obj) or ()}
    baked(scene)
    made = [curve for obj in scene.objects for curve in fcurves.of_object(obj) or () if curve not in before]
    assert sum(len(curve.keyframe_points) for curve in made if (curve.data_path, curve.array_index) == ("location", 0)) == 40


def test_the_command_says_it_before_the_bake(tmp_path, monkeypatch, capfd):
    press_and_drop(frames=3)
    path = save(tmp_path)
    monkeypatch.setattr(scene_writer, "MANY_KEYFRAMES", 5)
    assert main(["bake", str(path), "--save"]) == 0
    assert "warning: The bake puts 9 keyframes into the scene" in capfd.readouterr().err
    assert main(["bake", str(path), "--out", str(tmp_path / "files")]) == 0
    assert "keyframes" not in capfd.readouterr().err
