# SPDX-License-Identifier: GPL-3.0-or-later
"""``runs.parquet``: a row a run, with what was varied, the metrics and the status; ``timings.csv``: how long each run took.

Times are in a file of their own, because two computations of the same study give equal tables but never equal times.
"""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from ..core.errors import FileError
from ..core.io.file_writing import atomic_write
from ..core.study.run_record import RunRecord, Value
from .finished_runs import FailedRun, RunOrder, finished_runs

if TYPE_CHECKING:
    import pyarrow

TABLE_NAME, TIMINGS_NAME = "runs.parquet", "timings.csv"
FINISHED, FAILED = "finished", "failed"
ROWS_AT_ONCE, ROWS_OF_GROUP = 1000, 10_000
"""Rows that wait as Python objects, and those of a group in the file."""


def write_run_table(folder: Path, order: RunOrder, failed: list[FailedRun]) -> None:
    """Write ``runs.parquet`` and ``timings.csv`` into the folder of a study.

    Columns: ``run`` (place in the design), ``digest``, ``status`` ("finished" or "failed"), ``message`` (why it failed),
    ``varied.<name>`` and ``metric.<name>``. A metric without a value is null.

    Raises
    ------
    FileError
        A file cannot be read or written.
    """
    with tempfile.TemporaryFile(dir=folder) as waiting:
        table = _WaitingTable(waiting, folder)
        with atomic_write(folder / TIMINGS_NAME) as path, open(path, "w", newline="", encoding="utf-8") as timings:
            lines = csv.writer(timings, lineterminator="\n")
            lines.writerow(["run", "digest", "seconds"])
            for run in finished_runs(folder, order):
                lines.writerow([run.index, run.digest, f"{run.seconds:.6g}"])
                table.add(_row(run), run.values, run.metrics)
        for lost in failed:
            table.add(_failed_row(lost), lost.values, {})
        with atomic_write(folder / TABLE_NAME) as path:
            table.write(path)


class _WaitingTable:
    """Rows that wait in a file until the columns of all are known.

    Parameters
    ----------
    file : binary file
    folder : Path
        Of the study.
    """

    def __init__(self, file: IO[bytes], folder: Path):
        self._file, self._folder = file, folder
        self._varied: dict[str, Any] = {}
        self._metrics: set[str] = set()
        self._rows: list[dict[str, Any]] = []
        self._parts = 0

    def add(self, row: dict[str, Any], values: dict[str, Value], metrics: Iterable[str]) -> None:
        """Add a row, with what was varied in the run and its metrics."""
        _note_kinds(self._varied, values, self._folder)
        self._metrics.update(metrics)
        self._rows.append(row)
        if len(self._rows) >= ROWS_AT_ONCE:
            self._put_down()

    def _put_down(self) -> None:
        """Write the rows into the file, with the columns that are known now."""
        import pyarrow

        part = pyarrow.Table.from_pylist(self._rows, _schema(self._varied, self._metrics))
        with pyarrow.ipc.new_stream(pyarrow.PythonFile(self._file, "w"), part.schema) as stream:
            stream.write_table(part)
        self._rows, self._parts = [], self._parts + 1

    def write(self, path: Path) -> None:
        """Write all rows with all columns; names that no run had before are null in the parts before."""
        import pyarrow
        from pyarrow import parquet

        self._put_down()
        schema = _schema(self._varied, self._metrics)
        self._file.seek(0)
        source = pyarrow.PythonFile(self._file, "r")
        group: list[pyarrow.Table] = []
        with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
            for number in range(1, self._parts + 1):
                with pyarrow.ipc.open_stream(source) as stream:
                    group.append(_with_columns(stream.read_all(), schema))
                if number == self._parts or len(group) * ROWS_AT_ONCE >= ROWS_OF_GROUP:
                    writer.write_table(pyarrow.concat_tables(group))
                    group = []


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
