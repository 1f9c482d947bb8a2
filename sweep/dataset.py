# SPDX-License-Identifier: GPL-3.0-or-later
"""From the folder of runs to ``dataset/`` and ``runs.parquet``, both whole or not at all.

Runs are taken in the order of the design, so that equal runs give equal bytes, in whatever order they finished.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ..core.errors import FileError, os_error_reason
from ..core.io.hidden_folder import remove_abandoned, temporary_folder
from ..core.study.run_files import STUDY_NAME
from ..core.study.study_file import Run, read_study
from .exchange import exchange_folder, require_own
from .finished_runs import RunOrder, StoredRuns, failures, run_order, study_name
from .lerobot_writer import LeRobotWriter
from .run_table import write_run_table

DATASET_FOLDER = "dataset"
DATASET_FILES = re.compile(r"(part-\d{3,}/)?(README\.md|data/chunk-\d{3,}/file-\d{3,}\.parquet|meta/.+\.(parquet|json))")
"""Names of the files of a dataset; no other file is removed with an earlier one."""

MOST_FILES = 5000
"""Files of frames that a dataset is to have at most; where 100 MB each were more, they are larger."""


def publish(folder: Path, planned: Sequence[Run] = ()) -> None:
    """Make ``dataset/``, ``runs.parquet`` and ``timings.csv`` from the runs of a study.

    The dataset is written into a hidden folder and renamed into its place last; that of before is removed then. Runs whose
    sensors or rates differ cannot share the columns of one dataset: each kind becomes one, ``dataset/part-000`` and so on.
    The runs of a program have no sensors, and it becomes no dataset.

    Parameters
    ----------
    folder : Path
        Of the study.
    planned : sequence of Run
        All runs of the study, which tell what varied in those that failed.

    Raises
    ------
    FileError
        There is no study, a run is damaged, pyarrow is not installed, or something cannot be written.
    """
    require_pyarrow()
    remove_abandoned(folder)
    require_own(folder / DATASET_FOLDER, DATASET_FILES)
    order = run_order(folder, planned)
    try:
        write_run_table(folder, order, failures(folder, planned))
        with temporary_folder(folder, "dataset") as hidden:
            new = None if read_study(folder / STUDY_NAME).is_job else _write_parts(folder, order, hidden)
            exchange_folder(new, folder / DATASET_FOLDER, hidden / "before", DATASET_FILES)
    except OSError as error:
        raise FileError(
            f"The dataset in '{folder}' could not be written ({os_error_reason(error)}): free some space or check its "
            "permissions, and give the same command again."
        ) from error


def require_pyarrow() -> None:
    """Raise FileError where the package pyarrow, which writes the files of a dataset, is not installed."""
    try:
        import pyarrow  # noqa: F401
    except ImportError as error:
        raise FileError(
            "Datasets need the package pyarrow: run \"pip install '.[sweep]'\" in a checkout of Palpate."
        ) from error


def _write_parts(folder: Path, order: RunOrder, hidden: Path) -> Path | None:
    """Write all runs and return the folder that is to become the dataset; None if there are no runs."""
    task = study_name(folder)
    parts = hidden / "parts"
    writers: dict[str, LeRobotWriter] = {}
    runs = StoredRuns(folder)
    file_bytes = runs.bytes_in_shards // MOST_FILES
    try:
        for _, digest in order:
            run, frames = runs.run(digest)
            writer = writers.get(frames.layout.digest)
            if writer is None:
                writer = LeRobotWriter(parts / f"part-{len(writers):03d}", frames.layout, task, file_bytes)
                writers[frames.layout.digest] = writer
            writer.add(run, frames)
        for writer in writers.values():
            writer.finish()
    except BaseException:
        for writer in writers.values():
            writer.abandon()
        raise
    if len(writers) <= 1:
        return parts / "part-000" if writers else None
    return parts
