# SPDX-License-Identifier: GPL-3.0-or-later
"""One dataset in the layout of LeRobot v3, written run by run in memory that does not grow with their number.

The layout is that of `lerobot/datasets` in LeRobot 0.6 (codebase version "v3.0"): frames in ``data/chunk-000/file-000.parquet``
and so on, runs ("episodes") in ``meta/episodes``, tasks, features and statistics in ``meta``. LeRobot itself is not needed.
Beyond it, ``meta/texels.parquet`` says where the texels are.

The frames of a long run are taken over as they were encoded when it was computed; those of short runs are encoded together.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.geometry.layout.grid_layout import GridLayout
from ..core.geometry.texels import Texels
from ..core.io.group_sync import sync_file
from ..core.study.run_record import RunRecord
from .encoded_run import EncodedRun
from .features import AXES, TIMESTAMP, Feature, Layout, varied_name
from .parquet_file import Chunk, ParquetFile, chunk_of, chunks_of
from .parquet_pages import encode_column, joined
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
SHORT_BYTES = 1 << 18
"""Size of the largest column of a run, before compression, below which the runs of a group share their pages. A page of its own
costs a run 45 bytes or more for each column, which is most of a short run, and what runs have in common is compressed in each:
300 presses of 100 frames took 2.4 times as much as one archive (benchmark `sweep`)."""
EPISODES_AT_ONCE, EPISODES_OF_GROUP = 1000, 10_000
"""Rows about runs that wait as Python objects, and those of a group in their file."""
COMPRESSION: dict[str, Any] = {"compression": "zstd", "compression_level": 3}

PLACE_COLUMNS = ("frame_index", "episode_index", "index", "task_index")
"""Whole numbers that LeRobot expects in every dataset, and that tell the place of a frame in it."""
INDEX_COLUMNS = {TIMESTAMP.name: TIMESTAMP.dtype, **dict.fromkeys(PLACE_COLUMNS, "int64")}
"""Columns that LeRobot expects in every dataset, with their types."""


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
    file_bytes : int
        Size from which on a file of frames is followed by the next, where it is above :data:`FILE_MEGABYTES`.
    """

    def __init__(self, root: Path, layout: Layout, task: str, file_bytes: int = 0):
        self._root, self._layout, self._task = root, layout, task
        self._features = layout.features
        self._data = _FrameFiles(root, _schema(layout.features), file_bytes)
        self._episodes: _FileSeries | None = None
        self._episode_rows: list[dict[str, Any]] = []
        self._episode_tables: list[pyarrow.Table] = []
        self._waiting: list[EncodedRun] = []
        self._waiting_columns: dict[str, list[Any]] = {name: [] for name in (*PLACE_COLUMNS, *self._constants())}
        self._waiting_bytes = 0
        self._statistics = {item.name: RunningStatistics() for item in layout.features if item.dtype != "string"}
        self._statistics |= {name: RunningStatistics() for name in INDEX_COLUMNS}
        self._runs = self._frames = 0
        (root / "meta").mkdir(parents=True, exist_ok=True)
        _write_texels(root / "meta" / "texels.parquet", layout.texels)

    def _constants(self) -> dict[str, str]:
        """Return names and types of what is the same in all frames of a run."""
        return {item.name: item.dtype for item in self._features if item.is_constant}

    def add(self, run: RunRecord, frames: EncodedRun) -> None:
        """Append the frames of a run.

        Raises
        ------
        ValueError
            They are damaged.
        """
        count = frames.rows
        columns = {
            "frame_index": np.arange(count),
            "episode_index": np.full(count, self._runs),
            "index": np.arange(self._frames, self._frames + count),
            "task_index": np.zeros(count, dtype=np.int64),
        }
        for name, own in columns.items():
            self._waiting_columns[name].append(own)
        for name, value in run.values.items():
            self._waiting_columns[varied_name(name)] += [value] * count
        self._waiting.append(frames)
        self._waiting_bytes += sum(column.size for column in frames.columns)
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
            self._pack_episodes()

    def abandon(self) -> None:
        """Let go of all files after an error."""
        for series in (self._data, self._episodes):
            if series is not None:
                series.abandon()

    def finish(self) -> None:
        """Write what still waits, and the files that describe the dataset."""
        self._flush_frames()
        self._pack_episodes()
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
        constants = self._constants()
        columns: dict[str, Any] = {
            name: parts if name in constants else np.concatenate(parts) for name, parts in self._waiting_columns.items()
        }
        small = pyarrow.table(columns, _small_schema(self._data.schema, columns))
        chunks = chunks_of(small, **COMPRESSION, **_encodings(list(constants)))
        for name, values in columns.items():
            if name in self._statistics:
                self._statistics[name].add(np.asarray(values))
        for number, feature in enumerate(self._layout.frame_features):
            own = [run.columns[number] for run in self._waiting]
            values = np.concatenate([run.decoded(feature) for run in self._waiting])
            is_short = max(column.size for column in own) < SHORT_BYTES
            chunks[feature.name] = chunk_of(feature, encode_column(feature, values) if is_short else joined(own))
            self._statistics[feature.name].add(values)
        self._data.write(chunks, sum(run.rows for run in self._waiting))
        self._waiting, self._waiting_bytes = [], 0
        self._waiting_columns = {name: [] for name in self._waiting_columns}

    def _pack_episodes(self) -> None:
        """Let the waiting rows about runs wait as a table, which takes a tenth of the memory."""
        import pyarrow

        if not self._episode_rows:
            return
        if self._episodes is None:
            numbers = [(name, pyarrow.int64()) for name in self._episode_rows[0] if name not in ("tasks", "digest")]
            places = [(f"meta/episodes/{kind}_index", pyarrow.int64()) for kind in ("chunk", "file")]
            texts = [("tasks", pyarrow.list_(pyarrow.string())), ("digest", pyarrow.string())]
            self._episodes = _FileSeries(self._root, EPISODES_PATH, pyarrow.schema([*numbers, *texts, *places]))
        chunk, file = self._episodes.place
        rows = [{**row, "meta/episodes/chunk_index": chunk, "meta/episodes/file_index": file} for row in self._episode_rows]
        self._episode_tables.append(pyarrow.Table.from_pylist(rows, self._episodes.schema))
        self._episode_rows = []
        if sum(map(len, self._episode_tables)) >= EPISODES_OF_GROUP:
            self._flush_episodes()

    def _flush_episodes(self) -> None:
        """Write the waiting tables about runs as one group of rows."""
        import pyarrow

        if self._episodes is not None and self._episode_tables:
            self._episodes.write(pyarrow.concat_tables(self._episode_tables).combine_chunks())
            self._episode_tables = []

    def _info(self) -> dict[str, Any]:
        fps = self._layout.fps
        return {
            "codebase_version": VERSION,
            "robot_type": None,
            "total_episodes": self._runs,
            "total_frames": self._frames,
            "total_tasks": 1,
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": FILE_MEGABYTES,
            "video_files_size_in_mb": 200,  # LeRobot's own; there are no videos
            "fps": int(fps) if fps == int(fps) else fps,
            "splits": {"train": f"0:{self._runs}"},
            "data_path": DATA_PATH,
            "video_path": None,
            "features": {
                **{item.name: _described(item) for item in self._features},
                **{name: {"dtype": dtype, "shape": [1], "names": None} for name, dtype in INDEX_COLUMNS.items()},
            },
        }


