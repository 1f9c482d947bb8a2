# SPDX-License-Identifier: GPL-3.0-or-later
"""The switch from an old bake to a new one, stopped at every single step: what is found then is the old bake or the new one."""

import json
import shutil
from contextlib import suppress
from pathlib import Path

import pytest
from file_faults import KILL, Injector, Stopped

from palpate.core.errors import FileError
from palpate.core.io import bake_switch
from palpate.core.io.folder_lock import FolderLock
from palpate.core.io.private_folder import PRIVATE_FOLDER, find_private_folder, make_private_folder

RUN = "0123456789abcdef"
NAMES = ("Pad", "Pad.old")


@pytest.fixture
def folder(tmp_path):
    """A bake folder with an old bake and a file of the user's; a new bake and a new .blend are complete."""
    folder = tmp_path / "bake"
    for name in NAMES:
        (folder / name).mkdir(parents=True)
        (folder / name / "manifest.json").write_text("old")
        (folder / name / "tactile_0001.exr").write_text("old")
        (folder / name / "notes.txt").write_text("mine")
    private = make_private_folder(folder)
    for name in NAMES:
        new = bake_switch.new_folder(bake_switch.growing_folder(private, RUN), name)
        new.mkdir(parents=True)
        (new / "manifest.json").write_text("new")
    (tmp_path / "scene.blend").write_text("old")
    (tmp_path / "scene.blend1").write_text("older")
    bake_switch.waiting_blend(tmp_path / "scene.blend", RUN).write_text("new")
    return folder


def record(folder):
    return bake_switch.Switch(RUN, NAMES, str(folder.parent / "scene.blend"), 2)


def bakes(folder):
    return {(bake_switch.present_folder(folder / name) / "manifest.json").read_text() for name in NAMES}


def check_whole(folder):
    """Check what a reader finds now, and what it finds once the switch is settled; return old or new."""
    assert (folder.parent / "scene.blend").is_file()
    (before,) = bakes(folder)
    bake_switch.settle(folder)
    bake_switch.wait_for_removals()
    (found,) = bakes(folder)
    assert found == before and bake_switch.pending_switch(folder) is None
    assert (folder.parent / "scene.blend").read_text() == found
    if found == "new":
        assert (folder.parent / "scene.blend1").read_text() == "old"
        assert (folder.parent / "scene.blend2").read_text() == "older"
    for growing in bake_switch.growing_folders(folder / PRIVATE_FOLDER):  # as the next bake does
        bake_switch.remove_growing(growing)
    assert not bake_switch.growing_folders(folder / PRIVATE_FOLDER)
    assert {(folder / name / "notes.txt").read_text() for name in NAMES} == {"mine"}
    assert sorted(path.name for path in folder.iterdir()) == [PRIVATE_FOLDER, *NAMES]
    return found


def number_of_calls(folder, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(folder.parent, copy, ignore=shutil.ignore_patterns("copy"))
    with Injector(copy) as injector:
        bake_switch.switch(copy / "bake", record(copy / "bake"))
    shutil.rmtree(copy)
    return len(injector.calls)


def test_stopped_at_every_step(folder, tmp_path):
    found = []
    total = number_of_calls(folder, tmp_path)
    assert total > 20
    for number in range(1, total + 1):
        copy = tmp_path / f"copy {number}"
        shutil.copytree(folder.parent, copy, ignore=shutil.ignore_patterns("copy*"))
        with (
            Injector(copy, number, KILL) as injector,
            suppress(Stopped),
        ):  # where the thread that removes is stopped, it goes on
            bake_switch.switch(copy / "bake", record(copy / "bake"))
        assert len(injector.calls) == number
        found.append(check_whole(copy / "bake"))
    assert found == sorted(found, reverse=True) and set(found) == {"old", "new"}


def test_stopped_while_it_is_settled(folder, tmp_path):
    """A second kill, at every step of carrying out what the first has left."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bake_switch, "_rename", lambda *_: (_ for _ in ()).throw(Stopped()))
        patch.setattr(bake_switch, "_rename_back", lambda *_: (_ for _ in ()).throw(OSError()))
        with pytest.raises(Stopped):
            bake_switch.switch(folder, record(folder))
    assert bakes(folder) == {"new"}
    for number in range(1, 60):
        copy = tmp_path / f"copy {number}"
        shutil.copytree(folder.parent, copy, ignore=shutil.ignore_patterns("copy*"))
        path = copy / "bake" / PRIVATE_FOLDER / bake_switch.SWITCH_NAME
        path.write_text(path.read_text().replace(str(folder.parent), str(copy)))
        with Injector(copy, number, KILL) as injector, suppress(Stopped):
            bake_switch.settle(copy / "bake")
        assert check_whole(copy / "bake") == "new"
        if len(injector.calls) < number:
            return
    raise AssertionError("it never came to its end")


def test_an_error_at_any_step_leaves_the_old_bake_or_the_new_one(folder, tmp_path):
    for number in range(1, number_of_calls(folder, tmp_path) + 1):
        copy = tmp_path / f"copy {number}"
        shutil.copytree(folder.parent, copy, ignore=shutil.ignore_patterns("copy*"))
        failed = False
        with Injector(copy, number, "EACCES"):
            try:
                bake_switch.switch(copy / "bake", record(copy / "bake"))
            except (FileError, OSError):
                failed = True
        assert check_whole(copy / "bake") == ("old" if failed else "new")


def test_a_reader_that_cannot_write_reads_from_where_the_record_leads(folder, monkeypatch):
    monkeypatch.setattr(bake_switch, "_rename_back", lambda *_: None)
    monkeypatch.setattr(Path, "unlink", lambda *_, **__: None)
    with Injector(folder, 10, KILL) as injector, pytest.raises(Stopped):
        bake_switch.switch(folder, record(folder))
    assert [call.split()[0] for call in injector.calls[-4:]] == ["fsync", "mkdir", "rename", "rename"]
    lock = FolderLock(folder)  # another process holds it
    bake_switch.settle(folder)
    assert bake_switch.pending_switch(folder) == record(folder)
    assert bakes(folder) == {"new"}
    assert dict(bake_switch.present_folders(folder)).keys() == set(NAMES)
    lock.release()


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "palpate-switch/1", "run": "../x"}', "[" * 100000])
def test_a_damaged_record_is_named(folder, text):
    (folder / PRIVATE_FOLDER / bake_switch.SWITCH_NAME).write_text(text)
    with pytest.raises(FileError, match="is damaged"):
        bake_switch.settle(folder)


@pytest.mark.parametrize("name", ["..", ".", "../thesis", "/tmp", ".palpate", "", 3])
def test_a_record_from_the_net_leads_nowhere_else(folder, name):
    content = {"format": bake_switch.SWITCH_FORMAT, "run": RUN, "folders": [name], "blend": "", "backups": 0}
    (folder / PRIVATE_FOLDER / bake_switch.SWITCH_NAME).write_text(json.dumps(content))
    with pytest.raises(FileError, match="is damaged"):
        bake_switch.settle(folder)


def test_a_folder_without_the_marker_is_not_taken_over(tmp_path):
    (tmp_path / PRIVATE_FOLDER).mkdir()
    assert find_private_folder(tmp_path) is None
    assert make_private_folder(tmp_path) == find_private_folder(tmp_path)  # an empty one, as a kill leaves it
    other = tmp_path / "other"
    (other / PRIVATE_FOLDER).mkdir(parents=True)
    (other / PRIVATE_FOLDER / "notes.txt").write_text("mine")
    with pytest.raises(FileError, match="was not made by Palpate"):
        make_private_folder(other)
