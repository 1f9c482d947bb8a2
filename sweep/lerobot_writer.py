# SPDX-License-Identifier: GPL-3.0-or-later
"""One dataset in the layout of LeRobot v3, written run by run in memory that does not grow with their number.

The layout is that of `lerobot/datasets` in LeRobot 0.6 (codebase version "v3.0"): frames in ``data/chunk-000/file-000.parquet``
and so on, runs ("episodes") in ``meta/episodes``, tasks, features and statistics in ``meta``. LeRobot itself is not needed.
Beyond it, ``meta/texels.parquet`` says where the texels are.
"""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.geometry.layout.grid_layout import GridLayout
from ..core.geometry.texels import Texels
from ..core.io.file_writing import sync_file
from ..core.study.run_record import RunRecord
from .features import AXES, Feature, RunFrames
from .running_statistics import RunningStatistics

if TYPE_CHECKING:
    import pyarrow

VERSION = "v3.0"
FILE_MEGABYTES, FILES_PER_CHUNK = 100, 1000
"""Size from which on a file of frames is followed by the next, and files in a folder: LeRobot's own."""
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
ROW_GROUP_BYTES = 8 << 20
"""Numbers that wait in memory until they become a group of rows: whole runs, so that a run can be read by itself."""
EPISODES_AT_ONCE = 10_000
"""Rows about runs that wait in memory."""
COMPRESSION: dict[str, Any] = {"compression": "zstd", "compression_level": 3}

