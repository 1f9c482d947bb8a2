# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake that is killed, at whatever moment, goes on where it was, and ends with the same bytes as one that was not."""

import hashlib
import json
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from blender_scenes import contents, press_and_drop, save, visible

from palpate.addon.bake import bake_checkpoint, bake_files
from palpate.addon.bake.bake import bake
from palpate.core.errors import FileError
from palpate.core.io import bake_switch
from palpate.core.io.private_folder import LOCK_NAME, MARKER_NAME, PRIVATE_FOLDER
from palpate.core.io.recording_npz import load_recording
from palpate.core.jobs.job_runner import SlicedJob, run_job
from palpate.core.solver import checkpoint

SCRIPT = Path(__file__).with_name("killed_bake.py")
FRAMES = 60


def start(path, report):
    command = [sys.executable, str(SCRIPT), str(path), str(report)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


@pytest.mark.long("kills five bakes at chance moments")
def test_sigkill_at_any_moment(tmp_path):
    scene, *_ = press_and_drop(frames=FRAMES)
    scene.palpate.use_auto_dt, scene.palpate.dt = False, 5e-5
    path = save(tmp_path)
    expected = contents_of_a_whole_bake(scene, tmp_path)
    report, dice, first_frames = tmp_path / "report.json", random.Random(4), []
    for kill in range(4):
        process = start(path, report)
        wait_for = dice.randrange(5, 12)  # frames of its own, then a moment that nobody chose
        seen = []
        for line in process.stdout:
            if line.strip().isdigit():
                seen.append(int(line))
            if len(seen) == wait_for:
                break
        time.sleep(dice.random() * 0.05)
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert seen, f"the bake ended by itself before kill {kill}"
        first_frames.append(seen[0])
        assert not report.exists() and not (tmp_path / "palpate-bake" / "Pad").exists()
    assert first_frames == sorted(first_frames) and first_frames[-1] > 10  # each went on where the one before was
    process = start(path, report)
    process.communicate(timeout=300)
    assert json.loads(report.read_text())[0] > first_frames[-1]
    assert contents(tmp_path / "palpate-bake") == expected


def contents_of_a_whole_bake(scene, tmp_path):
    scene.palpate.folder = str(tmp_path / "whole")
    run_job(bake(scene))
    return contents(tmp_path / "whole")


def abandon(scene, steps, **options):
    """Stop a bake as a kill would: it cannot clean up."""
    work = SlicedJob(bake(scene, **options))
    discard = bake_files.BakeFiles.discard
    bake_files.BakeFiles.discard = lambda self: self._lock.release()  # as the operating system does
    try:
        for _ in range(steps):
            work.work(0.0)
        work.cancel()
    finally:
        bake_files.BakeFiles.discard = discard


def always_due(monkeypatch):
    monkeypatch.setattr(bake_checkpoint, "CHECKPOINT_INTERVAL", 0.0)
    monkeypatch.setattr(bake_checkpoint, "MAX_COST_SHARE", float("inf"))


def growing(tmp_path):
    """The folder in which the only unfinished bake grows."""
    (found,) = bake_switch.growing_folders(tmp_path / "palpate-bake" / PRIVATE_FOLDER)
    return found


@pytest.fixture
def killed(tmp_path, monkeypatch):
    """A scene whose bake was killed at its sixth frame."""
    always_due(monkeypatch)
    scene, pad, *_ = press_and_drop(frames=8)
    save(tmp_path)
    abandon(scene, 8 + 6)
    assert (growing(tmp_path) / bake_checkpoint.CHECKPOINT_FOLDER / bake_checkpoint.STATE_FILE).is_file()
    return scene, pad


def computed(scene, **options):
    frames = []
    run_job(bake(scene, **options), lambda step: frames.append(step.frame) if step.stage == "Computing forces" else None)
    bake_switch.wait_for_removals()
    return frames


def test_the_next_bake_goes_on(killed, tmp_path):
    scene, _ = killed
    assert computed(scene)[0] == 6
    assert visible(tmp_path / "palpate-bake") == ["Pad", "Pad 2"]
    assert load_recording(tmp_path / "palpate-bake" / "Pad" / "recording.npz").frames.tolist() == list(range(1, 9))


def test_rows_that_a_thread_writes_are_the_same(tmp_path, monkeypatch):
    """Those of large sensors: a bake that was killed ends with the bytes of a whole one whose rows no thread wrote."""
    always_due(monkeypatch)
    scene, *_ = press_and_drop(frames=8)
    save(tmp_path)
    monkeypatch.setattr(bake_files, "THREADED_ROW_BYTES", 1 << 40)
    expected = contents_of_a_whole_bake(scene, tmp_path)
    monkeypatch.setattr(bake_files, "THREADED_ROW_BYTES", 0)
    scene.palpate.folder = str(tmp_path / "palpate-bake")
    abandon(scene, 8 + 6)
    assert computed(scene)[0] == 6
    assert contents(tmp_path / "palpate-bake") == expected


@pytest.mark.parametrize("what", ["parameter", "damaged state", "lost frames", "lost images"])
def test_what_does_not_fit_is_begun_anew(killed, tmp_path, what):
    scene, pad = killed
    place = growing(tmp_path) / bake_checkpoint.CHECKPOINT_FOLDER
    if what == "parameter":
        pad.palpate.k = 77.0
    elif what == "damaged state":
        (place / bake_checkpoint.STATE_FILE).write_bytes((place / bake_checkpoint.STATE_FILE).read_bytes()[:1000])
    elif what == "lost frames":
        (place / bake_checkpoint.FRAMES_FILE).unlink()
    else:
        shutil.rmtree(growing(tmp_path) / "sensors" / "Pad")
    assert computed(scene)[0] == 1
    assert visible(tmp_path / "palpate-bake") == ["Pad", "Pad 2"]
    assert len(load_recording(tmp_path / "palpate-bake" / "Pad" / "recording.npz").frames) == 8


@pytest.mark.parametrize("what", ["frames.rows", "images.sha256", "tactile_0007.exr", "hard link"])
def test_nothing_is_written_through_links(killed, tmp_path, what):
    """A bake folder from the net must not lead a bake into the user's files."""
    scene, _ = killed
    mine, place = tmp_path / "thesis.txt", growing(tmp_path)
    if what == "hard link":
        image = place / "sensors" / "Pad" / "tactile_0001.exr"
        mine.hardlink_to(image)
    else:
        mine.write_text("thesis")
        link = place / "checkpoint" / what if what == "frames.rows" else place / "sensors" / "Pad" / what
        link.unlink(missing_ok=True)
        link.symlink_to(mine)
    before = mine.read_bytes()
    baked = run_job(bake(scene))
    assert mine.read_bytes() == before
    assert len(baked.notes) == 1 and "is damaged (" in baked.notes[0] and "is a link or no file" in baked.notes[0]


def test_a_list_that_leads_out_is_not_followed(killed, tmp_path):
    """Its checksum stands in the state, as one from the net would have it."""
    scene, _ = killed
    place = growing(tmp_path)
    own = place / "sensors" / "Pad" / "images.sha256"
    own.write_bytes(own.read_bytes().replace(b"  tactile_0002.exr", b"  ../../t002.exr.."))
    state = place / "checkpoint" / bake_checkpoint.STATE_FILE
    with np.load(state) as members:
        arrays = {name: members[name] for name in members.files}
    about = json.loads(str(arrays["about"]))
    about["images"]["Pad"][1] = hashlib.sha256(own.read_bytes()).hexdigest()
    arrays["about"] = np.array(json.dumps(about))
    del arrays["sha256"]
    arrays["sha256"] = np.array(checkpoint.digest(arrays))
    np.savez(state, **arrays)
    (note,) = run_job(bake(scene)).notes
    assert "frames or images that it lists are not there" in note and str(tmp_path / "palpate-bake") in note


def test_a_bake_without_images_goes_on_too(tmp_path, monkeypatch):
    always_due(monkeypatch)
    scene, *_ = press_and_drop(frames=8)
    save(tmp_path)
    abandon(scene, 8 + 6, into_scene=False, images=False)
    assert computed(scene, into_scene=False, images=False)[0] == 6
    found = contents(tmp_path / "palpate-bake")
    scene.palpate.folder = str(tmp_path / "whole")
    run_job(bake(scene, into_scene=False, images=False))
    assert found == contents(tmp_path / "whole") and len(found) == 6


def test_a_bake_with_images_does_not_go_on_from_one_without(tmp_path, monkeypatch):
    always_due(monkeypatch)
    scene, *_ = press_and_drop(frames=8)
    save(tmp_path)
    abandon(scene, 8 + 6, into_scene=False, images=False)
    assert computed(scene)[0] == 1


def test_a_checkpoint_costs_the_same_at_any_length(killed, tmp_path):
    """It rewrites only the state: it has no list that grows with the frames."""
    scene, _ = killed
    place = growing(tmp_path) / bake_checkpoint.CHECKPOINT_FOLDER
    before = (place / bake_checkpoint.STATE_FILE).stat().st_size
    abandon(scene, 8 + 2)
    assert abs((place / bake_checkpoint.STATE_FILE).stat().st_size - before) < 64
    assert sorted(path.name for path in place.iterdir()) == [bake_checkpoint.FRAMES_FILE, bake_checkpoint.STATE_FILE]


@pytest.mark.parametrize("damage", ["empty", "short", "other", "missing"])
def test_images_that_a_power_cut_has_damaged_are_written_again(killed, tmp_path, damage):
    """The checkpoint vouches for them, but the disk has lost them."""
    scene, _ = killed
    images = sorted(growing(tmp_path).rglob("tactile_*.exr"))
    assert len(images) >= 10
    for path in images[1:8:3]:
        content = path.read_bytes()
        path.write_bytes({"empty": b"", "short": content[: len(content) // 2]}.get(damage, content[:-1] + b"?"))
        if damage == "missing":
            path.unlink()
    assert computed(scene)[0] == 6
    found = contents(tmp_path / "palpate-bake")
    assert found == contents_of_a_whole_bake(scene, tmp_path)


def test_one_bake_at_a_time(tmp_path):
    """Two at once would mix their images; the second is refused and touches nothing, and later it may."""
    scene, *_ = press_and_drop(frames=12)
    save(tmp_path)
    expected = contents_of_a_whole_bake(scene, tmp_path)
    scene.palpate.folder = "//palpate-bake"
    first = bake(scene)
    while not (tmp_path / "palpate-bake" / PRIVATE_FOLDER / LOCK_NAME).exists():
        next(first)
    with pytest.raises(FileError, match="Another bake is writing to"):
        run_job(bake(scene))
    run_job(first)
    bake_switch.wait_for_removals()
    assert contents(tmp_path / "palpate-bake") == expected
    run_job(bake(scene))
    bake_switch.wait_for_removals()
    assert contents(tmp_path / "palpate-bake") == expected


def test_escape_leaves_nothing(tmp_path, monkeypatch):
    always_due(monkeypatch)
    scene, *_ = press_and_drop(frames=8)
    save(tmp_path)
    work = SlicedJob(bake(scene))
    for _ in range(14):
        work.work(0.0)
    work.cancel()
    assert visible(tmp_path / "palpate-bake") == []
    assert [path.name for path in (tmp_path / "palpate-bake" / PRIVATE_FOLDER).iterdir()] == [MARKER_NAME]
