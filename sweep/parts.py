# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts: Parquet files with a row for each run of a batch. A run is done when a part has it.

Columns: ``run``, ``digest``, ``status``, ``message``, ``traceback``, ``seconds``, ``varied.<name>``, ``metric.<name>``, and for
each feature of a frame the numbers of all frames, one behind the other. All runs of a part have the same layout of frames.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import FileError, imported
from ..core.io.file_writing import atomic_write
from ..core.study.study_file import LAYOUTS, PARTS, Run, part_files, part_name
from .features import Layout

if TYPE_CHECKING:
    import pyarrow

FORMAT = "palpate-parts/1"
COMPRESSION: dict[str, Any] = {"compression": "zstd", "compression_level": 3}
READING: dict[str, Any] = {"partitioning": None, "use_threads": False, "pre_buffer": False}
"""A folder may be called a=b. Threads of pyarrow each keep memory that they have used, so many parts would take more."""
PARTS_KEPT = 2
"""Parts that are in memory: neighbours of the design are in few parts, except after many interruptions."""
FINISHED, FAILED = "finished", "failed"


def require_pyarrow() -> None:
    """Raise PalpateError where pyarrow is not installed."""
    imported("pyarrow", "A dataset", "run \"pip install '.[sweep]'\" in a checkout of Palpate")


@dataclass(frozen=True)
class RunResult:
    """Result of a run.

    Attributes
    ----------
    run : Run
    message : str
        Why it failed, in one sentence; empty where it is done.
    traceback : str
        Of a fault of the program.
    seconds : float
        That computing took. No result depends on it.
    metrics : dict of str to float
    layout : Layout or None
        Of its frames; None where it has none.
    columns : dict of str to (F, …) ndarray
        Of its frames, by the names of the layout's features.
    """

    run: Run
    message: str = ""
    traceback: str = ""
    seconds: float = 0.0
    metrics: Mapping[str, float] = field(default_factory=dict)
    layout: Layout | None = None
    columns: Mapping[str, np.ndarray] = field(default_factory=dict)


