# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bake belongs to which scene: the .blend names its bake, the bake names its scene, and who finds them apart says so."""

import shutil

import bpy
import numpy as np
import pytest
from blender_scenes import baked, baked_file, contents, press, reopen, save

from palpate.addon.display import bake_display, bake_identity, baked_scene
from palpate.addon.render import figure_export
from palpate.addon.session import frame_status
from palpate.commands import blender, export
from palpate.core.errors import FileError, SceneError
from palpate.core.io.bake_folder import read_manifest
from palpate.core.io.bake_reader import read_bake


@pytest.fixture
def saved(tmp_path):
    """A scene, baked, saved and opened again."""
    path, _ = baked_file(press(frames=3)[0], tmp_path, "first.blend")
    return reopen(path), path


def test_blend_and_bake_name_each_other(saved, tmp_path):
    scene, path = saved
    manifest = read_manifest(tmp_path / "palpate-bake" / "Pad")
    own = scene.palpate
    assert len(own.scene_id) == 32 and (own.baked_digest, own.baked_id) == (manifest.digest, manifest.bake_id)
    assert (manifest.scene_id, manifest.scene_path) == (own.scene_id, "../first.blend")
    scene.palpate.folder, scene_id = "//other", own.scene_id
    baked(scene)
    assert scene.palpate.scene_id == scene_id == read_manifest(tmp_path / "other" / "Pad").scene_id


def test_who_finds_another_bake_in_the_folder_says_so(saved, tmp_path):
    scene, path = saved
    old, own_recording = tmp_path / "old", read_bake(tmp_path / "palpate-bake").recording
    shutil.copytree(tmp_path / "palpate-bake", old)
    scene.frame_set(2)
    assert frame_status.status_of(scene).text == "Frame 2 of the bake." and bake_identity.other_bake(scene) == ""
    scene.objects["Pad"].palpate.k *= 2.0
    baked(scene, into_scene=False)  # by a script, or by another Blender
    scene = reopen(path)  # not saved: it shows the old bake
    expected = (
        f"'{tmp_path / 'palpate-bake' / 'Pad'}' holds another bake than the one that 'Scene' shows: "
        "bake again, or open the .blend that was saved with that bake."
    )
    scene.frame_set(2)
    assert frame_status.status_of(scene).text == expected
    for read in (
        lambda: figure_export.read_scene_bake(scene),
        lambda: bake_display.refresh(scene, baked_scene.bake_folders(scene)),
        lambda: export.find_bake(str(path)),
    ):
        with pytest.raises(SceneError) as caught:
            read()
        assert str(caught.value) == expected
    shutil.rmtree(tmp_path / "palpate-bake")
    old.rename(tmp_path / "palpate-bake")  # its own bake is back while the file is open
    scene = bpy.context.scene
    scene.frame_set(3)
    status = frame_status.status_of(scene)
    assert status.text == "Frame 3 of the bake."
    assert np.array_equal(status.frame.sensors["Pad"].normal_force, own_recording.sensors["Pad"].normal_force[2])
    assert figure_export.read_scene_bake(scene).folders


def test_a_bake_with_the_same_forces_but_other_files_is_another_one(saved, tmp_path):
    scene, _ = saved
    scene.palpate.baked_id = "0" * 32
    assert "another bake" in bake_identity.other_bake(scene)
    scene.palpate.baked_id = ""  # as saved by an earlier version
    assert bake_identity.other_bake(scene) == ""


def test_a_copy_of_a_blend_does_not_replace_the_bake_of_its_original(saved, tmp_path):
    scene, path = saved
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "copy.blend"))
    files = contents(tmp_path / "palpate-bake")
    with pytest.raises(FileError) as caught:
        baked(scene)
    folder = tmp_path / "palpate-bake" / "Pad"
    assert str(caught.value) == f"'{folder}' holds the bake of '{path}': choose another bake folder, or rename this one."
    assert contents(tmp_path / "palpate-bake") == files
    path.unlink()
    baked(scene)
    assert read_manifest(tmp_path / "palpate-bake" / "Pad").scene_file == "copy.blend"


def copied_scene(original):
    """Make another scene of the same objects with the settings of the original, as a linked or full copy has them."""
    bpy.context.window.scene = original
    bpy.ops.scene.new(type="LINK_COPY")
    copy = bpy.context.scene
    assert copy != original and copy.palpate.scene_id == original.palpate.scene_id
    return copy


def test_copied_scenes_of_one_blend(saved, tmp_path):
    original, path = saved
    own_id = original.palpate.scene_id
    copy = copied_scene(original)
    with pytest.raises(FileError, match=r"holds the bake of another scene of the same \.blend"):
        baked(copy)
    copy.palpate.folder = "//copy"
    baked(copy)
    assert copy.palpate.scene_id not in ("", own_id) and original.palpate.scene_id == own_id
    original.name = "Renamed"
    copied_scene(original).name = "Scene"
    bpy.context.scene.palpate.folder = "//third"
    baked(bpy.context.scene)
    assert bpy.context.scene.palpate.scene_id not in ("", own_id, copy.palpate.scene_id)


def test_a_bake_that_is_repeated_from_the_same_file_has_the_same_bytes(tmp_path):
    scene, *_ = press(frames=2)
    path = save(tmp_path)
    baked(scene)
    first = contents(tmp_path / "palpate-bake")
    scene = reopen(path)  # not saved with its id
    assert scene.palpate.scene_id == ""
    baked(scene)
    assert contents(tmp_path / "palpate-bake") == first


def test_a_copied_scene_is_told_from_its_original_after_saving(saved, tmp_path):
    original, path = saved
    own_id, copy = original.palpate.scene_id, copied_scene(original)
    original.name, copy.name = "Z", "A"  # files are read in the order of names
    bpy.ops.wm.save_mainfile()
    reopen(path)
    assert {scene.name: scene.palpate.scene_id for scene in bpy.data.scenes} == {"A": "", "Z": own_id}
    bpy.context.window.scene = bpy.data.scenes["Z"]
    baked(bpy.data.scenes["Z"])
    with pytest.raises(FileError, match="another scene"):
        baked(bpy.data.scenes["A"])


def test_the_command_stores_no_id_in_a_bake_that_it_does_not_save(saved, tmp_path):
    scene, path = saved
    bare = tmp_path / "bare.blend"
    scene.palpate.scene_id = ""
    bpy.ops.wm.save_as_mainfile(filepath=str(bare))
    out = tmp_path / "out"
    scene.palpate.folder = str(out)
    baked(scene, into_scene=False)
    first = contents(out)
    assert read_manifest(out / "Pad").scene_id == "" and read_manifest(out / "Pad").scene_file == "bare.blend"
    baked(scene, into_scene=False)
    assert contents(out) == first
    renamed = tmp_path / "renamed.blend"
    baked(scene, blend=blender.blend_to_save(renamed))
    assert read_manifest(out / "Pad").scene_path == "../renamed.blend"
    scene = reopen(bare)
    scene.palpate.folder = str(out)
    with pytest.raises(FileError, match=r"holds the bake of '.*renamed\.blend'"):
        baked(scene, into_scene=False)
