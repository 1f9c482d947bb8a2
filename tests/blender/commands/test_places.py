# SPDX-License-Identifier: GPL-3.0-or-later
"""Where commands read and write: folders that are missing are made, and links stay links."""

import os
import shutil

import pytest
from blender_scenes import contents

from palpate.commands import main


@pytest.fixture
def blend(tmp_path, demo_blend, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return shutil.copy(demo_blend, tmp_path / "scene.blend")


def test_missing_folders_are_made(blend, tmp_path):
    bake = ["bake", "scene.blend", "--frames", "1", "2"]
    assert main([*bake, "--out", "a/b/bake", "--save-as", "c/d/baked.blend"]) == 0
    assert (tmp_path / "a" / "b" / "bake" / "Finger A" / "manifest.json").is_file()
    assert main(["export", "c/d/baked.blend", "--out", "e/f"]) == 0
    assert main(["render", "c/d/baked.blend", "--only", "curves", "--format", "svg", "--out", "g/h"]) == 0
    assert (tmp_path / "g" / "h" / "curves.svg").is_file()
    assert main(["openrave", "export", "scene.blend", "--out", "i/j/robot.xml"]) == 0
    assert (tmp_path / "i" / "j" / "robot.xml").is_file()


def test_wrong_places_are_found_before_the_work(blend, tmp_path, refused):
    (tmp_path / "file").write_text("a file")
    before = contents(tmp_path)
    for words in (
        ["bake", "scene.blend", "--out", "file"],
        ["bake", "scene.blend", "--out", "file/deeper"],
        ["bake", "scene.blend", "--out", ""],
        ["bake", "scene.blend", "--out", "x" * 300],
        ["bake", "scene.blend", "--out", "\udcff\udcfe"],  # not UTF-8: Blender would crash
        ["bake", "\udcff\udcfe.blend"],
        ["bake", "scene.blend", "--out", "out", "--save-as", "\udcff\udcfe"],
        ["bake", "scene.blend", "--out", "out", "--save-as", "/"],
        ["bake", "scene.blend", "--out", "out", "--save-as", ".."],
        ["bake", "scene.blend", "--out", "out", "--save-as", ""],
        ["bake", "scene.blend", "--out", "out", "--save-as", "file/deeper.blend"],
        ["render", "scene.blend", "--out", "file"],
        ["openrave", "export", "scene.blend", "--out", "file/deeper.xml"],
        ["bake", "x" * 300],
        ["render", "missing.blend", "--out", "out"],
        ["demo", "--out", "file/deeper"],
    ):
        assert refused(*words).startswith(f"palpate {words[0]}: "), words
        assert contents(tmp_path) == before, words


def test_links_stay_links(blend, tmp_path):
    for folder in ("real", "other", "bakes"):
        (tmp_path / folder).mkdir()
    (tmp_path / "scene.blend").rename(tmp_path / "real" / "scene.blend")
    os.symlink("real/scene.blend", "scene.blend")
    os.symlink("bakes", "bake")
    os.symlink("../elsewhere", "other/dangling.blend")
    for last in ("2", "3"):  # the second replaces the first
        assert main(["bake", "scene.blend", "--frames", "1", last, "--out", "bake", "--save"]) == 0
        assert os.path.islink("scene.blend") and os.path.islink("bake")
        assert len(list((tmp_path / "bakes" / "Finger A").glob("*.exr"))) == int(last)
        for source in ("scene.blend", "real/scene.blend", "bake", "bake/Finger A"):
            assert main(["export", source, "--format", "npz", "--out", "out"]) == 0, source
    assert main(["render", "scene.blend", "--only", "curves", "--format", "svg", "--out", "out"]) == 0
    shown = sorted(path.name for path in (tmp_path / "real").iterdir() if not path.name.startswith("."))
    assert shown and shown == ["scene.blend", "scene.blend1", "scene.blend2"][: len(shown)]
