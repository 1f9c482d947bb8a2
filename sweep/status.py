# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a study is, from its files alone: no scheduler is asked, and the study may be running."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..core.errors import FileError
from ..core.study.run_files import STUDY_NAME, done_runs, failed_runs
from ..core.study.study_file import read_study
from .study_folder import frozen_entries


@dataclass(frozen=True)
class Status:
    """Counts of the runs of a study."""

    total: int
    done: int
    failed: int

    @property
    def left(self) -> int:
        """Runs that are neither done nor failed."""
        return self.total - self.done - self.failed

    def __str__(self) -> str:
        return f"{self.total} runs: {self.done} done, {self.failed} failed, {self.left} left"


def status_of(folder: Path) -> Status:
    """Return how far the study in a folder is.

    Raises
    ------
    FileError
        There is no study in it.
    """
    if not (folder / STUDY_NAME).is_file():
        raise FileError(f"There is no study in '{folder}': give the folder that a study was run in.")
    study = read_study(folder / STUDY_NAME)
    frozen_entries(study, folder)
    total = study.frozen.get("runs")
    if not isinstance(total, int):
        raise FileError(f"'{folder / STUDY_NAME}' is damaged: its table [frozen] does not say how many runs there are.")
    done = done_runs(folder)
    return Status(total, len(done), len(failed_runs(folder) - done))
