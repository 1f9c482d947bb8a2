# SPDX-License-Identifier: GPL-3.0-or-later
"""What limits large studies: the driver's memory and time, files per folder, the scheduler, and the memory of a worker.

Finished runs are played: the shards of a driver that goes on, in which one short run stands under many names. Each figure
is per run, to be multiplied; what does not grow is measured with few and with many runs. Batches are played, too: a worker
answers at once, so that what is left is the driver and the scheduler.
"""

from __future__ import annotations

import functools
import gc
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any
from unittest import mock

from palpate.core.study.run_files import RUNS, done_runs, run_batch
from palpate.core.study.run_shards import append
from palpate.core.study.study_file import Run
from palpate.sweep.child import DONE, Scenes
from palpate.sweep.dataset import publish
from palpate.sweep.encoded_run import layout_name, pack_layout, pack_run
from palpate.sweep.finished_runs import StoredRuns, run_order
from palpate.sweep.report import write_report
from palpate.sweep.run_table import write_run_table
from palpate.sweep.worker import Child, Limits

from .sweep import LENGTHS, begun, computed

PLAYED = 100_000
"""Finished runs that are played."""
GROUP = 200
"""Of them that stand in a group: as many short runs as a worker computes in two seconds."""
TASKS = 2_000
"""Empty tasks that the scheduler passes on, and batches that the driver gives out."""
WORKERS = 16
"""Workers to which batches are given, as on a larger machine."""
WORKED, WARM = 10_000, 1_000
"""Runs that a worker computes, and after how many of them its memory is measured first."""


def resident(process: int | str = "self", word: str = "VmRSS") -> int:
    """Return the bytes of memory that a process has, or had at most (word VmHWM); Linux."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(f"{word}:"))


def measured(work: Callable[[], object]) -> tuple[float, int]:
    """Return the seconds of the processor that work takes, and the bytes by which this process grows meanwhile at most."""
    gc.collect()
    Path("/proc/self/clear_refs").write_text("5")  # the most from now on
    before, start = resident(), time.process_time()
    work()
    return time.process_time() - start, resident(word="VmHWM") - before


def play_finished(folder: Path, runs: list[Run]) -> None:
    """Write the shards of finished runs, all with the frames of the first one."""
    computed(Scenes(folder), [replace(runs[0], index=len(runs), digest="f" * 24)])
    numbers, frames = StoredRuns(folder).run("f" * 24)
    for path in (folder / RUNS).iterdir():
        path.unlink()
    common = {layout_name(frames.layout): pack_layout(frames.layout)}
    for at in range(0, len(runs), GROUP):
        group = {
            run.digest: pack_run(replace(numbers, digest=run.digest, index=run.index, values=dict(run.values)), frames)
            for run in runs[at : at + GROUP]
        }
        append(folder / RUNS, folder, group, common)


def driver() -> Iterator[dict]:
    """Time and memory of what a driver does with all runs of a study, and how many files there are then."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        plans: list[list[Run]] = []
        planning = measured(lambda: plans.append(begun(folder, LENGTHS["50_ms"], PLAYED)))
        play_finished(folder, plans[0])
        works: dict[str, Callable[[], object]] = {
            "looking": lambda: done_runs(folder),
            "ordering": lambda: run_order(folder, plans[0]),
            "table": lambda: write_run_table(folder, run_order(folder, plans[0]), []),
            "dataset": lambda: publish(folder, plans[0]),
            "report": lambda: write_report(folder, plans[0]),
        }
        taken = {"planning": planning} | {name: measured(work) for name, work in works.items()}
        files = [path for path in folder.rglob("*") if path.is_file()]
        size = sum(path.stat().st_size for path in files)
    for name, (seconds, grown) in taken.items():
        yield {"name": f"sweep_scale.{name}.time", "value": seconds / PLAYED * 1e6, "unit": "µs per run"}
        yield {"name": f"sweep_scale.{name}.memory", "value": max(0, grown) / PLAYED, "unit": "bytes per run"}
    yield {"name": "sweep_scale.files", "value": len(files), "unit": f"files of {PLAYED} runs", "goal": 0.01 * PLAYED}
    yield {"name": "sweep_scale.disk", "value": size / PLAYED, "unit": "bytes per run"}


