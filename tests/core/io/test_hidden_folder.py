# SPDX-License-Identifier: GPL-3.0-or-later
"""Hidden folders: one process at a time, nothing is left of killed ones, and nothing of the user's is touched."""

import os
import subprocess
import sys

import pytest

from palpate.core.errors import FileError
from palpate.core.io.file_writing import atomic_write
from palpate.core.io.hidden_folder import (
    LOCK_NAME,
    PRIVATE_FOLDER,
    lock_folder,
    remove_abandoned,
    remove_own_files,
    temporary_folder,
)

PROGRAM = """
import os, sys
from pathlib import Path
from palpate.core.io.hidden_folder import lock_folder, temporary_folder
place = Path(sys.argv[1])
lock = lock_folder(place)
with temporary_folder(place, "video") as folder:
    (folder / "half.png").write_text("half")
    print("working", flush=True)
    sys.stdin.readline()
"""


@pytest.fixture
def other(tmp_path):
    """Another process that has locked the folder, and works in a temporary one."""
    command = [sys.executable, "-c", PROGRAM, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "working\n"
        yield process
        process.kill()


def temporary(folder):
    return [path.name for path in folder.glob(".palpate-*")]


def test_a_second_process_is_refused_until_the_first_ends(other, tmp_path):
    with pytest.raises(FileError, match=r"^Another bake is writing to '.*': wait for it, or choose another folder\.$"):
        lock_folder(tmp_path)
    other.kill()
    other.wait()
    lock_folder(tmp_path).release()
    assert [path.name for path in (tmp_path / PRIVATE_FOLDER).iterdir()] == [LOCK_NAME]


def test_one_process_locks_a_folder_once(tmp_path):
    lock = lock_folder(tmp_path, "sweep")
    with pytest.raises(FileError, match="^Another sweep is writing to"):
        lock_folder(tmp_path, "sweep")
    lock.release()
    lock_folder(tmp_path, "sweep").release()


def test_what_killed_processes_have_left_is_removed_and_nothing_else(other, tmp_path):
    mine = tmp_path / ".palpate-video-thesis12"
    mine.mkdir()
    (mine / "thesis.txt").write_text("mine")
    in_use = [name for name in temporary(tmp_path) if name != mine.name]
    remove_abandoned(tmp_path)
    assert len(in_use) == 1 and sorted(temporary(tmp_path)) == sorted([*in_use, mine.name])
    other.kill()
    other.wait()
    with temporary_folder(tmp_path, "export") as folder:
        assert sorted(temporary(tmp_path)) == sorted([folder.parent.name, mine.name])
    assert temporary(tmp_path) == [mine.name] and (mine / "thesis.txt").read_text() == "mine"


def test_a_process_that_ends_leaves_nothing(tmp_path):
    with temporary_folder(tmp_path, "export") as folder, atomic_write(tmp_path / "a.txt") as file:
        remove_own_files()
        assert not folder.exists() and not file.exists()
        file.write_text("again")


@pytest.mark.parametrize("what", ["file", "folder", "link", "linked lock"])
def test_a_hidden_folder_of_the_user_s_is_refused(tmp_path, what):
    place, mine = tmp_path / "bake" / PRIVATE_FOLDER, tmp_path / "mine"
    place.parent.mkdir()
    mine.mkdir()
    (mine / LOCK_NAME).write_text("mine")
    if what == "file":
        place.write_text("mine")
    elif what == "link":
        place.symlink_to(mine)
    else:
        place.mkdir()
        if what == "linked lock":
            (place / LOCK_NAME).symlink_to(mine / LOCK_NAME)
        else:
            (place / "notes.txt").write_text("mine")
    with pytest.raises(FileError, match="was not made by Palpate|could not be made"):
        lock_folder(place.parent)
    assert (mine / LOCK_NAME).read_text() == "mine"


def test_the_hidden_folder_of_an_earlier_version_is_ours(tmp_path):
    (tmp_path / PRIVATE_FOLDER).mkdir()
    (tmp_path / PRIVATE_FOLDER / "palpate-folder.json").write_text("{}")
    lock_folder(tmp_path).release()
    assert sorted(path.name for path in (tmp_path / PRIVATE_FOLDER).iterdir()) == ["palpate-folder.json", LOCK_NAME]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_one_sentence(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(FileError, match="could not be made"):
        lock_folder(tmp_path)
    with pytest.raises(FileError, match="No folder can be made"), temporary_folder(tmp_path, "video"):
        pass
