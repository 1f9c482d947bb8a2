# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake that is killed leaves the earlier bake, the new one, or files that say that they are of both."""

import shutil
import sys

import pytest
from blender_scenes import press_and_drop, save
from kills import Kills

from palpate.addon.bake.bake import bake
from palpate.core.errors import FileError
from palpate.core.io.bake_reader import read_bake
from palpate.core.jobs import run_job

COMMAND = [sys.executable, "-m", "palpate.commands", "bake"]
MIXED = ("of different bakes", "is missing from the bake", "was interrupted")
"""Words of the sentences about files of two bakes."""


@pytest.mark.long("kills twenty bakes at random moments")
def test_a_bake_killed_at_random_leaves_one_bake_or_says_that_it_is_mixed(tmp_path):
    scene, pad, *_ = press_and_drop(frames=40)
    path = save(tmp_path)
    folder, earlier = tmp_path / "palpate-bake", tmp_path / "earlier"
    run_job(bake(scene, into_scene=False))
    before = read_bake(folder).recording.digest
    (folder / "Pad" / "notes.txt").write_text("years of work")
    shutil.copytree(folder, earlier)
    pad.palpate.k *= 2.0
    save(tmp_path)

    def restore():
        shutil.rmtree(folder)
        shutil.copytree(earlier, folder)

    kills = Kills([*COMMAND, str(path)], seed=3, began=lambda: any((folder / ".palpate").glob("new/*")))
    kills.run()
    after = read_bake(folder).recording.digest
    assert after != before
    running = 0
    for kill in kills.repeat(20, restore):
        running += kill.was_running
        try:
            assert read_bake(folder).recording.digest in (before, after)
        except FileError as error:
            assert any(words in str(error) for words in MIXED), error
    assert running >= 10
    kills.run()  # whatever the last kill has left
    assert read_bake(folder).recording.digest == after
    assert (folder / "Pad" / "notes.txt").read_text() == "years of work"
    assert sorted(item.name for item in folder.iterdir()) == [".palpate", "Pad", "Pad 2"]