INDEX_COLUMNS = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""Columns that LeRobot expects in every dataset, with their types."""


class LeRobotWriter:
    """Writes one dataset.

    Parameters
    ----------
    root : Path
        A folder that is empty or is made.
    first : RunFrames
        A run of it; the others have the same `layout_digest`.
    task : str
        What LeRobot calls the task, the same for all runs.
    """

    def __init__(self, root: Path, first: RunFrames, task: str):
        self._root, self._features, self._fps, self._task = root, first.features, first.fps, task
        self._schema = _schema(first.features)
        self._data = _FileSeries(root, DATA_PATH, self._schema, first.features)
        self._episodes: _FileSeries | None = None
        self._episode_rows: list[dict[str, Any]] = []
        self._waiting: list[dict[str, Any]] = []
        self._waiting_bytes = 0
        self._statistics = {item.name: RunningStatistics() for item in first.features if item.dtype != "string"}
        self._statistics |= {name: RunningStatistics() for name in INDEX_COLUMNS}
        self._runs = self._frames = 0
        (root / "meta").mkdir(parents=True, exist_ok=True)
        _write_texels(root / "meta" / "texels.parquet", first.texels)

    def add(self, run: RunRecord, frames: RunFrames) -> None:
        """Append the frames of a run."""
        count = len(frames.times)
        columns: dict[str, Any] = {
            "timestamp": frames.times.astype(np.float32),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, self._runs),
            "index": np.arange(self._frames, self._frames + count),
            "task_index": np.zeros(count, dtype=np.int64),
            **frames.columns,
        }
        self._waiting.append(columns)
        self._waiting_bytes += sum(values.nbytes for values in columns.values() if isinstance(values, np.ndarray))
        chunk, file = self._data.place
        episode = {
            "episode_index": self._runs,
            "tasks": [self._task],
            "length": count,
            "data/chunk_index": chunk,
            "data/file_index": file,
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + count,
            "run": run.index,
            "digest": run.digest,
        }
        self._episode_rows.append(episode)
        self._runs += 1
        self._frames += count
        if self._waiting_bytes >= ROW_GROUP_BYTES:
            self._flush_frames()
        if len(self._episode_rows) >= EPISODES_AT_ONCE:
            self._flush_episodes()

    def abandon(self) -> None:
        """Let go of all files after an error."""
        for series in (self._data, self._episodes):
            if series is not None:
                series.abandon()

    def finish(self) -> None:
        """Write what still waits, and the files that describe the dataset."""
        self._flush_frames()
        self._flush_episodes()
        self._data.close()
        if self._episodes is not None:
            self._episodes.close()
        meta = self._root / "meta"
        _write_tasks(meta / "tasks.parquet", self._task)
        info = self._info()
        _write_json(meta / "info.json", info)
        _write_card(self._root / "README.md", self._task, info)
        _write_json(meta / "stats.json", {name: found.result() for name, found in self._statistics.items()})

    def _flush_frames(self) -> None:
        """Write the waiting runs as one group of rows, and take them into account in the statistics."""
        import pyarrow

        if not self._waiting:
            return
        columns: dict[str, Any] = {}
        for name in [*INDEX_COLUMNS, *(item.name for item in self._features)]:
            parts = [one[name] for one in self._waiting]
            if isinstance(parts[0], str):
                columns[name] = [part for one, part in zip(self._waiting, parts) for _ in range(len(one["index"]))]
            else:
                columns[name] = np.concatenate(parts)
        self._waiting, self._waiting_bytes = [], 0
        for name, statistics in self._statistics.items():
            statistics.add(columns[name])
        self._data.write(pyarrow.Table.from_batches([_batch(self._schema, self._features, columns)]))

    def _flush_episodes(self) -> None:
        import pyarrow

        if not self._episode_rows:
            return
        if self._episodes is None:
            numbers = [(name, pyarrow.int64()) for name in self._episode_rows[0] if name not in ("tasks", "digest")]
            places = [(f"meta/episodes/{kind}_index", pyarrow.int64()) for kind in ("chunk", "file")]
            texts = [("tasks", pyarrow.list_(pyarrow.string())), ("digest", pyarrow.string())]
            self._episodes = _FileSeries(self._root, EPISODES_PATH, pyarrow.schema([*numbers, *texts, *places]), ())
        chunk, file = self._episodes.place
        rows = [{**row, "meta/episodes/chunk_index": chunk, "meta/episodes/file_index": file} for row in self._episode_rows]
        self._episodes.write(pyarrow.Table.from_pylist(rows, self._episodes.schema))
        self._episode_rows = []

    def _info(self) -> dict[str, Any]:
        return {
            "codebase_version": VERSION,
            "robot_type": None,
            "total_episodes": self._runs,
            "total_frames": self._frames,
            "total_tasks": 1,
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": FILE_MEGABYTES,
            "video_files_size_in_mb": 200,  # LeRobot's own; there are no videos
            "fps": int(self._fps) if self._fps == int(self._fps) else self._fps,
            "splits": {"train": f"0:{self._runs}"},
            "data_path": DATA_PATH,
            "video_path": None,
            "features": {
                **{item.name: _described(item) for item in self._features},
                **{name: {"dtype": dtype, "shape": [1], "names": None} for name, dtype in INDEX_COLUMNS.items()},
            },
        }


class _FileSeries:
    """Parquet files that follow each other, one when the one before has reached :data:`FILE_MEGABYTES`."""

    def __init__(self, root: Path, pattern: str, schema: pyarrow.Schema, features: tuple[Feature, ...]):
        self._root, self._pattern, self.schema = root, pattern, schema
        self._options = _encodings(features)
        self._number = 0
        self._writer: Any = None
        self._sink: Any = None

    @property
    def place(self) -> tuple[int, int]:
        """Numbers of the folder and of the file that is written next."""
        return divmod(self._number, FILES_PER_CHUNK)

    def write(self, table: pyarrow.Table) -> None:
        """Write a table as one group of rows."""
        from pyarrow import parquet

        if self._writer is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._sink = open(self._path, "wb")  # noqa: SIM115 -- it stays open until the file is full
            self._writer = parquet.ParquetWriter(self._sink, self.schema, **COMPRESSION, **self._options)
        self._writer.write_table(table, row_group_size=len(table))
        if self._sink.tell() >= FILE_MEGABYTES << 20:
            self.close()

    def close(self) -> None:
        """Finish the present file, if there is one."""
        if self._writer is not None:
            self._writer.close()
            self._sink.close()
            self._writer = self._sink = None
            sync_file(self._path)
            self._number += 1

    def abandon(self) -> None:
        """Let go of the present file after an error; pyarrow would try to complete it later and print that this fails."""
        if self._writer is not None:
            self._writer.is_open = False
            with suppress(OSError):  # what could not be written is still in its buffer
                self._sink.close()
            self._writer = self._sink = None

    @property
    def _path(self) -> Path:
        chunk, file = self.place
        return self._root / self._pattern.format(chunk_index=chunk, file_index=file)


def _encodings(features: tuple[Feature, ...]) -> dict[str, Any]:
    """Return how columns are encoded.

    The bytes of numbers that change from frame to frame are split by their place in the number, which makes them compress
    better; of numbers that count up, the differences are stored; numbers that repeat become a dictionary.
    """
    if not features:
        return {}
    floats = [item for item in features if item.dtype == "float32"]
    encodings = {item.name + ".list.element" * len(item.shape): "BYTE_STREAM_SPLIT" for item in floats}
    encodings |= dict.fromkeys(("index", "frame_index"), "DELTA_BINARY_PACKED")
    names = [item.name for item in features if item.is_constant] + ["episode_index", "task_index"]
    return {"use_dictionary": names, "column_encoding": encodings}


def _schema(features: tuple[Feature, ...]) -> pyarrow.Schema:
    import pyarrow

    columns = [(name, pyarrow.type_for_alias(dtype)) for name, dtype in INDEX_COLUMNS.items()]
    return pyarrow.schema([*columns, *((item.name, _arrow_type(item)) for item in features)])


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


def _batch(schema: pyarrow.Schema, features: tuple[Feature, ...], columns: dict[str, Any]) -> pyarrow.RecordBatch:
    import pyarrow

    arrays = [pyarrow.array(columns[name]) for name in INDEX_COLUMNS]
    for feature in features:
        values = columns[feature.name]
        arrays.append(pyarrow.array(values, pyarrow.string()) if feature.dtype == "string" else _nested(values, feature))
    return pyarrow.record_batch(arrays, schema=schema)


def _nested(values: np.ndarray, feature: Feature) -> pyarrow.Array:
    """Return (F, …) values as an array of lists of lists, without a Python object for each of them."""
    import pyarrow

    array = pyarrow.array(values.reshape(-1))
    if feature.shape == (1,):
        return array
    if len(feature.shape) == 1:
        return pyarrow.FixedSizeListArray.from_arrays(array, feature.shape[0])
    for length in reversed(feature.shape):
        starts = pyarrow.array(np.arange(0, len(array) + 1, length, dtype=np.int32))
        array = pyarrow.ListArray.from_arrays(starts, array)
    return array


def _described(feature: Feature) -> dict[str, Any]:
    """Return what ``info.json`` says of a feature: LeRobot's keys, and unit and meaning under a key of ours."""
    about: dict[str, Any] = {"about": feature.about}
    if feature.unit:
        about["unit"] = feature.unit
    if feature.channels:
        about["channels"] = feature.channels
    names = list(feature.names) or None
    return {"dtype": feature.dtype, "shape": list(feature.shape), "names": names, "palpate": about}


