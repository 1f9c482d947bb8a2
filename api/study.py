# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies of many runs."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..core.errors import PalpateError
from . import arguments
from .running import ShowProgress

SCRIPTS = ("refuse", "ignore", "allow")
FORMATS = ("hdf5", "zarr")


@dataclass(frozen=True)
class StudyRun:
    """State of a study.

    Attributes
    ----------
    folder : Path
        With the dataset, the table of runs and report.html.
    total, done, failed : int
        Runs.
    failures : tuple of (int, str)
        Runs that failed now, each with the reason.
    files : tuple of Path
        Exported datasets.
    """

    folder: Path
    total: int
    done: int
    failed: int
    failures: tuple[tuple[int, str], ...] = ()
    files: tuple[Path, ...] = ()


def require_studies() -> None:
    """Raise :class:`PalpateError` inside Blender's extension, which has no studies."""
    if importlib.util.find_spec(f"{__package__.rpartition('.')[0]}.sweep") is None:
        raise PalpateError(
            "Blender's extension has no studies: run 'pip install .[sweep]' in a checkout of Palpate, with its own Python."
        )


def run_study(
    study: str | os.PathLike[str],
    folder: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    formats: Sequence[str] = (),
    retry_failed: bool = False,
    scripts: str = "refuse",
    progress: ShowProgress = False,
) -> StudyRun:
    """Compute the runs of a study that are left, and write its dataset and report; a study that was stopped goes on.

    Parameters
    ----------
    study : path
        Of a study.toml (docs/sweep.md), or the folder of a study that goes on.
    folder : path, optional
        For the results. Default: beside the file, with its name.
    workers : int, optional
        Processes. Default: one for each core. In a script that starts them, call this below ``if __name__ == "__main__":``.
    formats : sequence of {"hdf5", "zarr"}, optional
        Formats in which the dataset is written as well.
    retry_failed : bool
        Compute failed runs again.
    scripts : {"refuse", "ignore", "allow"}
        What is done about the Python in a .blend or a job.
    progress : bool or callable
        True for a progress bar.

    Raises
    ------
    PalpateError
        The study or a scene cannot be used, or a package is missing.
    """
    require_studies()
    from ..sweep import driver, exports, studies, study_folder
    from .running import shown

    arguments.known([scripts], SCRIPTS, "value of scripts")
    arguments.known(formats, FORMATS, "format")
    driver.require_dask()
    exports.require_packages(formats)
    place = Path(study)
    target = studies.output_folder(place, None if folder is None else Path(folder))
    number = None if workers is None else arguments.count(workers, "workers")
    with studies.locked_folder(place, target):
        opened = study_folder.open_study(place, target, scripts)
        with shown(progress, "sweep", "run") as show:
            failures = studies.compute_runs(opened, show, number, retry_failed)
        found, written = studies.write_results(opened, formats)
    return StudyRun(opened.folder, found.total, found.done, found.failed, tuple(failures), tuple(written))