def flat_memory() -> Iterator[dict]:
    """By how much the memory of a process grows that publishes few runs, and a hundred times as many."""
    grown = {}
    for count in (PLAYED // 100, PLAYED):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            runs = begun(folder, LENGTHS["50_ms"], count)
            play_finished(folder, runs)
            publish(folder, runs[:1])  # loads what is loaded once
            grown[count] = measured(functools.partial(publish, folder, runs))[1]
    few, many = grown.values()
    yield {
        "name": "sweep_scale.dataset_memory", "value": many / 1e6, "unit": "MB",
        "peer": f"{PLAYED // 100} runs", "peer_value": few / 1e6, "ratio": many / max(few, 1),
    }  # fmt: skip


def _empty(number: int) -> int:
    return number


def _played_batch(_folder: str, runs: Sequence[dict[str, Any]], *_rest: object) -> list[dict[str, Any]]:
    return [{"digest": run["digest"], "status": DONE, "seconds": 0.0} for run in runs]


def scheduler() -> Iterator[dict]:
    """Tasks that a scheduler on this machine passes to a worker and back, in a second; a batch of a study is one task."""
    from palpate.sweep import driver

    with driver.dask_client(None, 1) as client:
        client.gather(client.map(_empty, range(10), pure=False))
        start = time.perf_counter()
        client.gather(client.map(_empty, range(TASKS), pure=False))
        seconds = time.perf_counter() - start
    yield {"name": "sweep_scale.scheduler", "value": TASKS / seconds, "unit": "tasks/s"}
    runs = [Run(i, "pad", {"press.depth": 1e-3}, f"{i:024x}") for i in range(TASKS)]
    with driver.dask_client(None, WORKERS) as client, mock.patch.object(driver, "compute_batch", _played_batch):
        client.wait_for_workers(WORKERS)
        driver.run_study(client, Path(), runs[:WORKERS], Limits(), lambda tally: None)
        start, used = time.perf_counter(), time.process_time()
        driver.run_study(client, Path(), runs, Limits(), lambda tally: None)  # at once, so batches stay at one run
        seconds, used = time.perf_counter() - start, time.process_time() - used
    yield {"name": f"sweep_scale.batches.{WORKERS}_workers", "value": TASKS / seconds, "unit": "batches/s"}
    yield {"name": f"sweep_scale.driver.{WORKERS}_workers", "value": used / TASKS * 1e3, "unit": "CPU ms per batch"}


def worker_memory() -> Iterator[dict]:
    """By how much a process that computes runs grows from its first thousand to its ten thousandth run."""
    with tempfile.TemporaryDirectory() as place:
        runs = begun(Path(place), LENGTHS["50_ms"], WORKED)
        Child(place).kill()  # compiles the solver where nothing has yet, which takes memory of its own
        child = Child(place)
        sizes = []
        try:
            for number, run in enumerate(runs, 1):
                with run_batch(Path(place)) as batch:
                    answer = child.compute(asdict(run), batch.place)
                    if answer is None or answer["status"] != "done":
                        raise RuntimeError(f"run {number} is not done: {answer}")
                    batch.add(run.digest)
                if number in (WARM, WORKED):
                    sizes.append(resident(str(child.process_id)))
        finally:
            child.kill()
    first, last = (size / 1e6 for size in sizes)
    yield {
        "name": "sweep_scale.worker_memory", "value": last, "unit": "MB",
        "peer": f"after {WARM} runs", "peer_value": first, "ratio": last / first, "goal": 1.05,
    }  # fmt: skip


def run() -> Iterator[dict]:
    """Driver, memory, scheduler and worker."""
    yield from driver()
    yield from flat_memory()
    yield from scheduler()
    yield from worker_memory()
