# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose bake it is: told by the id of the scene and the path of its .blend, wherever both lie."""

from dataclasses import replace

import pytest
import sample_bake

from palpate.core.io.bake_folder import BakeOwner, other_owner


@pytest.fixture
def project(tmp_path):
    """A .blend, and the bake folder beside it."""
    folder = tmp_path / "project" / "palpate"
    folder.mkdir(parents=True)
    blend = folder.parent / "first.blend"
    blend.write_text("")
    return folder, blend


def manifest(folder, owner):
    """The manifest that a bake of this owner leaves."""
    name = "" if owner.blend is None else owner.blend.name
    return sample_bake.manifest(scene_file=name, scene_id=owner.scene_id, scene_path=owner.scene_path(folder))


@pytest.mark.parametrize("one", ["", "a" * 32])
def test_the_same_blend_is_the_owner(project, one):
    folder, blend = project
    left = manifest(folder, BakeOwner(one, blend))
    assert left.scene_path == "../first.blend"
    assert other_owner(left, folder, BakeOwner(one, blend)) == ""
    assert other_owner(left, folder, BakeOwner("", blend)) == ""
    assert other_owner(left, folder, BakeOwner("b" * 32, blend)) == ""  # the earlier bake was never saved in it


@pytest.mark.parametrize("place", ["second.blend", "../second.blend", "../far/away/second.blend"])
def test_another_blend_is_refused_wherever_it_lies(project, place):
    folder, blend = project
    second = (blend.parent / place).resolve()
    for first_id, second_id in (("a", "b"), ("a", ""), ("", "b"), ("", "")):
        left = manifest(folder, BakeOwner(first_id, blend))
        assert other_owner(left, folder, BakeOwner(second_id, second)) == f"'{blend}'"


def test_the_bake_of_a_deleted_blend_may_be_replaced(project):
    folder, blend = project
    left = manifest(folder, BakeOwner("a", blend))
    blend.unlink()
    assert other_owner(left, folder, BakeOwner("b", blend.with_name("second.blend"))) == ""


def test_a_renamed_or_moved_blend_is_the_owner_and_a_copy_is_not(project):
    folder, blend = project
    left, copy = manifest(folder, BakeOwner("a", blend)), blend.with_name("copy.blend")
    assert other_owner(left, folder, BakeOwner("a", copy)) == f"'{blend}'"
    blend.rename(copy)
    assert other_owner(left, folder, BakeOwner("a", copy)) == ""


def test_a_project_that_is_moved_or_copied_as_a_whole(project, tmp_path):
    folder, blend = project
    left = manifest(folder, BakeOwner("a", blend))
    blend.parent.rename(tmp_path / "moved")
    moved = tmp_path / "moved" / "first.blend"
    assert other_owner(left, tmp_path / "moved" / "palpate", BakeOwner("a", moved)) == ""
    assert other_owner(left, tmp_path / "moved" / "palpate", BakeOwner("b", tmp_path / "x.blend")) == f"'{moved}'"


def test_links_to_folder_and_blend(project, tmp_path):
    folder, blend = project
    link, out = tmp_path / "link.blend", tmp_path / "out"
    link.symlink_to(blend)
    out.symlink_to(folder)
    left = manifest(out, BakeOwner("", link))
    assert left.scene_path == "../first.blend"
    assert other_owner(left, out, BakeOwner("", blend)) == other_owner(left, folder, BakeOwner("", link)) == ""


def test_a_blend_that_is_saved_under_another_name_with_its_bake(project):
    folder, blend = project
    saved = blend.with_name("saved.blend")
    assert other_owner(manifest(folder, BakeOwner("", blend)), folder, BakeOwner("a", saved, blend)) == ""
    left = manifest(folder, BakeOwner("a", saved, blend))
    assert left.scene_path == "../saved.blend"
    saved.write_text("")
    assert other_owner(left, folder, BakeOwner("c", saved, blend)) == ""
    assert other_owner(left, folder, BakeOwner("", blend)) == f"'{saved}'"


def test_two_scenes_of_one_blend(project):
    folder, blend = project
    left = manifest(folder, BakeOwner("a", blend))
    assert other_owner(left, folder, BakeOwner("b", blend, None, frozenset("a"))) == "another scene of the same .blend"
    assert other_owner(left, folder, BakeOwner("a", blend, None, frozenset("b"))) == ""


def test_scenes_that_were_never_saved(project):
    folder, blend = project
    left = manifest(folder, BakeOwner("a", None))
    assert (left.scene_file, left.scene_path) == ("", "")
    assert other_owner(left, folder, BakeOwner("a", blend)) == ""  # saved since
    assert other_owner(left, folder, BakeOwner("b", None)) == ""
    assert other_owner(left, folder, BakeOwner("", None)) == ""


@pytest.mark.parametrize("path", ["\0", "//server/share/x.blend", "\\\\server\\share\\x.blend", "x" * 10_000, "../" * 500])
def test_a_path_from_a_hostile_manifest(project, path):
    folder, blend = project
    left = replace(manifest(folder, BakeOwner("a", None)), scene_path=path)
    assert other_owner(left, folder, BakeOwner("b", blend)) == ""
