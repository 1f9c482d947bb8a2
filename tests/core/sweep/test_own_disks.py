# SPDX-License-Identifier: GPL-3.0-or-later
"""What a worker without the study's folder computes comes back, and is what it would be in the folder."""

import errno
import os
from types import SimpleNamespace

import pytest
from small_study import run_hashes, write_study

from palpate.core.errors import FileError, PalpateError
from palpate.core.study import run_shards
from palpate.core.study.run_files import done_runs, failed_runs, run_batch
from palpate.sweep.child import Scenes, compute_run
from palpate.sweep.study_folder import begin_study
from palpate.sweep.worker import NO_LIMITS, end_children

pytest.importorskip("distributed")
own_disks = pytest.importorskip("palpate.sweep.own_disks")


@pytest.fixture
def opened(tmp_path):
    """A study of which no run is done; some of its runs fail."""
    yield begin_study(write_study(tmp_path, 8, fails=True), tmp_path / "out", lambda *_: None)
    end_children()


def words_of(runs):
    return [{"index": run.index, "scene": run.scene, "values": run.values, "digest": run.digest} for run in runs]


def copy_at(opened, place):
    copy = own_disks.StudyCopy(opened.folder)
    copy.setup(SimpleNamespace(local_directory=str(place)))
    return place / copy.name


@pytest.mark.slow("starts the processes of two workers")
def test_runs_come_back_with_the_same_bytes(opened, tmp_path):
    for number, part in enumerate((opened.runs[:5], opened.runs[5:])):
        folder = copy_at(opened, tmp_path / str(number))
        copy_at(opened, tmp_path / str(number))  # a worker that starts again finds it
        found = own_disks.returned(folder, words_of(part), NO_LIMITS, "refuse")
        assert not list((folder / "runs").glob("*.shard")) and not list((folder / "failed").iterdir())
        own_disks.keep(opened.folder, found)
    failed = failed_runs(opened.folder)
    assert failed and len(failed | done_runs(opened.folder)) == 8
    text = (opened.folder / "failed" / f"{min(failed)}.txt").read_text(encoding="utf-8")
    assert text.startswith("mud of sensor") and text.count("\n") == 1
    there = run_hashes(opened.folder)
    for path in (opened.folder / "runs").glob("*.shard"):
        path.unlink()
    scenes = Scenes(opened.folder)
    with run_batch(opened.folder) as batch:
        for run in opened.runs:
            if run.digest in there:
                compute_run(scenes, run, batch.place)
                batch.add(run.digest)
    assert run_hashes(opened.folder) == there


def test_a_failure_of_before_is_gone_and_a_traceback_is_kept(opened):
    first, second = (run.digest for run in opened.runs[:2])
    own_disks.keep(opened.folder, own_disks.ReturnedBatch([], {}, {}, {first: "A sentence.\n\nTraceback …\n  line\n"}))
    assert (opened.folder / "failed" / f"{first}.txt").read_text(encoding="utf-8") == "A sentence.\n\nTraceback …\n  line\n"
    own_disks.keep(opened.folder, own_disks.ReturnedBatch([], {first: b"a", second: b"b"}, {}, {}))
    assert done_runs(opened.folder) == {first, second} and not failed_runs(opened.folder)


def test_a_full_disk_of_the_driver_is_one_sentence(opened, monkeypatch):
    def full(*_words):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(run_shards, "_write", full)
    with pytest.raises(FileError, match="Runs could not be written to .*give the same command again"):
        own_disks.keep(opened.folder, own_disks.ReturnedBatch([], {opened.runs[0].digest: b"a"}, {}, {}))
    assert not done_runs(opened.folder)


def test_runs_with_folders_do_not_come_back(tmp_path):
    file = write_study(tmp_path, 2)
    file.write_text(file.read_text().replace("fps = 100", "fps = 100\nrecordings = true"))
    opened = begin_study(file, tmp_path / "out", lambda *_: None)
    with pytest.raises(PalpateError, match="leave images, recordings and job out, or give"):
        own_disks.StudyCopy(opened.folder)
