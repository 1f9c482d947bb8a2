# SPDX-License-Identifier: GPL-3.0-or-later
"""A new bake takes the place of the earlier one: stopped at any step, the next bake finds one of the two as a whole."""

import shutil
from contextlib import suppress

import pytest
from kills import stopped_at

from palpate.core.io import bake_folder
from palpate.core.io.hidden_folder import PRIVATE_FOLDER

NAMES = ("Pad", "Tip", "New")
EARLIER = NAMES[:2]


@pytest.fixture
def folder(tmp_path):
    """A bake folder with an earlier bake and files of the user's; a new bake, with one more sensor, is complete."""
    folder = tmp_path / "bake"
    for name in EARLIER:
        (folder / name / "plots").mkdir(parents=True)
        (folder / name / "manifest.json").write_text("earlier")
        (folder / name / "tactile_0001.exr").write_text("earlier")
        (folder / name / "notes.txt").write_text("mine")
        (folder / name / "plots" / "a.svg").write_text("mine")
    (folder / PRIVATE_FOLDER).mkdir()
    complete_bake(folder)
    return folder


def complete_bake(folder):
    new = bake_folder.begin_bake(folder)
    for name in NAMES:
        (new / name).mkdir()
        (new / name / "manifest.json").write_text("new")


def found(folder):
    """The bakes that the folders in a bake folder belong to, by their names."""
    return {path.name: (path / "manifest.json").read_text() for path in folder.iterdir() if path.name != PRIVATE_FOLDER}


def check_user_files(folder):
    for name in EARLIER:
        assert (folder / name / "notes.txt").read_text() == (folder / name / "plots" / "a.svg").read_text() == "mine"


WHOLE = {name: "new" for name in NAMES}
BEFORE = {name: "earlier" for name in EARLIER}


def test_the_new_bake_takes_the_place_of_the_earlier_one(folder):
    bake_folder.publish_bake(folder, NAMES)
    assert found(folder) == WHOLE and not (folder / "Pad" / "tactile_0001.exr").exists()
    check_user_files(folder)
    assert list((folder / PRIVATE_FOLDER).iterdir()) == [] and not bake_folder.is_interrupted(folder)


def replace_stopped(folder, number, error=None):
    """Replace; the call of that number fails. Return how many calls there were."""
    with stopped_at(number, error) as calls, suppress(OSError):
        bake_folder.publish_bake(folder, NAMES)
    return len(calls)


def test_killed_at_any_step_the_next_bake_finds_one_of_the_two(folder, tmp_path):
    seen = []
    for number in range(1, 100):
        copy = tmp_path / f"copy {number}"
        shutil.copytree(folder, copy)
        if replace_stopped(copy, number) < number:
            break
        left = found(copy)
        if left not in (BEFORE, WHOLE):  # readers see it by the ids or by a missing sensor
            assert len(set(left.values())) == 2 or not set(EARLIER) <= set(left) or bake_folder.is_interrupted(copy)
        bake_folder.begin_bake(copy)
        now = found(copy)
        now.pop("New", None)  # it had no predecessor, and its id says that it is of another bake
        assert set(now) == set(EARLIER) and len(set(now.values())) == 1
        check_user_files(copy)
        seen.append(now["Pad"])
        complete_bake(copy)
        bake_folder.publish_bake(copy, NAMES)
        assert found(copy) == WHOLE
        check_user_files(copy)
    assert 15 < number < 99 and seen == sorted(seen) and set(seen) == {"earlier", "new"}


def test_an_error_at_any_step_changes_nothing_or_leaves_the_new_bake(folder, tmp_path):
    results = []
    for number in range(1, 100):
        copy = tmp_path / f"copy {number}"
        shutil.copytree(folder, copy)
        if replace_stopped(copy, number, PermissionError(13, "Permission denied")) < number:
            break
        results.append(found(copy))
        assert results[-1] in (BEFORE, WHOLE)
        bake_folder.discard_bake(copy)
        assert found(copy) == results[-1]
        check_user_files(copy)
    assert BEFORE in results and WHOLE in results


def test_an_error_of_the_last_step_takes_everything_back(folder):
    def fail():
        raise OSError("the .blend is open elsewhere")

    with pytest.raises(OSError, match="elsewhere"):
        bake_folder.publish_bake(folder, NAMES, fail)
    assert found(folder) == BEFORE
    check_user_files(folder)


def test_a_file_of_the_same_name_is_kept_beside_the_other(folder):
    replace_stopped(folder, 7)
    assert found(folder) == WHOLE
    (folder / "Pad" / "notes.txt").write_text("later")
    bake_folder.discard_bake(folder)
    assert (folder / "Pad" / "notes.txt").read_text() == "later"
    assert (folder / "Pad" / "notes.txt_").read_text() == "mine"


def test_what_a_link_leads_to_stays(folder, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    (folder / "Pad").rename(elsewhere)
    (folder / "Pad").symlink_to(elsewhere)
    bake_folder.publish_bake(folder, NAMES)
    assert found(folder) == WHOLE and not (folder / "Pad").is_symlink()
    assert (elsewhere / "manifest.json").read_text() == "earlier"
