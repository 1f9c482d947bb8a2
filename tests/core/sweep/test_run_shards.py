# SPDX-License-Identifier: GPL-3.0-or-later
"""Shards keep every group of runs that was brought onto the disk, and nothing of one that was cut off."""

import errno
import hashlib
import os
import random
import shutil

import numpy as np
import pytest
from file_faults import EXIT, Injector
from small_study import run_hashes, tree, write_study

from palpate.core.errors import FileError
from palpate.core.study import run_shards
from palpate.core.study.run_files import RUNS, done_runs, make_folders, run_batch
from palpate.core.study.run_shards import KnownRuns, ShardIndex, ShardScan, append, digests_in, names_of
from palpate.sweep.child import Scenes, compute_run
from palpate.sweep.dataset import MOST_FILES, publish
from palpate.sweep.finished_runs import run_order
from palpate.sweep.report import write_report
from palpate.sweep.study_folder import begin_study
from palpate.sweep.worker import compute_batch, end_children

KILLED = 137
"""Exit status of a process that an Injector ends."""
COMMON = {"c" * 24: b"what they have in common"}


@pytest.fixture
def runs(tmp_path):
    """A folder of runs in which this process has no shard yet."""
    folder = tmp_path / "out" / "runs"
    folder.mkdir(parents=True)
    run_shards._open.pop(folder, None)
    return folder


def digest_of(number: int) -> str:
    return hashlib.sha256(bytes((number,))).hexdigest()[:24]


def content_of(number: int) -> bytes:
    return bytes((number,)) * (1 + 37 * number)


def put(folder, *numbers: int) -> None:
    append(folder, folder.parent, {digest_of(number): content_of(number) for number in numbers}, COMMON)


def shards(folder) -> list:
    return sorted(folder.glob("*.shard"))


def test_what_was_appended_is_read(runs):
    assert digests_in(runs) == set()
    put(runs, 1, 2, 3)
    put(runs, 4)
    put(runs, 5, 0)
    assert len(shards(runs)) == 1 and digests_in(runs) == {digest_of(number) for number in range(6)}
    index = ShardIndex(runs)
    for number in range(6):
        assert index.read(digest_of(number)) == content_of(number)
        assert index.start(digest_of(number), 20) == content_of(number)[:20]
    assert index.common("c" * 24) == COMMON["c" * 24]
    assert index.size == sum(len(content_of(number)) for number in range(6))
    assert digest_of(7) not in index
    with pytest.raises(KeyError):
        index.read(digest_of(7))


def test_every_cut_leaves_the_groups_before_it(runs):
    """At each byte of the file: as a kill leaves it, and as a power cut does, which may leave zeros or noise behind."""
    ends = []
    for numbers in ((1, 2), (3,), (4, 5)):
        put(runs, *numbers)
        ends.append(shards(runs)[0].stat().st_size)
    (path,) = shards(runs)
    whole = path.read_bytes()
    groups = [{digest_of(1), digest_of(2)}, {digest_of(3)}, {digest_of(4), digest_of(5)}]
    for cut in range(len(whole)):
        expected = set().union(*(group for group, end in zip(groups, ends, strict=True) if end <= cut))
        for tail in (b"", bytes(len(whole) - cut), bytes(byte ^ 255 for byte in whole[cut:])):
            path.write_bytes(whole[:cut] + tail)
            assert digests_in(runs) == expected, (cut, len(tail))


def test_nothing_is_appended_to_a_shard_that_somebody_changed(runs):
    put(runs, 1)
    shards(runs)[0].write_bytes(shards(runs)[0].read_bytes()[:-1])
    put(runs, 2)
    assert digests_in(runs) == {digest_of(2)} and len(shards(runs)) == 2
    assert ShardIndex(runs).common("c" * 24) == COMMON["c" * 24], "the new shard has it, too"
    for path in shards(runs):
        path.unlink()
    put(runs, 3)
    assert digests_in(runs) == {digest_of(3)}


def test_a_run_that_two_processes_computed_is_there_once(runs):
    put(runs, 1, 2)
    run_shards._open.clear()
    put(runs, 2, 3)
    assert len(shards(runs)) == 2 and len(digests_in(runs)) == 3
    index = ShardIndex(runs)
    assert index.read(digest_of(2)) == content_of(2) and len(index) == 3
    assert index.size == sum(len(content_of(number)) for number in (1, 2, 3))


