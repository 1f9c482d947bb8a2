# SPDX-License-Identifier: GPL-3.0-or-later
"""What limits large studies: the driver's memory and time, files per folder, the scheduler, and the memory of a worker.

Finished runs are played: a folder with its ``run.json``, as many as a driver has to look through when it goes on. Each figure
is per run, to be multiplied.
"""

from __future__ import annotations

import gc
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

from palpate.core.study.run_files import RUNS, done_runs
from palpate.core.study.run_record import RUN_FORMAT, RUN_NAME
from palpate.core.study.study_file import Run
from palpate.sweep.finished_runs import run_order
from palpate.sweep.run_table import write_run_table
from palpate.sweep.worker import Child

from .sweep import LENGTHS, begun

PLAYED = 100_000
"""Finished runs that are played."""
TASKS = 2_000
"""Empty tasks that the scheduler passes on."""
WORKED, WARM = 10_000, 1_000
"""Runs that a worker computes, and after how many of them its memory is measured first."""


def resident(process: int | str = "self") -> int:
    """Return the bytes of memory that a process has (Linux)."""
    return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def measured(work: Callable[[], object]) -> tuple[float, int]:
    """Return the seconds of the processor that work takes, and the bytes by which this process has grown with its result."""
    gc.collect()
    before, start = resident(), time.process_time()
    kept = work()
    taken = time.process_time() - start, resident() - before
    del kept
    return taken


def play_finished(folder: Path, runs: list[Run]) -> None:
    """Write what a driver reads of finished runs."""
    for run in runs:
        place = folder / RUNS / run.digest
        place.mkdir()
        metrics = {f"metric_{i}": 0.1 * i for i in range(12)}
        about = {"values": dict(run.values), "metrics": metrics, "seconds": 0.004, "frames": 6, "sensors": ["pad"]}
        words = {"format": RUN_FORMAT, "digest": run.digest, "index": run.index, **about}
        (place / RUN_NAME).write_text(json.dumps(words), encoding="utf-8")


def driver() -> Iterator[dict]:
    """Time and memory of what a driver does with all runs of a study."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        plans: list[list[Run]] = []
        planning = measured(lambda: plans.append(begun(folder, LENGTHS["50_ms"], PLAYED)))
        play_finished(folder, plans[0])
        works: dict[str, Callable[[], object]] = {
            "looking": lambda: done_runs(folder),
            "ordering": lambda: run_order(folder, plans[0]),
            "table": lambda: write_run_table(folder, run_order(folder, plans[0]), []),
        }
        taken = {"planning": planning} | {name: measured(work) for name, work in works.items()}
    for name, (seconds, grown) in taken.items():
        yield {"name": f"sweep_scale.{name}.time", "value": seconds / PLAYED * 1e6, "unit": "µs per run"}
        yield {"name": f"sweep_scale.{name}.memory", "value": max(0, grown) / PLAYED, "unit": "bytes per run"}


def _empty(number: int) -> int:
    return number


def scheduler() -> Iterator[dict]:
    """Tasks that a scheduler on this machine passes to a worker and back, in a second; a batch of a study is one task."""
    from palpate.sweep.driver import dask_client

    with dask_client(None, 1) as client:
        client.gather(client.map(_empty, range(10), pure=False))
        start = time.perf_counter()
        client.gather(client.map(_empty, range(TASKS), pure=False))
        seconds = time.perf_counter() - start
    yield {"name": "sweep_scale.scheduler", "value": TASKS / seconds, "unit": "tasks/s"}


def worker_memory() -> Iterator[dict]:
    """By how much a process that computes runs grows from its first thousand to its ten thousandth run."""
    with tempfile.TemporaryDirectory() as place:
        runs = begun(Path(place), LENGTHS["50_ms"], WORKED)
        child = Child(place)
        sizes = []
        try:
            for number, run in enumerate(runs, 1):
                answer = child.compute(asdict(run), None)
                if answer is None or answer["status"] != "done":
                    raise RuntimeError(f"run {number} is not done: {answer}")
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
    """Driver, scheduler and worker."""
    yield from driver()
    yield from scheduler()
    yield from worker_memory()