def _write_card(path: Path, task: str, info: dict[str, Any]) -> None:
    """Write the dataset's card, whose first lines tell the library `datasets` which files are the frames."""
    title = " ".join(task.replace("#", " ").split())
    lines = [
        "---",
        "tags: [LeRobot, tactile]",
        "configs:",
        "- config_name: default",
        "  data_files: data/*/*.parquet",
        "---",
        "",
    ]
    lines += [
        f"# {title}",
        "",
        f"{info['total_frames']} frames of {info['total_episodes']} runs, simulated with Palpate, in the",
    ]
    lines += ["layout of LeRobot v3. `meta/texels.parquet` says where the texels are.", ""]
    lines += ["| feature | type | shape | unit | meaning |", "| --- | --- | --- | --- | --- |"]
    for name, feature in info["features"].items():
        own = feature.get("palpate", {})
        shape = " × ".join(map(str, feature["shape"]))
        cells = (f"`{name}`", feature["dtype"], shape, own.get("unit", ""), own.get("about", "A column of LeRobot."))
        lines.append("| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    sync_file(path)


def _write_texels(path: Path, texels: dict[str, Texels]) -> None:
    """Write where the texels of all sensors are: a row each, in the frames of their bodies, metres."""
    import pyarrow

    columns: dict[str, list[Any]] = {"sensor": [], "texel": [], "row": [], "column": [], "area": []}
    columns |= {f"{what}_{axis}": [] for what in ("position", "normal", "tangent") for axis in AXES}
    for name, own in texels.items():
        grid = own.layout if isinstance(own.layout, GridLayout) else None
        columns["sensor"] += [name] * len(own)
        columns["texel"] += range(len(own))
        columns["row"] += [None] * len(own) if grid is None else grid.row.tolist()
        columns["column"] += [None] * len(own) if grid is None else grid.column.tolist()
        columns["area"] += own.area.tolist()
        for what in ("position", "normal", "tangent"):
            for axis, values in zip(AXES, getattr(own, what).T):
                columns[f"{what}_{axis}"] += values.tolist()
    kinds = {"sensor": pyarrow.string(), "texel": pyarrow.int64(), "row": pyarrow.int64(), "column": pyarrow.int64()}
    schema = pyarrow.schema([(name, kinds.get(name, pyarrow.float64())) for name in columns])
    _write_table(path, pyarrow.table(columns, schema))


def _write_tasks(path: Path, task: str) -> None:
    """Write the only task; LeRobot reads its text from the index that pandas makes of the column."""
    import pyarrow

    kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_kind, "metadata": None}
        for name, (kind, numpy_kind) in kinds.items()
    ]
    note = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
    schema = pyarrow.schema([("task_index", pyarrow.int64()), ("task", pyarrow.string())], {"pandas": json.dumps(note)})
    _write_table(path, pyarrow.table({"task_index": [0], "task": [task]}, schema))


def _write_table(path: Path, table: pyarrow.Table) -> None:
    from pyarrow import parquet

    parquet.write_table(table, path, **COMPRESSION)
    sync_file(path)


def _write_json(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8", newline="\n")
    sync_file(path)
