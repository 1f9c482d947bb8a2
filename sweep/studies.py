# SPDX-License-Identifier: GPL-3.0-or-later
"""Compute the runs of a study, write its dataset and report, or tell how long that takes: what a command and a script call."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..core.compiled.thread_team import count_of_cores
from ..core.errors import FileError, PalpateError
from ..core.io.file_writing import writable_folder
from ..core.io.hidden_folder import PRIVATE_FOLDER, lock_folder
from ..core.jobs import Progress
from ..core.study.study_file import PARTS, RUNS, SCENES, STUDY_NAME, read_study
from . import driver
from .dataset import DATASET_FOLDER, publish
from .parts import Parts, remove_unfinished_parts
from .scripts import REFUSE, require_allowed
from .study_folder import OpenStudy, frozen_of, open_study
from .worker import BatchResult, compute_batch

RUNS_TRIED, QUICK_RUNS, QUICK_SECONDS = 5, 50, 0.5
"""Runs that are computed, and so many where those take no longer than half a second."""
FIXED_SECONDS = 7.0
"""Until the workers of a machine have loaded Python, the solver and Dask, and for the report."""


@dataclass(frozen=True)
class Status:
    """Counts of the runs of a study."""

    total: int
    done: int
    failed: int

    def __str__(self) -> str:
        left = self.total - self.done - self.failed
        return f"{self.total} runs: {self.done} done, {self.failed} failed, {left} left"


def status_of(folder: Path) -> Status:
    """Return how far the study in a folder is, from its files alone: no scheduler is asked, and the study may be running.

    Raises
    ------
    FileError
        There is no study in it.
    """
    if not (folder / STUDY_NAME).is_file():
        raise FileError(f"There is no study in '{folder}': give the folder that a study was run in.")
    parts = Parts(folder)
    return Status(frozen_of(read_study(folder / STUDY_NAME), folder).runs, len(parts.done), len(parts.failed))


def output_folder(place: Path, out: Path | str | None) -> Path:
    """Return the absolute output folder of a study's file, or of the folder in which it goes on."""
    if place.is_dir():
        if out is not None:
            raise PalpateError(f"'{place}' is a folder, in which its study goes on: leave --out away, or give a study's file.")
        return place.absolute()
    return (Path(out) if out is not None else place.with_suffix("")).absolute()  # as every machine has to see it


@contextmanager
def locked_folder(place: Path, folder: Path) -> Iterator[None]:
    """Hold a study's folder, which is made where it is missing, and removed again if the study was refused."""
    is_new = not folder.exists()
    lock = lock_folder(writable_folder(folder, create=not place.is_dir()), "sweep")
    try:
        yield
    finally:
        lock.release()
        if is_new and [path.name for path in folder.iterdir()] == [PRIVATE_FOLDER]:
            shutil.rmtree(folder, ignore_errors=True)


def compute_runs(
    opened: OpenStudy,
    show: Callable[[Progress], object],
    workers: int | None = None,
    retry_failed: bool = False,
    part: tuple[int, int] = (1, 1),
    **cluster: Any,
) -> list[tuple[int, str]]:
    """Compute the runs that are left, and return the indices and sentences of those that failed now.

    Parameters
    ----------
    opened : OpenStudy
    show : callable
        Called with the progress, and may raise to stop; what is done is kept.
    workers : int, optional
        Processes on this machine. Default: one for each core.
    retry_failed : bool
        Compute failed runs again.
    part : (int, int)
        Number and count: which of so many parts of the runs is computed.
    **cluster
        `scheduler` or `make_cluster` of :func:`.driver.dask_client`.
    """
    (number, count), total = part, len(opened.runs)
    indices = np.arange(total * (number - 1) // count, total * number // count)
    parts = Parts(opened.folder)
    left = np.setdiff1d(indices, parts.done if retry_failed else np.concatenate([parts.done, parts.failed]))
    if not len(left):
        return []
    require_allowed(opened.study, opened.scripts)

    def show_tally(tally: BatchResult) -> None:
        stage = f"sweep, failed={tally.failed}" if tally.failed else "sweep"
        show(Progress(stage, len(indices) - len(left) + tally.done + tally.failed, len(indices)))

    show_tally(BatchResult())
    workers = min(workers or count_of_cores(), len(left))
    with driver.dask_client(workers=workers, memory=opened.study.run_memory, **cluster) as client:
        return driver.Dispatch(client, opened, show_tally).run(left).failures


def write_results(opened: OpenStudy, formats: Sequence[str] = ()) -> tuple[Status, list[Path]]:
    """Write dataset, report and exports of a study if runs are done; return how far it is, and the exported files.

    Each file is written whole or not at all.
    """
    from .exports import EXPORTS
    from .report import write_report

    found, written = status_of(opened.folder), list[Path]()
    remove_unfinished_parts(opened.folder)
    if found.done:
        publish(opened.folder, opened.study)
        written = [path for kind in dict.fromkeys(formats) for path in EXPORTS[kind](opened.folder)]
        write_report(opened.folder, opened.study)
    return found, written


@dataclass(frozen=True)
class Estimate:
    """Time and memory of a study.

    Attributes
    ----------
    seconds, closing : float
        Of one run in one process, and of adding it to the dataset.
    size : float
        Bytes of one run.
    failures : list of str
        Sentences of the runs that failed.
    tried : int
        Number of runs that were computed.
    """

    seconds: float
    closing: float
    size: float
    failures: list[str]
    tried: int

    def seconds_of(self, runs: int, workers: int) -> float:
        """Return the seconds of a study from the command to the report."""
        return FIXED_SECONDS + self.seconds * runs / min(workers, runs) + self.closing * runs


def try_study(place: Path, scripts: str = REFUSE) -> tuple[OpenStudy, Estimate]:
    """Compute some runs, spread over a study, in a folder that is removed; parameters as of :func:`.open_study`."""
    with tempfile.TemporaryDirectory(prefix="palpate-sweep-") as name:
        trial = Path(name)
        if place.is_dir():
            (trial / PARTS).mkdir()
            shutil.copy(place / STUDY_NAME, trial)
            shutil.copytree(place / SCENES, trial / SCENES)
        opened = open_study(trial if place.is_dir() else place, trial, scripts)
        total, limit = len(opened.runs), opened.study.run_limit
        compute_batch([0], name, scripts, limit)  # the first run loads what was compiled
        one = _seconds_of(lambda: publish(trial, opened.study))
        for count in (RUNS_TRIED, QUICK_RUNS):
            tried = range(total)[:: max(1, total // count)][:count]
            found = compute_batch(tried, name, scripts, limit)
            if found.seconds >= QUICK_SECONDS:
                break
        closing = max(0.0, _seconds_of(lambda: publish(trial, opened.study)) - one) / len(tried)
        written = sum(path.stat().st_size for place in (PARTS, RUNS, DATASET_FOLDER) for path in (trial / place).rglob("*"))
    failures = [sentence for _, sentence in found.failures]
    return opened, Estimate(found.seconds / len(tried), closing, written / max(1, found.done), failures, len(tried))


def _seconds_of(work: Callable[[], object]) -> float:
    """Return the seconds of the processor that work takes: what other programs take would be multiplied by the runs."""
    began = time.process_time()
    work()
    return time.process_time() - began
