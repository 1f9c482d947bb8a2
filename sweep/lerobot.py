# SPDX-License-Identifier: GPL-3.0-or-later
"""One dataset in the layout of LeRobot v3, written run by run in memory that does not grow with their number.

The layout is that of `lerobot/datasets` in LeRobot 0.6 (codebase version "v3.0"): frames in ``data/chunk-000/file-000.parquet``
and so on, runs ("episodes") in ``meta/episodes``, tasks, features and statistics in ``meta``. LeRobot itself is not needed.
Beyond it, ``meta/texels.parquet`` says where the texels are.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import FileError, os_error_reason
from ..core.export.exporter import Exporter, sensor_progress
from ..core.figures.figure_style import FigureStyle
from ..core.geometry.grid_layout import GridLayout
from ..core.geometry.texels import Texels
from ..core.io.bake_reader import Bake
from ..core.jobs import Job
from .features import AXES, TIMESTAMP, Feature, Layout, frames_of
from .parts import COMPRESSION, require_pyarrow

if TYPE_CHECKING:
    import pyarrow

VERSION = "v3.0"
FILE_MEGABYTES, FILES_PER_CHUNK = 100, 1000
"""Size from which on a file is followed by the next, and files in a folder: LeRobot's own."""
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
GROUP_BYTES = 4 << 20
"""Numbers that wait in memory until they become a group of rows: whole runs, so that equal runs give equal bytes."""
EPISODES_OF_GROUP = 1000
PLACE_COLUMNS = ("frame_index", "episode_index", "index", "task_index")
"""Whole numbers that LeRobot expects in every dataset, and that tell the place of a frame in it."""

EPISODE_NUMBERS = ("episode_index", "length", "data/chunk_index", "data/file_index", "dataset_from_index", "dataset_to_index",
                   "run")  # fmt: skip
EPISODE_PLACE = ("meta/episodes/chunk_index", "meta/episodes/file_index")
"""Columns of ``meta/episodes``: those of a run, and the place of its row."""


class LeRobotWriter:
    """Writes one dataset.

    Parameters
    ----------
    root : Path
        A folder that is empty or is made.
    layout : Layout
        Of all its runs.
    task : str
        What LeRobot calls the task, the same for all runs.
    varied : sequence of Feature
        Columns of the varied properties, which are constant within a run.
    file_bytes : int
        Size from which on a file of frames is followed by the next, where it is above :data:`FILE_MEGABYTES`.
    """

    def __init__(self, root: Path, layout: Layout, task: str, varied: Sequence[Feature] = (), file_bytes: int = 0):
        import pyarrow

        self._root, self._layout, self._task, self._varied = root, layout, task, varied
        kinds = [(name, pyarrow.int64()) for name in PLACE_COLUMNS]
        kinds += [(item.name, _arrow_type(item)) for item in (*layout.features, *self._varied)]
        self._frames = _FileSeries(root, DATA_PATH, pyarrow.schema(kinds), max(file_bytes, FILE_MEGABYTES << 20))
        texts = [("tasks", pyarrow.list_(pyarrow.string())), ("digest", pyarrow.string())]
        schema = pyarrow.schema([*((name, pyarrow.int64()) for name in (*EPISODE_NUMBERS, *EPISODE_PLACE)), *texts])
        self._episodes = _FileSeries(root, EPISODES_PATH, schema, FILE_MEGABYTES << 20)
        self._statistics: dict[str, _Statistics] = {}
        self._waiting: list[dict[str, np.ndarray]] = []
        self._waiting_bytes = 0
        self._rows: list[dict[str, Any]] = []
        self._runs = self._total = 0
        (root / "meta").mkdir(parents=True, exist_ok=True)
        _write_texels(root / "meta" / "texels.parquet", layout.texels)

    def add(self, index: int, digest: str, columns: dict[str, np.ndarray], values: Sequence[Any] = ()) -> None:
        """Append the frames of a run: its index and digest, numbers of the features, and values of the varied properties."""
        count = len(columns[TIMESTAMP.name])
        places = {
            "frame_index": np.arange(count),
            "episode_index": np.full(count, self._runs),
            "index": np.arange(self._total, self._total + count),
            "task_index": np.zeros(count, np.int64),
        }
        constant = {item.name: np.full(count, value, object if item.dtype == "string" else float)
                    for item, value in zip(self._varied, values, strict=True)}  # fmt: skip
        self._waiting.append({**places, **columns, **constant})
        self._waiting_bytes += sum(column.nbytes for column in columns.values())
        numbers = (self._runs, count, *self._frames.place, self._total, self._total + count, index)
        self._rows.append(dict(zip(EPISODE_NUMBERS, numbers)) | {"tasks": [self._task], "digest": digest})
        self._runs += 1
        self._total += count
        if self._waiting_bytes >= GROUP_BYTES:
            self._write_frames()

    def _write_frames(self) -> None:
        """Write the waiting runs as one group of rows, and take them into account in the statistics."""
        import pyarrow

        columns = {name: np.concatenate([one[name] for one in self._waiting]) for name in self._waiting[0]}
        for name, values in columns.items():
            if values.dtype != object:
                self._statistics.setdefault(name, _Statistics()).add(values)
        schema = self._frames.schema
        self._frames.write(pyarrow.table([_array(columns[item.name], item.type) for item in schema], schema=schema))
        self._waiting, self._waiting_bytes = [], 0
        self._write_episodes(EPISODES_OF_GROUP)

    def _write_episodes(self, least: int) -> None:
        """Write the rows about runs as one group, where there are so many."""
        import pyarrow

        if len(self._rows) >= least:
            place = dict(zip(EPISODE_PLACE, self._episodes.place))
            rows = [row | place for row in self._rows]
            self._episodes.write(pyarrow.Table.from_pylist(rows, self._episodes.schema))
            self._rows = []

    def finish(self) -> None:
        """Write what still waits, and the files that describe the dataset."""
        if self._waiting:
            self._write_frames()
        self._write_episodes(1)
        self.close()
        meta = self._root / "meta"
        _write_tasks(meta / "tasks.parquet", self._task)
        info = self._info()
        _write_json(meta / "info.json", info)
        _write_json(meta / "stats.json", {name: found.result() for name, found in self._statistics.items()})
        _write_card(self._root / "README.md", self._task, info)

    def close(self) -> None:
        """Finish the files that are open."""
        self._frames.close()
        self._episodes.close()

    def _info(self) -> dict[str, Any]:
        fps = self._layout.fps
        own = [item for item in self._layout.features if item.name != TIMESTAMP.name]
        return {
            "codebase_version": VERSION,
            "robot_type": None,
            "total_episodes": self._runs,
            "total_frames": self._total,
            "total_tasks": 1,
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": FILE_MEGABYTES,
            "video_files_size_in_mb": 200,  # LeRobot's own; there are no videos
            "fps": int(fps) if fps == int(fps) else fps,
            "splits": {"train": f"0:{self._runs}"},
            "data_path": DATA_PATH,
            "video_path": None,
            "features": {
                **{item.name: _described(item) for item in (*own, *self._varied)},
                TIMESTAMP.name: {"dtype": TIMESTAMP.dtype, "shape": [1], "names": None},
                **{name: {"dtype": "int64", "shape": [1], "names": None} for name in PLACE_COLUMNS},
            },
        }


