# SPDX-License-Identifier: GPL-3.0-or-later
"""A few runs of a study in a temporary folder, to tell how long all of them take and how much they write."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from ..core.study.run_files import RUNS, SCENES, STUDY_NAME, done_runs, make_folders
from ..core.study.study_file import Run
from .driver import dask_client
from .scene_evaluation import REFUSE
from .worker import Limits, compute_batch, end_children

RUNS_TRIED, QUICK_RUNS, QUICK_SECONDS = 5, 50, 0.5
"""Runs that are computed, and so many where that takes no longer than half a second: what the dataset takes for each of five
short ones is lost in the noise."""


@dataclass(frozen=True)
class Estimate:
    """What a study takes.

    Attributes
    ----------
    seconds : float
        Of one run in one process.
    size : float
        Bytes of one run.
    failures : list of str
        Sentences of the runs that failed.
    tried : int
        Number of runs that were computed.
    start : float
        Seconds until the workers and their processes can take a run.
    closing, closing_each : float
        Seconds that dataset and report take for a study of one run, and for each further run.
    """

    seconds: float
    size: float
    failures: list[str]
    tried: int
    start: float = 0.0
    closing: float = 0.0
    closing_each: float = 0.0

    def seconds_of(self, runs: int, workers: int) -> float:
        """Return the seconds of a study from the command to the report."""
        return self.start + self.seconds * runs / min(workers, runs) + self.closing + self.closing_each * (runs - 1)


def try_runs(folder: Path, runs: Sequence[Run], limits: Limits, scripts: str = REFUSE, workers: int | None = None) -> Estimate:
    """Compute some runs, spread over a study, away from its folder.

    Parameters
    ----------
    folder : Path
        Of the study.
    runs : sequence of Run
        All of them.
    limits : Limits
        What a run may take.
    scripts : str
        What is done about the Python in a .blend.
    workers : int, optional
        Of this machine, which are started to see how long that takes. None: there are others.
    """
    start = 0.0 if workers is None else _seconds_of(lambda: _start_workers(min(workers, len(runs))))
    with tempfile.TemporaryDirectory(prefix="palpate-sweep-") as name:
        trial = Path(name)
        make_folders(trial)
        shutil.copy(folder / STUDY_NAME, trial)
        shutil.copytree(folder / SCENES, trial / SCENES, dirs_exist_ok=True)
        try:
            began = time.perf_counter()
            (first,) = compute_batch(name, [asdict(runs[0])], limits, scripts)  # the first run loads what was compiled
            start += time.perf_counter() - began - first["seconds"]
            closing, one = _seconds_to_close(trial, runs[:1])
            shutil.rmtree(trial / RUNS)
            make_folders(trial)
            tried = _spread(runs, RUNS_TRIED)
            answers = compute_batch(name, [asdict(run) for run in tried], limits, scripts)
            quick = int(QUICK_SECONDS * len(answers) / max(1e-3, sum(answer["seconds"] for answer in answers)))
            more = [run for run in _spread(runs, min(quick, QUICK_RUNS)) if run not in tried] if quick > RUNS_TRIED else []
            answers += compute_batch(name, [asdict(run) for run in more], limits, scripts)
        finally:
            end_children()
        _, several = _seconds_to_close(trial, [*tried, *more])
        written = sum(file.stat().st_size for file in (trial / RUNS).rglob("*") if file.is_file())
    failures = [answer["sentence"] for answer in answers if "sentence" in answer]
    done = max(1, len(answers) - len(failures))
    seconds = sum(answer["seconds"] for answer in answers) / len(answers)
    each = max(0.0, several - one) / max(1, done - 1)
    return Estimate(seconds, written / done, failures, len(answers), start, closing, each)


def _spread(runs: Sequence[Run], count: int) -> Sequence[Run]:
    """Return so many runs, or all, from the whole study."""
    return runs[:: max(1, len(runs) // count)][:count]


def _seconds_of(work: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    began = clock()
    work()
    return clock() - began


def _start_workers(count: int) -> None:
    with dask_client(None, count) as client:
        client.wait_for_workers(count)


def _seconds_to_close(folder: Path, runs: Sequence[Run]) -> tuple[float, float]:
    """Return the seconds of dataset and report, and those of the dataset when it is written once more; 0 where no run is done.

    The first time includes what Python loads for them, as it does in a study. The second one is the processor's, since other
    programs on the machine would be multiplied by the number of runs.
    """
    from .dataset import publish
    from .report import write_report

    if not done_runs(folder):
        return 0.0, 0.0
    whole = _seconds_of(lambda: publish(folder, runs)) + _seconds_of(lambda: write_report(folder, runs))
    return whole, min(_seconds_of(lambda: publish(folder, runs), time.process_time) for _ in range(2))
