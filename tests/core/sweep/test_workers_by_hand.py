# SPDX-License-Identifier: GPL-3.0-or-later
"""A scheduler and two workers that were started by hand, as docs/sweep.md says: one joins late, and one is killed."""

import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from small_study import run_hashes
from study_scenes import HEAD, tiny_scene

from palpate.core.io.scenario_npz import save_scenario
from palpate.core.study.run_files import done_runs
from palpate.sweep.finished_runs import StoredRuns
from palpate.sweep.study_folder import begin_study
from palpate.sweep.worker import compute_batch, end_children

pytest.importorskip("distributed")
psutil = pytest.importorskip("psutil")
parquet = pytest.importorskip("pyarrow.parquet")

RUNS = 1200
"""Of some 20 ms of the processor each: one worker alone is at work for longer than a second one takes to start."""
STUDY = f"""{HEAD}design = "random"
samples = {RUNS}
seed = 3
fps = 200
[press]
depth = {{ uniform = [0.5e-3, 2e-3] }}
speed = 2e-3
"""
LONGEST = 300.0
"""Seconds until a wait counts as hanging; a busy machine may have to compile the solver first."""


def processes_of(process: subprocess.Popen) -> list:
    """The process and all that it has started, the last ones first."""
    with suppress(psutil.Error):
        own = psutil.Process(process.pid)
        return [*reversed(own.children(recursive=True)), own]
    return []


@contextmanager
def started(*words: str) -> Iterator[subprocess.Popen]:
    """A process that is killed with all that it has started when the body ends."""
    process = subprocess.Popen(
        [sys.executable, "-m", *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        yield process
    finally:
        lose(process)
        process.communicate()


def lose(process: subprocess.Popen) -> None:
    """Kill a process and all that it has started, as if its machine was gone."""
    for one in processes_of(process):
        with suppress(psutil.Error):
            one.kill()


def until(condition: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + LONGEST
    while not condition():
        assert time.monotonic() < end, f"{what} takes longer than {LONGEST:.0f} s"
        time.sleep(0.02)


def is_computing(worker: subprocess.Popen) -> bool:
    """Whether a worker has a process for runs, which it starts with the first batch that it gets."""
    for process in processes_of(worker):
        with suppress(psutil.Error):
            if "palpate.sweep.child" in process.cmdline():
                return True
    return False


@pytest.fixture
def address() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{probe.getsockname()[1]}"


@pytest.mark.long("kills a worker of a study")
def test_one_worker_joins_late_and_one_is_lost(tmp_path: Path, address: str):
    save_scenario(tmp_path / "tiny.npz", tiny_scene())
    study, out = tmp_path / "study.toml", tmp_path / "out"
    study.write_text(STUDY, encoding="utf-8")
    port = address.rpartition(":")[2]
    scheduler = ("dask", "scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")
    worker = ("dask", "worker", address, "--nworkers", "1", "--nthreads", "1", "--no-dashboard", "--local-directory")
    command = ("palpate.commands", "sweep", str(study), "--out", str(out), "--scheduler", address)
    with started(*scheduler), started(*worker, str(tmp_path / "first")) as first, started(*command) as driver:
        until(lambda: len(done_runs(out)) >= 5 or driver.poll() is not None, "the first worker")
        with started(*worker, str(tmp_path / "late")) as late:
            until(lambda: is_computing(late) or driver.poll() is not None, "the late worker")
            assert driver.poll() is None, "the study was over before the late worker began: give it more runs"
            lose(first)
            left = RUNS - len(done_runs(out))
            said = driver.communicate(timeout=LONGEST)[0]
            assert is_computing(late)  # its process waits for the next study
    assert driver.returncode == 0, said
    assert f"{RUNS} runs: {RUNS} done, 0 failed, 0 left" in said
    assert left > 0, "the first worker was lost after the last run: give the study more runs"
    table = parquet.read_table(out / "runs.parquet").to_pydict()
    assert table["run"] == list(range(RUNS))
    assert parquet.read_metadata(out / "dataset" / "meta" / "tasks.parquet").num_rows == 1
    assert_like_here(study, tmp_path / "here", table, every=40)
    print(f"{RUNS} runs, {left} of them after one of two workers was lost")


@pytest.mark.long("two workers with disks of their own, one of which is killed")
def test_runs_come_back_from_workers_with_disks_of_their_own(tmp_path: Path, address: str):
    """Each computes in a copy of the study of its own, and only the driver writes into the study's folder."""
    save_scenario(tmp_path / "tiny.npz", tiny_scene())
    study, out = tmp_path / "study.toml", tmp_path / "out"
    failing = STUDY.replace("[press]", '[vary]\n"Pad.mud" = { choice = [0.2, 0.25, 2.0] }\n[press]')
    study.write_text(failing, encoding="utf-8")
    port = address.rpartition(":")[2]
    scheduler = ("dask", "scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")
    worker = ("dask", "worker", address, "--nworkers", "1", "--nthreads", "1", "--no-dashboard", "--local-directory")
    command = ("palpate.commands", "sweep", str(study), "--out", str(out), "--scheduler", address, "--own-disks")
    with (
        started(*scheduler),
        started(*worker, str(tmp_path / "first")) as first,
        started(*worker, str(tmp_path / "second")) as second,
        started(*command) as driver,
    ):
        until(lambda: len(done_runs(out)) >= 5 or driver.poll() is not None, "the first worker")
        copies = [path for path in tmp_path.glob("*/**/palpate-study-*") if path.is_dir()]
        lose(first)
        said = driver.communicate(timeout=LONGEST)[0]
        assert is_computing(second)
    assert driver.returncode == 0, said
    table = parquet.read_table(out / "runs.parquet").to_pydict()
    assert sorted(table["run"]) == list(range(RUNS))
    failed = [status == "failed" for status in table["status"]]
    assert 0.2 * RUNS < sum(failed) < 0.5 * RUNS
    assert all(("mud of sensor" in text) == is_failed for text, is_failed in zip(table["message"], failed, strict=True))
    assert len(copies) == 2 and {path.relative_to(tmp_path).parts[0] for path in copies} == {"first", "second"}
    assert len(list((out / "runs").glob("*.shard"))) == 1, "the driver alone writes into the folder of the study"
    opened = begin_study(study, tmp_path / "here", lambda blend, target: None)
    words = [{"index": r.index, "scene": r.scene, "values": dict(r.values), "digest": r.digest} for r in opened.runs[::20]]
    try:
        compute_batch(str(opened.folder), words)
    finally:
        end_children()
    here, there = run_hashes(opened.folder), run_hashes(out)
    assert here.items() <= there.items() and len(here) >= 4


def assert_like_here(study: Path, folder: Path, table: dict, every: int) -> None:
    """Some runs, computed in this process' own way, have the same values and metrics."""
    opened = begin_study(study, folder, lambda blend, target: None)
    chosen = opened.runs[::every]
    words = [{"index": r.index, "scene": r.scene, "values": dict(r.values), "digest": r.digest} for r in chosen]
    try:
        assert {answer["status"] for answer in compute_batch(str(folder), words)} == {"done"}
    finally:
        end_children()
    for run in chosen:
        record = StoredRuns(folder).record(run.digest)
        assert record.digest == table["digest"][run.index]
        for name, value in record.metrics.items():
            assert table[f"metric.{name}"][run.index] == value, (run.index, name)
