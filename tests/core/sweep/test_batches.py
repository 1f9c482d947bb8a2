# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs that are computed and brought onto the disk together: each is what it would be alone, and is there whole or not."""

import errno
import hashlib
import json
import os
import random
from itertools import pairwise

import pytest
from small_study import run_hashes, tree, write_study
from sweep_runs import new_study

from palpate.core.errors import FileError
from palpate.core.io import group_sync
from palpate.core.io.group_sync import GroupSync
from palpate.core.study import run_shards
from palpate.core.study.run_files import done_runs, make_folders, run_batch, write_failure
from palpate.sweep.child import Scenes, compute_run
from palpate.sweep.dataset import publish
from palpate.sweep.study_folder import begin_study
from palpate.sweep.worker import compute_batch, end_children

SPREAD = '"Pad.k" = { log-uniform = [20, 2000] }\n"Pad.unit" = { choice = ["N", "V"] }'
DIGESTS = [f"{number:024x}" for number in range(3)]


@pytest.fixture
def study(tmp_path):
    """The folder of a study without runs."""
    folder = new_study(tmp_path / "study")
    make_folders(folder)
    return folder


def write(place, digest: str) -> None:
    (place / digest / "Pad").mkdir(parents=True)
    (place / digest / "Pad" / "recording.npz").write_bytes(b"forces")
    (place / digest / "run.json").write_bytes(b"{}")


def files_of(folder) -> dict[str, str]:
    """Hashes of all files of the runs; the seconds that a run took are left out."""
    found = {}
    for file in sorted((folder / "runs").rglob("*")):
        content = file.read_bytes() if file.is_file() else b""
        if file.name == "run.json":
            words = json.loads(content)
            assert words.pop("seconds") > 0.0
            content = json.dumps(words, sort_keys=True).encode()
        found[str(file.relative_to(folder))] = hashlib.sha256(content).hexdigest()
    return found


def computed(folder, batches, shared_scenes: bool = True):
    """Compute batches of runs, one after the other, in processes that know each other's scenes or do not."""
    scenes = Scenes(folder)
    for batch_of_runs in batches:
        with run_batch(folder) as batch:
            for run in batch_of_runs:
                compute_run(scenes if shared_scenes else Scenes(folder), run, batch.place)
                batch.add(run.digest)


@pytest.mark.slow("computes a study in seven orders")
@pytest.mark.parametrize("recordings", [False, True])
def test_a_run_has_the_same_bytes_in_any_batch(tmp_path, recordings):
    """One by one in processes that know nothing of each other, and then in random orders and batches of random sizes."""
    orders = 2 if recordings else 5
    folders = [tmp_path / str(number) for number in range(1 + orders)]
    studies = [write_study(folder, 7, more=SPREAD) for folder in folders]
    for study in studies:
        study.write_text(study.read_text().replace("fps = 100", f"fps = 100\nrecordings = {str(recordings).lower()}"))
    opened = [begin_study(study, study.parent / "out", lambda *_: None) for study in studies]
    computed(opened[0].folder, [[run] for run in opened[0].runs], shared_scenes=False)
    for seed, one in enumerate(opened[1:]):
        dice = random.Random(seed)
        runs = dice.sample(one.runs, len(one.runs))
        cuts = sorted({0, len(runs), *(dice.randrange(len(runs)) for _ in range(dice.randrange(5)))})
        if dice.random() < 0.5:
            run_shards._open.clear()  # a process of its own begins a shard of its own
        computed(one.folder, [runs[begin:end] for begin, end in pairwise(cuts)])
    expected = files_of(opened[0].folder) if recordings else run_hashes(opened[0].folder)
    assert len(done_runs(opened[0].folder)) == 7
    publish(opened[0].folder, opened[0].runs)
    dataset = tree(opened[0].folder / "dataset")
    for one in opened[1:]:
        assert (files_of(one.folder) if recordings else run_hashes(one.folder)) == expected
        publish(one.folder, one.runs)
        assert tree(one.folder / "dataset") == dataset
    if recordings:
        assert len([name for name in expected if name.endswith("run.json")]) == 7


@pytest.mark.parametrize("as_a_whole", [True, False])
def test_runs_get_their_names_after_they_are_on_the_disk(study, monkeypatch, as_a_whole):
    done = []
    rename = os.rename
    monkeypatch.setattr(group_sync, "_syncs_as_a_whole", lambda place: as_a_whole)
    monkeypatch.setattr(group_sync, "sync_file_system", lambda handle: done.append("disk"))
    monkeypatch.setattr(group_sync, "sync_file", lambda path: done.append("disk"))
    monkeypatch.setattr(os, "rename", lambda old, new: (done.append("name"), rename(old, new)))
    with run_batch(study) as batch:
        for digest in DIGESTS:
            write(batch.place, digest)
            batch.add(digest)
        assert not done_runs(study)
    assert done == ["disk"] * (1 if as_a_whole else 6) + ["name"] * 3
    assert done_runs(study) == set(DIGESTS)
    assert not list((study / "runs").glob(".*"))


def test_a_disk_that_loses_data_is_one_sentence_and_no_run_is_done(study, monkeypatch):
    def fail(*_words):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(group_sync, "sync_file_system", fail)
    monkeypatch.setattr(group_sync, "sync_file", fail)
    with (
        pytest.raises(FileError, match="Runs could not be written to .*give the same command again"),
        run_batch(study) as batch,
    ):
        write(batch.place, DIGESTS[0])
        batch.add(DIGESTS[0])
    assert not done_runs(study) and not list((study / "runs").iterdir())


def test_only_runs_that_are_whole_take_their_places(study):
    """One was not added, since the process that wrote it died; another one was written by a faster process meanwhile."""
    write(study / "runs", DIGESTS[1])
    write_failure(study, DIGESTS[0], "It was too slow.")
    write_failure(study, DIGESTS[2], "It is too slow.")
    with run_batch(study) as batch:
        for digest in DIGESTS:
            write(batch.place, digest)
        batch.add(DIGESTS[0])
        batch.add(DIGESTS[1])
    assert done_runs(study) == set(DIGESTS[:2])
    assert [path.name for path in (study / "failed").iterdir()] == [f"{DIGESTS[2]}.txt"]


def test_nothing_is_put_into_place_when_the_process_stops(study):
    with pytest.raises(KeyboardInterrupt), run_batch(study) as batch:
        write(batch.place, DIGESTS[0])
        batch.add(DIGESTS[0])
        raise KeyboardInterrupt
    assert not done_runs(study)


def test_a_file_system_that_is_asked_as_a_whole_does_what_it_says(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "b").write_bytes(b"c")
    group = GroupSync(tmp_path)
    group.sync([tmp_path / "a"])
    group.close()
    group.close()
    assert (tmp_path / "a" / "b").read_bytes() == b"c"


@pytest.mark.slow("starts the process of a worker")
def test_a_worker_leaves_no_hidden_folder_behind(tmp_path):
    opened = begin_study(write_study(tmp_path, 3), tmp_path / "out", lambda *_: None)
    words = [{"index": run.index, "scene": run.scene, "values": run.values, "digest": run.digest} for run in opened.runs]
    try:
        answers = compute_batch(str(opened.folder), words)
    finally:
        end_children()
    assert [answer["status"] for answer in answers] == ["done"] * 3
    assert done_runs(opened.folder) == {run.digest for run in opened.runs}
    assert [path.suffix for path in (opened.folder / "runs").iterdir()] == [".shard"]
