# SPDX-License-Identifier: GPL-3.0-or-later
"""A few runs of a study in a temporary folder, to tell how long all of them take and how much they write."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from ..core.study.run_files import RUNS, SCENES, STUDY_NAME, make_folders
from ..core.study.study_file import Run
from .scene_evaluation import REFUSE
from .worker import Limits, compute_batch, end_children

RUNS_TRIED = 5


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
    """

    seconds: float
    size: float
    failures: list[str]
    tried: int


def try_runs(folder: Path, runs: Sequence[Run], limits: Limits, scripts: str = REFUSE) -> Estimate:
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
    """
    step = max(1, len(runs) // RUNS_TRIED)
    chosen = [asdict(run) for run in runs[::step][:RUNS_TRIED]]
    with tempfile.TemporaryDirectory(prefix="palpate-sweep-") as name:
        trial = Path(name)
        make_folders(trial)
        shutil.copy(folder / STUDY_NAME, trial)
        shutil.copytree(folder / SCENES, trial / SCENES, dirs_exist_ok=True)
        try:
            compute_batch(name, chosen[:1], limits, scripts)  # the first run loads what was compiled
            shutil.rmtree(trial / RUNS)
            make_folders(trial)
            answers = compute_batch(name, chosen, limits, scripts)
        finally:
            end_children()
        written = sum(file.stat().st_size for file in (trial / RUNS).rglob("*") if file.is_file())
    failures = [answer["sentence"] for answer in answers if "sentence" in answer]
    done = max(1, len(answers) - len(failures))
    return Estimate(sum(answer["seconds"] for answer in answers) / len(answers), written / done, failures, len(answers))


def count_of_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
