# SPDX-License-Identifier: GPL-3.0-or-later
"""From the parts of a study to ``runs.parquet``, ``timings.csv`` and ``dataset/``.

Runs are taken in the order of the design, so that equal runs give equal bytes, whichever were computed together.
"""

from __future__ import annotations

import os
import re
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from ..core.errors import FileError, os_error_reason
from ..core.io.file_writing import atomic_write
from ..core.io.hidden_folder import temporary_folder
from ..core.study.study_file import Study
from .features import varied_feature
from .lerobot import LeRobotWriter
from .parts import COMPRESSION, FINISHED, Parts, frames_in

DATASET_FOLDER, TABLE_NAME, TIMINGS_NAME = "dataset", "runs.parquet", "timings.csv"
DATASET_FILES = re.compile(r"(part-\d{3,}/)?(README\.md|data/chunk-\d{3,}/file-\d{3,}\.parquet|meta/.+\.(parquet|json))")
"""Names of the files of a dataset; no other file is removed with an earlier one."""
MOST_FILES = 4000
"""Files of frames that a dataset is to have at most; where 100 MB each were more, they are larger."""
ROWS_OF_GROUP = 1000
UNNAMED_STUDY = "study of a tactile sensor"
"""Name of a study whose file gives none. The name of its folder does not serve, so that equal studies give equal files."""


def publish(folder: Path, study: Study) -> None:
    """Make table and dataset of the runs that are done and failed.

    The dataset is written into a hidden folder and renamed into its place last. Runs whose sensors or rates differ cannot
    share the columns of one dataset: each kind becomes one, ``dataset/part-000`` and so on. A job has no dataset.

    Raises
    ------
    FileError
        A part is damaged, pyarrow is not installed, or something cannot be written.
    """
    parts = Parts(folder)
    require_own(folder / DATASET_FOLDER, DATASET_FILES)
    try:
        _write_tables(folder, parts)
        with temporary_folder(folder, "dataset") as hidden, ExitStack() as files:
            new = _write_datasets(parts, hidden / "parts", study.name or UNNAMED_STUDY, files)
            replace_folder(new, folder / DATASET_FOLDER, hidden, DATASET_FILES)
    except OSError as error:
        raise FileError(
            f"The dataset in '{folder}' could not be written ({os_error_reason(error)}): free some space or check its "
            "permissions, and give the same command again."
        ) from error


def _write_tables(folder: Path, parts: Parts) -> None:
    """Write the columns that say something of runs as a whole, and beside them the times, on which no result depends."""
    from pyarrow import compute, csv, parquet

    schema = parts.run_schema.empty_table().drop_columns("seconds").schema
    with (
        atomic_write(folder / TABLE_NAME) as runs,
        parquet.ParquetWriter(runs, schema, **COMPRESSION) as writer,
        atomic_write(folder / TIMINGS_NAME) as timings,
        open(timings, "wb") as file,
    ):
        file.write(b"run,digest,seconds\n")  # pyarrow would put the names in quotation marks
        for table in parts.run_tables(ROWS_OF_GROUP):
            writer.write_table(table.select(schema.names))
            done = table.filter(compute.equal(table["status"], FINISHED)).select(["run", "digest", "seconds"])
            csv.write_csv(done, file, csv.WriteOptions(include_header=False, quoting_style="none"))


def _write_datasets(parts: Parts, folder: Path, task: str, files: ExitStack) -> Path | None:
    """Write a dataset for each layout of the runs and return the folder that is to become the dataset; None without frames."""
    file_bytes = sum(path.stat().st_size for path in parts.files) // MOST_FILES
    columns_varied = [item for item in parts.run_schema if item.name.startswith("varied.")]
    varied = [varied_feature(item.name, "string" if str(item.type) == "string" else "float64") for item in columns_varied]
    writers: dict[str, LeRobotWriter] = {}
    for piece in parts.pieces():
        layout = parts.layout(piece)
        if layout is None:
            continue
        if layout.digest not in writers:
            writer = LeRobotWriter(folder / f"part-{len(writers):03d}", layout, task, varied, file_bytes)
            files.callback(writer.close)
            writers[layout.digest] = writer
        rows = piece.select(["run", "digest", *(item.name for item in columns_varied)]).to_pylist()
        lengths, columns = frames_in(piece, layout)
        ends = np.cumsum(lengths)
        for row, begin, end in zip(rows, ends - lengths, ends, strict=True):
            if end > begin:  # a run that failed has no frames
                numbers = {name: column[begin:end] for name, column in columns.items()}
                writers[layout.digest].add(row.pop("run"), row.pop("digest"), numbers, list(row.values()))
    for writer in writers.values():
        writer.finish()
    if len(writers) == 1:
        return folder / "part-000"
    return folder if writers else None


def require_own(target: Path, files: re.Pattern[str]) -> None:
    """Raise FileError unless a folder may be replaced: it is missing, or holds only files of these names, relative to it."""
    if not os.path.lexists(target):
        return
    if target.is_symlink() or not target.is_dir():
        raise FileError(f"'{target}' is not a folder: move it away, `palpate sweep` writes a folder of this name.")
    for path in sorted(target.rglob("*")):
        if (path.is_symlink() or not path.is_dir()) and not files.fullmatch(path.relative_to(target).as_posix()):
            raise FileError(f"'{path}' was not written by `palpate sweep`: move it away, the folder '{target}' is replaced.")


def replace_folder(new: Path | None, target: Path, hidden: Path, files: re.Pattern[str]) -> None:
    """Put a folder in the place of an earlier one, or remove that.

    The earlier one is moved away whole, so that none with some of its files stands there. A kill between the two renames
    leaves none, which can be made again.

    Parameters
    ----------
    new : Path or None
        None: there is to be no folder.
    target : Path
    hidden : Path
        Temporary folder in the same parent folder. The earlier folder is moved into it and removed with it.
    files : compiled regular expression
        Of the names that the earlier folder may hold.

    Raises
    ------
    FileError
        As :func:`require_own`.
    OSError
        A folder cannot be renamed; the earlier one is in its place then.
    """
    require_own(target, files)
    earlier = hidden / "earlier"
    if target.exists():
        os.rename(target, earlier)
    try:
        if new is not None:
            os.rename(new, target)
    except OSError:
        if earlier.exists():
            os.rename(earlier, target)
        raise
