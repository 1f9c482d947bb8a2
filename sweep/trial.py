# SPDX-License-Identifier: GPL-3.0-or-later
"""A few runs of a study in a temporary folder, to tell how long all of them take and how much they write."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..core.study.study_file import PARTS, RUNS, SCENES, STUDY_NAME
from .dataset import DATASET_FOLDER, publish
from .scene_evaluation import REFUSE
from .study_folder import OpenStudy, open_study
from .worker import compute_batch

RUNS_TRIED, QUICK_RUNS, QUICK_SECONDS = 5, 50, 0.5
"""Runs that are computed, and so many where those take no longer than half a second."""
FIXED_SECONDS = 7.0
"""Until the workers of a machine have loaded Python, the solver and Dask, and for the report."""


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
