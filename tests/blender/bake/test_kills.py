# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake that is killed leaves the earlier bake, the new one, or files that say that they are of both."""

import random
import shutil
import subprocess
import time
from contextlib import suppress

import pytest
from blender_scenes import baked, press_and_drop, save
from processes import PALPATE

from palpate.core.errors import FileError
from palpate.core.io.bake_reader import read_bake

MIXED = ("of different bakes", "is missing from the bake", "was interrupted")
"""Words of the sentences about files of two bakes."""
KILLS, LONGEST = 20, 300.0
"""Kills, and the seconds after which a bake counts as hung."""


def begun(path, folder) -> subprocess.Popen:
    """Start a bake, and return its process once it writes into the folder, or has ended."""
    command, end = [*PALPATE, "bake", str(path)], time.monotonic() + LONGEST
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not any((folder / ".palpate").glob("new/*")) and process.poll() is None:
        assert time.monotonic() < end, "the bake does not begin"
        time.sleep(0.002)
    return process


def completed(path, folder) -> float:
    """Bake undisturbed; return the seconds from the first file to the end."""
    process, began = begun(path, folder), time.monotonic()
    assert process.wait(LONGEST) == 0
    return time.monotonic() - began


@pytest.mark.long("kills twenty bakes at random moments")
def test_a_bake_killed_at_random_leaves_one_bake_or_says_that_it_is_mixed(tmp_path):
    scene, pad, *_ = press_and_drop(frames=40)
    path = save(tmp_path)
    folder, earlier = tmp_path / "palpate-bake", tmp_path / "earlier"
    baked(scene, into_scene=False)
    before = read_bake(folder).recording.digest
    (folder / "Pad" / "notes.txt").write_text("years of work")
    shutil.copytree(folder, earlier)
    pad.palpate.k *= 2.0
    save(tmp_path)
    seconds, running, dice = completed(path, folder), 0, random.Random(3)
    after = read_bake(folder).recording.digest
    assert after != before
    for number in dice.sample(range(KILLS), KILLS):  # one in each of as many equal parts of the work
        shutil.rmtree(folder)
        shutil.copytree(earlier, folder)
        process = begun(path, folder)
        with suppress(subprocess.TimeoutExpired):
            process.wait(seconds * (number + dice.random()) / KILLS)
        running += process.poll() is None
        assert process.returncode in (None, 0)
        process.kill()
        process.wait(LONGEST)
        try:
            assert read_bake(folder).recording.digest in (before, after)
        except FileError as error:
            assert any(words in str(error) for words in MIXED), error
    assert running >= KILLS // 2
    completed(path, folder)  # whatever the last kill has left
    assert read_bake(folder).recording.digest == after
    assert (folder / "Pad" / "notes.txt").read_text() == "years of work"
    assert sorted(item.name for item in folder.iterdir()) == [".palpate", "Pad", "Pad 2"]