def test_runs_are_looked_up_together(runs):
    put(runs, *range(5))
    near = digest_of(9)[:16] + "0000000a", digest_of(9)[:16] + "00000009"  # equal in their first eight bytes
    append(runs, runs.parent, {digest: b"x" for digest in near}, COMMON)
    index = ShardIndex(runs)
    asked = [digest_of(3), digest_of(7), *near, digest_of(9)[:16] + "0000000b", digest_of(0), "f" * 24]
    rows = index.rows(names_of(asked))
    assert [row >= 0 for row in rows] == [True, False, True, True, False, True, False]
    assert [name.tobytes().hex() for name in index.names(rows[rows >= 0])] == [asked[i] for i in (0, 2, 3, 5)]
    everything = [name.tobytes().hex() for name in index.names(np.arange(len(index)))]
    assert everything == sorted({*near, *map(digest_of, range(5))})
    assert len(index.rows(names_of([]))) == 0 and list(ShardIndex(runs / "none").rows(names_of(asked))) == [-1] * len(asked)


@pytest.mark.parametrize("operation", ["write", "fsync"])
def test_a_full_disk_leaves_the_shard_as_it_was(runs, monkeypatch, operation):
    put(runs, 1)
    before = shards(runs)[0].read_bytes()

    def full(*_words):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        if operation == "fsync":
            patched.setattr(os, "fsync", full)
        else:
            write = run_shards._write

            def half(path, at, content, mode):
                write(path, at, content[: len(content) // 2], mode)
                full()

            patched.setattr(run_shards, "_write", half)
        with pytest.raises(OSError, match="No space"):
            put(runs, 2)
    assert shards(runs)[0].read_bytes() == before
    put(runs, 3)
    assert digests_in(runs) == {digest_of(1), digest_of(3)}


def test_a_scan_goes_on_where_it_was(runs):
    scan, known = ShardScan(runs), KnownRuns(runs)
    assert not list(scan.new_groups()) and not known.among([digest_of(1)])
    seen = []
    for number in range(20):
        if number == 10:
            run_shards._open.clear()
        put(runs, number)
        ((_, _, table),) = scan.new_groups()
        seen.append(len(table))
        assert known.among([digest_of(number), digest_of(number // 2), digest_of(number + 1)]) == {
            digest_of(number),
            digest_of(number // 2),
        }
    assert seen == [2 if number in (0, 10) else 1 for number in range(20)]
    assert len(known._keys) <= 5
    for path in shards(runs):
        path.unlink()
    assert not known.among([digest_of(1)]), "it looks once more before it says that a run is done"


def test_a_million_runs_are_in_ten_thousand_files(runs, monkeypatch):
    """Shards and files of frames, of runs of 12 kB to 5 MB, by 1,000 processes; small sizes show that the rules hold."""
    monkeypatch.setattr(run_shards, "SHARD_BYTES", 300)
    for number in range(40):
        put(runs, number % 10)
    sizes = [path.stat().st_size for path in shards(runs)]
    assert sum(size < 300 for size in sizes) <= 1 and len(sizes) <= 1 + sum(sizes) // 300
    monkeypatch.undo()
    for size in (12e3, 5e6):
        in_shards = 1000 + 1e6 * size / run_shards.SHARD_BYTES
        assert in_shards + MOST_FILES < 10_000


@pytest.fixture
def study(tmp_path):
    """A study of six runs in two groups, and its runs."""
    opened = begin_study(write_study(tmp_path / "study", 6), tmp_path / "study" / "out", lambda *_: None)
    compute(opened, opened.runs[:4], opened.runs[4:])
    return opened


def compute(opened, *batches):
    scenes = Scenes(opened.folder)
    for runs in batches:
        with run_batch(opened.folder) as batch:
            for run in runs:
                compute_run(scenes, run, batch.place)
                batch.add(run.digest)


@pytest.mark.slow("computes a study twice")
def test_a_damaged_run_is_named_and_what_to_do_helps(study):
    publish(study.folder, study.runs)
    before = tree(study.folder / "dataset")
    (path,) = shards(study.folder / RUNS)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(FileError, match=rf"{path.name}' is damaged: delete this file and run the sweep again"):
        publish(study.folder, study.runs)
    assert tree(study.folder / "dataset") == before
    path.unlink()
    assert not done_runs(study.folder)
    compute(study, study.runs)
    publish(study.folder, study.runs)
    assert tree(study.folder / "dataset") == before


def test_runs_with_folders_give_the_same_dataset_and_report(study, tmp_path):
    """A study that was begun when each run had a folder goes on with shards; one that asks for recordings keeps folders."""
    publish(study.folder, study.runs)
    write_report(study.folder, study.runs)
    file = write_study(tmp_path / "other", 6)
    file.write_text(file.read_text().replace("fps = 100", "fps = 100\nrecordings = true"))
    other = begin_study(file, file.parent / "out", lambda *_: None)
    compute(other, other.runs[:3])
    assert len(list((other.folder / RUNS).glob("*/run.json"))) == 3
    frozen = other.folder / "study.toml"
    frozen.write_text(frozen.read_text().replace("recordings = true\n", ""))  # as a version before it was written
    compute(other, other.runs[3:])
    assert done_runs(other.folder) == {run.digest for run in study.runs} and len(shards(other.folder / RUNS)) == 1
    publish(other.folder, other.runs)
    assert tree(other.folder / "dataset") == tree(study.folder / "dataset")
    assert (other.folder / "runs.parquet").read_bytes() == (study.folder / "runs.parquet").read_bytes()


def test_the_order_of_runs_is_that_of_the_design(study):
    """Of runs that are planned and of those that nobody plans now; where a run is twice on the disk, too."""
    order = list(run_order(study.folder, study.runs))
    assert order == [(run.index, run.digest) for run in study.runs]
    run_shards._open.clear()
    compute(study, study.runs[1:3])
    assert len(shards(study.folder / RUNS)) == 2
    for planned in (study.runs, study.runs[::-1], study.runs[2:4], ()):
        assert list(run_order(study.folder, planned)) == order


def write_until_killed(folder, contents: dict, common: dict, tell: int, dice: random.Random) -> None:
    """Do what a worker does: write the runs that are left in groups, and tell which are on the disk."""
    left = sorted(contents.keys() - done_runs(folder))
    dice.shuffle(left)
    while left:
        size = dice.randrange(1, 4)
        group, left = left[:size], left[size:]
        with run_batch(folder) as batch:
            for digest in group:
                (batch.place / f"{digest}.run").write_bytes(contents[digest])
                batch.add(digest)
            for name, content in common.items():
                (batch.place / f"{name}.common").write_bytes(content)
        os.write(tell, "".join(group).encode())


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the test ends forked processes, and this system has no fork")
@pytest.mark.slow("ends a hundred processes")
def test_a_hundred_kills_lose_nothing_that_was_on_the_disk(study):
    """Processes that write end at random file operations, in the middle of a write, too; shards are cut as a power cut may."""
    publish(study.folder, study.runs)
    expected, before = tree(study.folder / "dataset"), run_hashes(study.folder)
    index = ShardIndex(study.folder / RUNS)
    contents, common = {run.digest: index.read(run.digest) for run in study.runs}, index.all_common()
    dice, kills, rounds = random.Random(7), 0, 0
    while kills < 100:
        for path in (study.folder / RUNS).glob("*"):
            path.unlink() if path.is_file() else shutil.rmtree(path)
        rounds += 1
        while len(done_runs(study.folder)) < len(contents):
            kept = done_runs(study.folder)
            code, told = ended_process(study.folder, contents, common, dice)
            kills += code == KILLED
            kept |= told
            make_folders(study.folder)  # as the next command does
            assert kept <= done_runs(study.folder)
            cut_after(study.folder / RUNS, kept, dice)
            assert kept <= done_runs(study.folder)
        assert run_hashes(study.folder) == before
        assert not [path.name for path in (study.folder / RUNS).iterdir() if path.name.startswith(".")]
    publish(study.folder, study.runs)
    assert tree(study.folder / "dataset") == expected
    assert rounds >= 5, "the processes ended before they wrote anything"


def ended_process(folder, contents: dict, common: dict, dice: random.Random) -> tuple[int, set]:
    """Let a process write until it ends at a random file operation; return its exit status, and the runs of which it told."""
    run_shards._open.clear()
    hear, tell = os.pipe()
    at, seed = dice.randrange(1, 60), dice.random()
    process = os.fork()
    if process == 0:
        try:
            with Injector(folder, at, EXIT):
                write_until_killed(folder, contents, common, tell, random.Random(seed))
        finally:
            os._exit(0)
    os.close(tell)
    with open(hear, "rb") as told:
        said = told.read().decode()
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    return code, {said[at : at + 24] for at in range(0, len(said), 24)}


def cut_after(folder, kept: set, dice: random.Random) -> None:
    """Cut one shard somewhere behind the last group that was told to be on the disk, or fill that with zeros."""
    ends = {path: 0 for path in shards(folder)}
    for path, start, table in ShardScan(folder).new_groups():
        if any(row["name"].tobytes().hex() in kept for row in table if row["kind"] == run_shards.RUN):
            ends[path] = start + int(table["length"].sum())
    for path, end in ends.items():
        size = path.stat().st_size
        if end < size and dice.random() < 0.5:
            cut = dice.randrange(end, size)
            os.truncate(path, cut)
            if dice.random() < 0.5:
                os.truncate(path, size)  # with zeros


@pytest.mark.slow("starts the process of a worker")
def test_a_run_that_is_done_is_not_computed_again(study):
    words = [{"index": run.index, "scene": run.scene, "values": run.values, "digest": run.digest} for run in study.runs]
    before = tree(study.folder / RUNS)
    try:
        assert [answer["status"] for answer in compute_batch(str(study.folder), words)] == ["done"] * 6
    finally:
        end_children()
    assert tree(study.folder / RUNS) == before
