# SPDX-License-Identifier: GPL-3.0-or-later
"""A few runs of a study in a temporary folder, to tell how long all of them take and how much they write."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..core.study.study_file import PARTS, RUNS, SCENES, STUDY_NAME
from .dataset import publish
from .report import write_report
from .scene_evaluation import REFUSE
from .study_folder import OpenStudy
from .worker import compute_batch

RUNS_TRIED, QUICK_RUNS, QUICK_SECONDS = 5, 50, 0.5
"""Runs that are computed, and so many where those take no longer than half a second."""
START_SECONDS = 4.0
"""Until the workers of a machine have loaded Python, the solver and Dask."""


@dataclass(frozen=True)
class Estimate:
    """Time and memory of a study.

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
    closing, closing_each : float
        Seconds that dataset and report take, and for each run.
    """

    seconds: float
    size: float
    failures: list[str]
    tried: int
    closing: float
    closing_each: float

    def seconds_of(self, runs: int, workers: int) -> float:
        """Return the seconds of a study from the command to the report."""
        return START_SECONDS + self.seconds * runs / min(workers, runs) + self.closing + self.closing_each * runs


def try_runs(opened: OpenStudy, scripts: str = REFUSE) -> Estimate:
    """Compute some runs, spread over a study, away from its folder.

    Parameters
    ----------
    opened : OpenStudy
    scripts : str
        What is done about the Python in a .blend and a job.
    """
    total, limit = len(opened.runs), opened.study.run_limit
    with tempfile.TemporaryDirectory(prefix="palpate-sweep-") as name:
        trial = Path(name)
        (trial / PARTS).mkdir()
        shutil.copy(opened.folder / STUDY_NAME, trial)
        shutil.copytree(opened.folder / SCENES, trial / SCENES)
        compute_batch([0], name, scripts, limit)  # the first run loads what was compiled
        first = _seconds_of(lambda: publish(trial, opened.study)) + _seconds_of(lambda: write_report(trial, opened.study))
        one = _seconds_of(lambda: publish(trial, opened.study))
        tried = range(total)[:: max(1, total // RUNS_TRIED)][:RUNS_TRIED]
        found = compute_batch(tried, name, scripts, limit)
        if found.seconds < QUICK_SECONDS:
            tried = range(total)[:: max(1, total // QUICK_RUNS)][:QUICK_RUNS]
            found = compute_batch(tried, name, scripts, limit)
        each = max(0.0, _seconds_of(lambda: publish(trial, opened.study)) - one) / len(tried)
        written = sum(os.stat(path).st_size for place in (PARTS, RUNS, "dataset") for path in (trial / place).rglob("*"))
    failures = [sentence for _, sentence in found.failures]
    return Estimate(found.seconds / len(tried), written / max(1, found.done), failures, len(tried), first, each)


def _seconds_of(work: Callable[[], object]) -> float:
    """Return the seconds of the processor that work takes: what other programs take would be multiplied by the runs."""
    began = time.process_time()
    work()
    return time.process_time() - began
