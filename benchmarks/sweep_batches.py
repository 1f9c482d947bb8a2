# SPDX-License-Identifier: GPL-3.0-or-later
"""Throughput of a study over the size of its batches and the number of its workers.

``python -m benchmarks sweep_batches --picture FILE`` also draws it. A batch is one task of Dask, and its runs are brought onto
the disk together. Runs per second of the processor count all processes: workers, processes for runs, driver and scheduler.
Runs per second of the clock also count what waits; they say little on a machine that others use.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

from palpate.core.study.study_file import Run
from palpate.sweep import driver
from palpate.sweep.worker import Limits

from .sweep import begun, processor_seconds

SIZES, WORKERS = (1, 3, 10, 30, 100), (1, 2)
RUNS = 600
"""In each measurement."""
HOLD = 0.55
"""Rest after the press, s: runs of 60 frames."""


def measured() -> Iterator[tuple[int, int, float, float]]:
    """Yield workers, size of the batches, and runs per second of the clock and of the processor."""
    for workers in WORKERS:
        with tempfile.TemporaryDirectory() as place, driver.dask_client(None, workers) as client:
            folder = Path(place)
            runs = begun(folder, HOLD, RUNS * len(SIZES))
            warm = [replace(runs[0], index=len(runs) + number, digest=f"f{number:023x}") for number in range(4 * workers)]
            driver.run_study(client, folder, warm, Limits(), lambda tally: None)
            for number, size in enumerate(SIZES):
                part = runs[number * RUNS : (number + 1) * RUNS]
                yield workers, size, *throughput(client, folder, part, size)


def throughput(client: Any, folder: Path, runs: Sequence[Run], size: int) -> tuple[float, float]:
    """Return runs per second of the clock, and of the processor."""
    began, before = time.perf_counter(), processor_seconds()
    with mock.patch.multiple(driver, LARGEST_BATCH=size, BATCH_SECONDS=1e9, FIRST_BATCH=size):
        driver.run_study(client, folder, runs, Limits(), lambda tally: None)
    return len(runs) / (time.perf_counter() - began), len(runs) / (processor_seconds() - before)


def rows_of(workers: int, size: int, clock: float, processor: float) -> list[dict]:
    """Return the figures of one measurement."""
    name = f"sweep_batches.{workers}_workers.{size}_runs"
    return [
        {"name": f"{name}.clock", "value": clock, "unit": "runs/s"},
        {"name": f"{name}.processor", "value": processor, "unit": "runs/CPU s"},
    ]


def run() -> Iterator[dict]:
    """Throughput for each size and number of workers."""
    for found in measured():
        yield from rows_of(*found)


def draw(path: Path, found: Sequence[tuple[int, int, float, float]]) -> None:
    """Draw throughput over the size of a batch, a line for each number of workers."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    titles = ("runs per second of the processor, all processes", "runs per second of the clock")
    for axes, title, column in zip(figure.subplots(1, 2), titles, (3, 2), strict=True):
        for workers in WORKERS:
            own = [one for one in found if one[0] == workers]
            label = f"{workers} worker" + ("s" if workers > 1 else "")
            axes.plot([one[1] for one in own], [one[column] for one in own], "o-", label=label)
        axes.set_xscale("log")
        axes.set_xticks(SIZES, [str(size) for size in SIZES])
        axes.minorticks_off()
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("runs in a batch")
        axes.set_title(title, fontsize=10)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=9)
    figure.savefig(path, dpi=110)


def command(words: Sequence[str]) -> int:
    """Measure, print, and draw."""
    import json

    parser = argparse.ArgumentParser(prog="python -m benchmarks sweep_batches")
    parser.add_argument("--picture", metavar="FILE", type=Path, required=True)
    path = parser.parse_args(words).picture
    found = list(measured())
    for one in found:
        for row in rows_of(*one):
            print(json.dumps(row))
    draw(path, found)
    return 0