class _FrameFiles:
    """Files of frames that follow each other, one when the one before has reached its size."""

    def __init__(self, root: Path, schema: pyarrow.Schema, file_bytes: int):
        self._root, self.schema, self._file_bytes = root, schema, file_bytes
        self._number = 0
        self._file: ParquetFile | None = None

    @property
    def place(self) -> tuple[int, int]:
        """Numbers of the folder and of the file that is written next."""
        return divmod(self._number, FILES_PER_CHUNK)

    def write(self, chunks: dict[str, Chunk], rows: int) -> None:
        """Write a group of rows."""
        if self._file is None:
            self._file = ParquetFile(_file_in(self._root, DATA_PATH, self.place), self.schema)
        self._file.write(chunks, rows)
        if self._file.size >= max(FILE_MEGABYTES << 20, self._file_bytes):
            self.close()

    def close(self) -> None:
        """Finish the present file, if there is one."""
        if self._file is not None:
            self._file.close()
            self._file = None
            self._number += 1

    def abandon(self) -> None:
        """Let go of the present file after an error."""
        if self._file is not None:
            self._file.abandon()
            self._file = None


class _FileSeries:
    """Parquet files of rows about runs that follow each other, one when the one before has reached :data:`FILE_MEGABYTES`."""

    def __init__(self, root: Path, pattern: str, schema: pyarrow.Schema):
        self._root, self._pattern, self.schema = root, pattern, schema
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
            self._path = _file_in(self._root, self._pattern, self.place)
            self._sink = open(self._path, "wb")  # noqa: SIM115 -- it stays open until the file is full
            self._writer = parquet.ParquetWriter(self._sink, self.schema, **COMPRESSION)
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


def _file_in(root: Path, pattern: str, place: tuple[int, int]) -> Path:
    """Return the path of a file of a series, whose folder is made."""
    path = root / pattern.format(chunk_index=place[0], file_index=place[1])
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def _encodings(constants: list[str]) -> dict[str, Any]:
    """Return how small columns are encoded: numbers that count up by their differences, those that repeat by a dictionary."""
    encodings = dict.fromkeys(("index", "frame_index"), "DELTA_BINARY_PACKED")
    return {"use_dictionary": [*constants, "episode_index", "task_index"], "column_encoding": encodings}


def _small_schema(schema: pyarrow.Schema, names: Iterable[str]) -> pyarrow.Schema:
    import pyarrow

    return pyarrow.schema([schema.field(name) for name in names])


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