class _FileSeries:
    """Parquet files that follow each other, one when the one before has reached its size."""

    def __init__(self, root: Path, pattern: str, schema: pyarrow.Schema, file_bytes: int):
        self._root, self._pattern, self.schema, self._file_bytes = root, pattern, schema, file_bytes
        self._number = 0
        self._writer: Any = None

    @property
    def place(self) -> tuple[int, int]:
        """Numbers of the folder and of the file that is written next."""
        return divmod(self._number, FILES_PER_CHUNK)

    def write(self, table: pyarrow.Table) -> None:
        """Write a table as one group of rows."""
        from pyarrow import parquet

        chunk, file = self.place
        path = self._root / self._pattern.format(chunk_index=chunk, file_index=file)
        if self._writer is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = parquet.ParquetWriter(path, self.schema, **COMPRESSION)
        self._writer.write_table(table, row_group_size=max(1, len(table)))
        if path.stat().st_size >= self._file_bytes:
            self.close()
            self._number += 1

    def close(self) -> None:
        """Finish the present file, if there is one."""
        if self._writer is not None:
            writer, self._writer = self._writer, None
            writer.close()


class _Statistics:
    """Smallest and largest value, mean and deviation of (F, …) numbers, for each place by itself.

    Groups of rows are joined by the formula of Chan, Golub and LeVeque (1979), which loses no digits to large means.
    """

    def __init__(self) -> None:
        self._count = 0
        self._least = self._most = self._mean = self._squares = np.zeros(1)

    def add(self, values: np.ndarray) -> None:
        """Take the next group into account."""
        wide = values.astype(float).reshape(len(values), *(values.shape[1:] or (1,)))
        least, most, mean = wide.min(axis=0), wide.max(axis=0), wide.mean(axis=0)
        wide -= mean
        squares = np.einsum("i...,i...->...", wide, wide)
        if self._count:
            total, apart = self._count + len(wide), mean - self._mean
            squares = self._squares + squares + np.square(apart) * (self._count * len(wide) / total)
            mean = self._mean + apart * (len(wide) / total)
            least, most = np.minimum(self._least, least), np.maximum(self._most, most)
        self._count += len(wide)
        self._least, self._most, self._mean, self._squares = least, most, mean, squares

    def result(self) -> dict[str, Any]:
        """Return the entries of LeRobot's ``stats.json``; the deviation is that of all values, not of a sample."""
        found = {"min": self._least, "max": self._most, "mean": self._mean, "std": np.sqrt(self._squares / self._count)}
        return {**{name: values.tolist() for name, values in found.items()}, "count": [self._count]}


