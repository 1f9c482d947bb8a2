# SPDX-License-Identifier: GPL-3.0-or-later
"""``runs.parquet``: a row a run, with what was varied, the metrics and the status; ``timings.csv``: how long each run took.

Times are in a file of their own, because two computations of the same study give equal tables but never equal times.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import FileError
from ..core.io.file_writing import atomic_write
from ..core.study.run_record import RunRecord, Value
from .finished_runs import FailedRun, finished_runs

if TYPE_CHECKING:
    import pyarrow

TABLE_NAME, TIMINGS_NAME = "runs.parquet", "timings.csv"
FINISHED, FAILED = "finished", "failed"
ROWS_AT_ONCE = 10_000
"""Rows that wait in memory."""


def write_run_table(folder: Path, order: list[tuple[int, str]], failed: list[FailedRun]) -> None:
    """Write ``runs.parquet`` and ``timings.csv`` into the folder of a study.

    Columns: ``run`` (place in the design), ``digest``, ``status`` ("finished" or "failed"), ``message`` (why it failed),
    ``varied.<name>`` and ``metric.<name>``. A metric without a value is null.

    Raises
    ------
    FileError
        A file cannot be read or written.
    """
    import pyarrow
    from pyarrow import parquet

    varied: dict[str, Any] = {}
    metrics: set[str] = set()
    parts: list[pyarrow.Table] = []
    waiting: list[dict[str, Any]] = []
    with atomic_write(folder / TIMINGS_NAME) as timings_path, open(timings_path, "w", newline="", encoding="utf-8") as timings:
        lines = csv.writer(timings, lineterminator="\n")
        lines.writerow(["run", "digest", "seconds"])
        for run in finished_runs(folder, order):
            lines.writerow([run.index, run.digest, f"{run.seconds:.6g}"])
            _note_kinds(varied, run.values, run.folder)
            metrics.update(run.metrics)
            waiting.append(_row(run))
            if len(waiting) >= ROWS_AT_ONCE:
                parts.append(pyarrow.Table.from_pylist(waiting, _schema(varied, metrics)))
                waiting = []
        for lost in failed:
            _note_kinds(varied, lost.values, folder)
            waiting.append(_failed_row(lost))
    schema = _schema(varied, metrics)  # of all: names that no run had before are null in the parts before
    parts.append(pyarrow.Table.from_pylist(waiting, schema))
    with atomic_write(folder / TABLE_NAME) as path, parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        for part in parts:
            writer.write_table(_with_columns(part, schema))


def _schema(varied: dict[str, Any], metrics: set[str]) -> pyarrow.Schema:
    """Return the columns: what was varied in the order of the study, and metrics by name, as runs differ in which they have."""
    import pyarrow

    fixed = [("run", pyarrow.int64()), *((name, pyarrow.string()) for name in ("digest", "status", "message"))]
    own = [(f"varied.{name}", kind) for name, kind in varied.items()]
    return pyarrow.schema([*fixed, *own, *((f"metric.{name}", pyarrow.float64()) for name in sorted(metrics))])


def _with_columns(table: pyarrow.Table, schema: pyarrow.Schema) -> pyarrow.Table:
    """Return a table with all columns of a schema, in its order."""
    import pyarrow

    columns = [table[item.name] if item.name in table.column_names else pyarrow.nulls(len(table), item.type) for item in schema]
    return pyarrow.table(columns, schema=schema)


def _note_kinds(kinds: dict[str, Any], values: dict[str, Value], folder: Path) -> None:
    import pyarrow

    for name, value in values.items():
        kind = pyarrow.string() if isinstance(value, str) else pyarrow.float64()
        if kinds.setdefault(name, kind) != kind:
            raise FileError(f"'{name}' is a number in some runs and a text in '{folder}': choose values of one kind for it.")


def _row(run: RunRecord) -> dict[str, Any]:
    values = {f"varied.{name}": value for name, value in run.values.items()}
    metrics = {f"metric.{name}": value for name, value in run.metrics.items()}
    return {"run": run.index, "digest": run.digest, "status": FINISHED, "message": "", **values, **metrics}


def _failed_row(run: FailedRun) -> dict[str, Any]:
    values = {f"varied.{name}": value for name, value in run.values.items()}
    return {"run": run.index, "digest": run.digest, "status": FAILED, "message": run.sentence, **values}
