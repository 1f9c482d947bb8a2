# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender shows of a bake is refused in one sentence when a file of the bake is damaged: Load, render and the timeline."""

import os
import shutil
from dataclasses import replace

import bpy
import pytest
from blender_scenes import baked, changes, dump, press

from palpate.addon.display import bake_display, baked_scene
from palpate.addon.render import figure_export
from palpate.addon.render.figure_request import FigureRequest
from palpate.addon.scene import participants
from palpate.addon.session import frame_status
from palpate.addon.timeline import baked_frames
from palpate.core.errors import PalpateError, SceneError
from palpate.core.io.bake_folder import IMAGE_LIST_NAME, read_manifest, write_manifest
from palpate.core.jobs import run_job

DAMAGES = {
    "half a recording": lambda pad: os.truncate(pad / "recording.npz", 3000),
    "no folder": shutil.rmtree,
    "no manifest": lambda pad: (pad / "manifest.json").write_bytes(b"{"),
    "half an image": lambda pad: os.truncate(pad / "tactile_0002.exr", 300),
}


def readers(scene, folder):
    """What reads a bake, by its name."""
    request = FigureRequest(kinds=("strip",), formats=("png",))
    return {
        "Load": lambda: bake_display.refresh(scene, baked_scene.bake_folders(scene)),
        "render": lambda: run_job(figure_export.make_figures(scene, folder, request)),
    }


def status(scene) -> str:
    baked_frames.forget()
    baked_frames.show(scene, participants.depsgraph_of(scene))
    return frame_status.status_of(scene).text


def test_damage_is_one_sentence_and_changes_nothing(tmp_path):
    scene, pad, _ = press(frames=4)
    bpy.ops.palpate.reset()
    scene.palpate.use_live = False
    pad.name = "pad"
    baked(scene, tmp_path)
    for read in readers(scene, tmp_path / "figures").values():
        read()
    assert status(scene) == "Frame 1 of the bake."
    shutil.rmtree(tmp_path / "figures")
    shutil.copytree(tmp_path / "palpate-bake", tmp_path / "good")
    before = dump()
    for way, damage in DAMAGES.items():
        shutil.rmtree(tmp_path / "palpate-bake")
        shutil.copytree(tmp_path / "good", tmp_path / "palpate-bake")
        damage(tmp_path / "palpate-bake" / "pad")
        for what, read in readers(scene, tmp_path / "figures").items():
            with pytest.raises(PalpateError, match=r"^[^\n]*'[^\n]*[.']$"):
                read()
                raise AssertionError(f"{what} accepted: {way}")
        shown = status(scene)
        if "image" not in way:  # the timeline reads none
            assert shown.endswith(".") and shown != "Frame 1 of the bake.", f"{way}: {shown}"
    assert changes(before, dump()) == []
    assert not (tmp_path / "figures").exists()


def test_a_bake_without_images_cannot_be_shown(tmp_path):
    scene, *_ = press(frames=3)
    (folder,) = baked(scene, tmp_path).folders.values()
    manifest = read_manifest(folder)
    files = {name: sha256 for name, sha256 in manifest.files.items() if name != IMAGE_LIST_NAME}
    write_manifest(folder, replace(manifest, files=files))
    for image in (*folder.glob("*.exr"), folder / IMAGE_LIST_NAME):
        image.unlink()
    before = dump()
    with pytest.raises(SceneError, match=r"The bake of sensor 'Pad' in '.*' has no tactile images.*bake again"):
        bake_display.refresh(scene, baked_scene.bake_folders(scene))
    assert changes(before, dump()) == []
