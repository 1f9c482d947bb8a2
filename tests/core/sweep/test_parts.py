# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts: each run is what it would be alone, a part is there whole or not, and one that is damaged is named."""

import errno
import os
import random
import threading
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import pytest
from sample_bake import round_texels
from small_study import FAILING, begun, rows_of, tree, write_study
from sweep_runs import failed, made_up, new_study

from palpate.core.errors import FileError
from palpate.core.study.study_file import counted_runs, part_files
from palpate.sweep import worker
from palpate.sweep.dataset import publish
from palpate.sweep.parts import Parts, remove_unfinished_parts, write_part
from palpate.sweep.worker import compute_batch

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")
SPREAD = '"Pad.k" = { log-uniform = [20, 2000] }\n"Pad.unit" = { choice = ["N", "V"] }'


@pytest.mark.slow("computes a study in four orders")
def test_a_run_is_the_same_in_any_batch(tmp_path):
    """One by one in threads that know nothing of each other, and then in random orders and batches of random sizes."""
    opened = [begun(write_study(tmp_path / str(number), 7, more=SPREAD)) for number in range(4)]
    for index in range(7):
        with ThreadPoolExecutor(1) as thread:
            thread.submit(compute_batch, [index], str(opened[0].folder)).result()
    for seed, one in enumerate(opened[1:]):
        dice = random.Random(seed)
        order = dice.sample(range(7), 7)
        for begin, end in pairwise(sorted({0, 7, *(dice.randrange(7) for _ in range(dice.randrange(5)))})):
            compute_batch(order[begin:end], str(one.folder))
    for one in opened:
        publish(one.folder, one.study)
        assert rows_of(one.folder) == rows_of(opened[0].folder)
        assert tree(one.folder / "dataset") == tree(opened[0].folder / "dataset")
    assert Parts(opened[0].folder).done.tolist() == list(range(7))


def test_a_run_that_fails_leaves_the_others_alone(tmp_path):
    opened = begun(write_study(tmp_path, 9, fails=True))
    found = compute_batch(range(9), str(opened.folder))
    lost = [index for index, _ in found.failures]
    assert 0 < len(lost) < 9 and (found.done, found.failed) == (9 - len(lost), len(lost))
    assert all("is larger than mus" in sentence and "\n" not in sentence for _, sentence in found.failures)
    parts = Parts(opened.folder)
    assert parts.failed.tolist() == lost and counted_runs(opened.folder) == (found.done, found.failed)
    assert FAILING.split()[0].strip('"') == "Pad.mud"


@pytest.mark.slow("computes until its limit of a second")
def test_a_run_that_never_ends_is_ended_between_frames(tmp_path):
    opened = begun(write_study(tmp_path, 2, hold=1e7))  # frames for hours
    found = compute_batch([0], str(opened.folder), limit=1.0)
    assert found.failures == [(0, "Run 0 was ended after its limit of 1 s: raise run_limit, or vary less widely.")]


def test_a_batch_of_large_runs_becomes_several_parts(tmp_path, monkeypatch):
    monkeypatch.setattr(worker, "PART_BYTES", 1)
    opened = begun(write_study(tmp_path, 3))
    compute_batch(range(3), str(opened.folder))
    assert len(part_files(opened.folder)) == 3 and Parts(opened.folder).done.tolist() == [0, 1, 2]


def test_threads_of_one_worker_have_scenes_of_their_own(tmp_path):
    opened = begun(write_study(tmp_path, 6))
    barrier = threading.Barrier(2)

    def compute(indices):
        barrier.wait()
        return compute_batch(indices, str(opened.folder)).done

    with ThreadPoolExecutor(2) as threads:
        assert list(threads.map(compute, [[0, 1, 2], [3, 4, 5]])) == [3, 3]
    expected = begun(write_study(tmp_path / "again", 6))
    compute_batch(range(6), str(expected.folder))
    assert rows_of(opened.folder) == rows_of(expected.folder)


def test_of_a_run_that_is_there_twice_the_one_that_is_done_counts(tmp_path):
    study = new_study(tmp_path / "study")
    write_part(study, [failed(0, "First."), made_up(1, {"mass": 1.0})])
    write_part(study, [made_up(0, {"mass": 0.0})])
    write_part(study, [failed(1, "Later."), failed(2, "Alone.")])
    parts = Parts(study)
    assert (parts.done.tolist(), parts.failed.tolist()) == ([0, 1], [2])
    assert [row["message"] for row in rows_of(study)] == ["", "", "Alone."]


def test_equal_batches_replace_each_other(tmp_path):
    study = new_study(tmp_path / "study")
    for _ in range(2):
        write_part(study, [made_up(1, {"mass": 1.0})])
    assert len(part_files(study)) == 1


def test_runs_of_other_sensors_are_in_parts_of_their_own(tmp_path):
    study = new_study(tmp_path / "study")
    write_part(study, [made_up(0, {"mass": 0.0})])
    write_part(study, [made_up(1, {"mass": 1.0}, {"cap": round_texels()}), failed(2, "It failed.")])
    layouts = [Parts(study).layout(Parts(study).run(index)) for index in (0, 1)]
    assert [list(layout.texels) for layout in layouts] == [["pad"], ["cap"]]


@pytest.mark.parametrize("damage", ["cut", "version", "layout"])
def test_what_is_damaged_is_named(tmp_path, damage):
    study = new_study(tmp_path / "study")
    write_part(study, [made_up(0, {"mass": 0.0})])
    (path,) = part_files(study)
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:-20])
    elif damage == "version":
        parquet.write_table(parquet.read_table(path).replace_schema_metadata({"palpate": "palpate-parts/0"}), path)
    else:
        (path,) = (study / "layouts").glob("*/features.json")
        path.write_text("{")
    with pytest.raises(FileError, match=path.name) as raised:
        Parts(study).layout(Parts(study).run(0))
    assert "\n" not in str(raised.value)


def test_a_full_disk_is_one_sentence_and_no_run_is_done(tmp_path, monkeypatch):
    study = new_study(tmp_path / "study")

    def full(*_words, **_more):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(parquet, "write_table", full)
    with pytest.raises(FileError, match="no space left on device.*free some space"):
        write_part(study, [made_up(0, {"mass": 0.0})])
    assert not list((study / "parts").iterdir())


def test_what_a_killed_process_was_writing_counts_for_nothing_and_goes(tmp_path):
    study = new_study(tmp_path / "study")
    write_part(study, [made_up(0, {"mass": 0.0})])
    (path,) = part_files(study)
    half = path.with_name(f".{path.stem}.01234567.partial.parquet")
    half.write_bytes(path.read_bytes()[:40])
    assert part_files(study) == [path] and counted_runs(study) == (1, 0)
    remove_unfinished_parts(study)
    assert list((study / "parts").iterdir()) == [path]