def write_part(folder: Path, results: Sequence[RunResult]) -> None:
    """Write runs that have one layout into a part of a study.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    from pyarrow import parquet

    if not results:
        return
    layout = next((one.layout for one in results if one.layout is not None), None)
    if layout is not None:
        layout.save(folder / LAYOUTS)
    content = hashlib.sha256(repr([one.run.digest for one in results]).encode()).hexdigest()[:16]
    failed = sum(bool(one.message) for one in results)
    with atomic_write(folder / PARTS / part_name(results[0].run.index, content, len(results) - failed, failed)) as fresh:
        parquet.write_table(_table(results, layout), fresh, **COMPRESSION)


def _table(results: Sequence[RunResult], layout: Layout | None) -> pyarrow.Table:
    import pyarrow

    columns: dict[str, Any] = {
        "run": pyarrow.array([one.run.index for one in results], pyarrow.int64()),
        "digest": [one.run.digest for one in results],
        "status": [FAILED if one.message else FINISHED for one in results],
        "message": [one.message for one in results],
        "traceback": [one.traceback for one in results],
        "seconds": [float(f"{one.seconds:.6g}") for one in results],
    }
    for name in dict.fromkeys(name for one in results for name in one.run.values):
        values = [one.run.values.get(name) for one in results]
        columns[f"varied.{name}"] = [float(v) if isinstance(v, bool | int) else v for v in values]
    for name in sorted({name for one in results for name in one.metrics}):
        columns[f"metric.{name}"] = pyarrow.array([one.metrics.get(name) for one in results], pyarrow.float64())
    for feature in layout.features if layout is not None else ():
        none = np.zeros(0, feature.dtype)
        own = [one.columns.get(feature.name, none).reshape(-1) for one in results]
        numbers = np.concatenate(own)
        ends = np.cumsum([0, *map(len, own)], dtype=np.int64)
        columns[feature.name] = pyarrow.LargeListArray.from_arrays(ends, pyarrow.array(numbers))
    note = {"palpate": FORMAT, "layout": layout.digest if layout is not None else ""}
    return pyarrow.table(columns).replace_schema_metadata(note)


class Parts:
    """The runs that the parts of a study have.

    Parameters
    ----------
    folder : Path
        Of the study.

    Raises
    ------
    FileError
        A part is damaged, or of another version.
    """

    def __init__(self, folder: Path):
        require_pyarrow()
        self._folder = folder
        self.files = part_files(folder)
        found = [self._places(number, path) for number, path in enumerate(self.files)]
        rows = np.concatenate([np.zeros((0, 4), np.int32), *found])
        # Of a run that is there twice, one that is done is first.
        rows = rows[np.lexsort((-rows[:, 2], rows[:, 1], rows[:, 0]))]
        _, first = np.unique(rows[:, 0], return_index=True)
        self._rows = rows[first]
        self._read = lru_cache(maxsize=PARTS_KEPT)(self._read_part)
        self._layout = lru_cache(maxsize=PARTS_KEPT)(Layout.load)

    def _places(self, number: int, path: Path) -> np.ndarray:
        """Return (n, 4) int: index of each run of a part, 1 for one that failed, number of the part and row in it."""
        from pyarrow import compute, parquet

        with _damage_as_sentence(path):
            table = parquet.read_table(path, columns=["run", "status"], **READING)
            if (table.schema.metadata or {}).get(b"palpate") != FORMAT.encode():
                raise FileError(f"'{path}' is not of the format {FORMAT}: give another folder with --out.")
        is_failed = compute.equal(table["status"], FAILED).to_numpy()
        columns = table["run"].to_numpy(), is_failed, np.full(len(table), number), np.arange(len(table))
        return np.stack(columns, axis=1, dtype=np.int32, casting="unsafe")

    @property
    def done(self) -> np.ndarray:
        """Indices of the runs that are done, in order."""
        return self._rows[self._rows[:, 1] == 0, 0]

    @property
    def failed(self) -> np.ndarray:
        """Indices of the runs that failed, in order."""
        return self._rows[self._rows[:, 1] == 1, 0]

    @cached_property
    def run_schema(self) -> pyarrow.Schema:
        """The columns that say something of a run as a whole, of all parts, metrics in the order of their names."""
        import pyarrow
        from pyarrow import parquet

        schemas = []
        for path in self.files:
            with _damage_as_sentence(path):
                own = [item for item in parquet.read_schema(path) if not pyarrow.types.is_large_list(item.type)]
            schemas.append(pyarrow.schema(own))
        fields = pyarrow.unify_schemas(schemas, promote_options="permissive")
        return pyarrow.schema(sorted(fields, key=lambda item: item.name if item.name.startswith("metric.") else ""))

    def run_tables(self, size: int) -> Iterator[pyarrow.Table]:
        """Yield the columns of :attr:`run_schema` in the order of the design, in tables of so many runs."""
        import pyarrow

        for at in range(0, len(self._rows), size):
            yield pyarrow.concat_tables(self.pieces(slice(at, at + size), self.run_schema)).combine_chunks()

    def pieces(self, which: slice = slice(None), schema: pyarrow.Schema | None = None) -> Iterator[pyarrow.Table]:
        """Yield runs in the order of the design, as tables of runs that are neighbours in a part.

        Parameters
        ----------
        which : slice
            Of all runs in this order.
        schema : pyarrow.Schema, optional
            The columns that are read. Default: all that a part has.
        """
        rows = self._rows[which]
        same = np.all(np.diff(rows[:, 2:], axis=0) == [0, 1], axis=1)
        for own in np.split(rows, np.flatnonzero(~same) + 1):
            if len(own):
                yield self._read(own[0, 2], schema).slice(own[0, 3], len(own))

    def run(self, index: int) -> pyarrow.Table:
        """Return a run as a table of one row."""
        at = int(np.searchsorted(self._rows[:, 0], index))
        return next(self.pieces(slice(at, at + 1)))

    def layout(self, table: pyarrow.Table) -> Layout | None:
        """Return the layout of the frames of a table; None where its runs have none."""
        digest = table.schema.metadata[b"layout"].decode()
        return self._layout(self._folder / LAYOUTS, digest) if digest else None

    def _read_part(self, part: int, schema: pyarrow.Schema | None) -> pyarrow.Table:
        from pyarrow import parquet

        with _damage_as_sentence(self.files[part]):
            return parquet.read_table(self.files[part], schema=schema, **READING)


@contextmanager
def _damage_as_sentence(path: Path) -> Iterator[None]:
    """Turn what pyarrow raises about a file into a sentence."""
    try:
        yield
    except (OSError, ValueError, LookupError) as error:  # pyarrow's errors are of these
        raise FileError(
            f"'{path}' is damaged ({str(error).splitlines()[0]:.100}): delete it and give the same command again, which "
            "computes its runs once more."
        ) from error


def frames_in(table: pyarrow.Table, layout: Layout) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the number of frames of each run, and the (F, …) numbers of each feature for all of them."""
    columns = {}
    for feature in layout.features:
        own = table[feature.name].combine_chunks()
        columns[feature.name] = own.flatten().to_numpy(zero_copy_only=False).reshape(-1, *feature.shape)
        lengths = own.value_lengths().to_numpy() // int(np.prod(feature.shape))
    return lengths, columns


def remove_unfinished_parts(folder: Path) -> None:
    """Remove what killed processes have left of parts that they were writing."""
    for path in (folder / PARTS).glob(".*.partial*"):
        with suppress(OSError):
            path.unlink()