def _arrow_type(feature: Feature) -> pyarrow.DataType:
    import pyarrow

    kind = pyarrow.type_for_alias(feature.dtype)
    if feature.shape == (1,):
        return kind
    if len(feature.shape) == 1:
        return pyarrow.list_(kind, feature.shape[0])
    for _ in feature.shape:
        kind = pyarrow.list_(kind)
    return kind


def _array(values: np.ndarray, kind: pyarrow.DataType) -> pyarrow.Array:
    """Return (F, …) numbers as an array of Arrow, without a Python object for each of them."""
    import pyarrow

    found = pyarrow.array(values.reshape(-1))
    if pyarrow.types.is_fixed_size_list(kind):
        return pyarrow.FixedSizeListArray.from_arrays(found, kind.list_size)
    if pyarrow.types.is_list(kind):
        for length in values.shape[:0:-1]:
            found = pyarrow.ListArray.from_arrays(np.arange(0, len(found) + 1, length, dtype=np.int32), found)
    return found


def _described(feature: Feature) -> dict[str, Any]:
    """Return the entry of a feature in ``info.json``: LeRobot's keys, and unit and meaning under a key of ours."""
    about: dict[str, Any] = {"about": feature.about}
    if feature.unit:
        about["unit"] = feature.unit
    if feature.channels:
        about["channels"] = feature.channels
    names = list(feature.names) or None
    return {"dtype": feature.dtype, "shape": list(feature.shape), "names": names, "palpate": about}


def _write_card(path: Path, task: str, info: dict[str, Any]) -> None:
    """Write the dataset's card, whose first lines tell the library `datasets` which files are the frames."""
    lines = [
        "---",
        "tags: [LeRobot, tactile]",
        "configs:",
        "- config_name: default",
        "  data_files: data/*/*.parquet",
        "---",
        "",
        f"# {' '.join(task.replace('#', ' ').split())}",
        "",
        f"{info['total_frames']} frames of {info['total_episodes']} runs, simulated with Palpate, in the layout of LeRobot v3.",
        "`meta/info.json` gives units and meanings of the features, `meta/texels.parquet` the places of the texels.",
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _write_texels(path: Path, texels: dict[str, Texels]) -> None:
    """Write where the texels of all sensors are: a row each, in the frames of their bodies, metres."""
    import pyarrow
    from pyarrow import parquet

    tables = []
    for name, own in texels.items():
        none = pyarrow.nulls(len(own), pyarrow.int64())
        rows, columns = (own.layout.row, own.layout.column) if isinstance(own.layout, GridLayout) else (none, none)
        places = {"sensor": [name] * len(own), "texel": np.arange(len(own)), "row": rows, "column": columns, "area": own.area}
        for what in ("position", "normal", "tangent"):
            places |= {f"{what}_{axis}": values for axis, values in zip(AXES, getattr(own, what).T)}
        tables.append(pyarrow.table(places))
    parquet.write_table(pyarrow.concat_tables(tables, promote_options="permissive"), path, **COMPRESSION)


def _write_tasks(path: Path, task: str) -> None:
    """Write the only task; LeRobot reads its text from the index that pandas makes of the column."""
    import pyarrow
    from pyarrow import parquet

    kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_kind, "metadata": None}
        for name, (kind, numpy_kind) in kinds.items()
    ]
    note = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
    schema = pyarrow.schema([("task_index", pyarrow.int64()), ("task", pyarrow.string())], {"pandas": json.dumps(note)})
    parquet.write_table(pyarrow.table({"task_index": [0], "task": [task]}, schema), path, **COMPRESSION)


def _write_json(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8", newline="\n")


def write_lerobot(bake: Bake, folder: Path, _style: FigureStyle) -> Job[list[Path]]:
    """Write the dataset into the folder ``lerobot``; it is a job as every exporter's is."""
    require_pyarrow()
    first = next(iter(bake.texels))
    yield sensor_progress(bake, first)
    target = folder / "lerobot"
    (layout, columns), scene = frames_of(bake.recording, bake.sensors), bake.manifests[first].scene_file
    try:
        writer = LeRobotWriter(target, layout, Path(scene).stem if scene else "bake")
        try:
            writer.add(0, bake.recording.digest, columns)
            writer.finish()
        finally:
            writer.close()
    except OSError as error:
        raise FileError(f"'{folder}' could not be written ({os_error_reason(error)}): free some space there.") from error
    return sorted(path for path in target.rglob("*") if path.is_file())


EXPORTER = Exporter("lerobot", write_lerobot)
"""Not among the formats that a .blend may choose."""
