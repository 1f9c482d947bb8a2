# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a run as the dataset has them, encoded once: by the process that computes the run.

In a shard a run is a text of JSON, as ``run.json`` says it, with its length and CRC-32 before it, and then its columns. What
all runs of a dataset have in common stands beside them once: the features as JSON, and ``sensor.npz`` of each sensor.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..core.io.npz import DAMAGED, pack_arrays
from ..core.io.sensor_npz import sensor_arrays, unpack_sensor
from ..core.study.run_record import RunRecord, record_bytes, record_in
from .features import Feature, Layout, RunFrames
from .parquet_pages import EncodedColumn, decode_column, encode_column

_HEAD = struct.Struct("<II")
"""Length and CRC-32 of a text of JSON."""
START_BYTES = 1 << 14
"""What is read of a run at first where only its numbers are asked for."""


@dataclass(frozen=True)
class EncodedRun:
    """The frames of a run.

    Attributes
    ----------
    layout : Layout
    rows : int
        Number of frames.
    columns : sequence of EncodedColumn
        Of the layout's `frame_features`, in their order.
    """

    layout: Layout
    rows: int
    columns: Sequence[EncodedColumn]

    def decoded(self, feature: Feature) -> np.ndarray:
        """Return the (F, …) values of one of the layout's `frame_features`; raises ValueError where they are damaged."""
        return decode_column(feature, self.columns[self.layout.frame_features.index(feature)])


def encode_run(frames: RunFrames) -> EncodedRun:
    """Return the frames of a run, encoded; equal frames give equal bytes."""
    columns = [encode_column(feature, frames.columns[feature.name]) for feature in frames.layout.frame_features]
    return EncodedRun(frames.layout, frames.rows, columns)


def pack_run(record: RunRecord, frames: EncodedRun) -> bytes:
    """Return a run as it stands in a shard."""
    columns = [[len(column.content), column.size, column.count] for column in frames.columns]
    text = record_bytes(record, layout=layout_name(frames.layout), columns=columns)
    return b"".join((_HEAD.pack(len(text), zlib.crc32(text)), text, *(column.content for column in frames.columns)))


def layout_name(layout: Layout) -> str:
    """Return the name of a layout in a shard."""
    return layout.digest[:24]


def pack_layout(layout: Layout) -> bytes:
    """Return a layout as it stands in a shard."""
    sensors = [pack_arrays(sensor_arrays(texels)) for texels in layout.texels.values()]
    words = {
        "features": [asdict(item) for item in layout.features],
        "fps": layout.fps,
        "digest": layout.digest,
        "sensors": [[name, len(content)] for name, content in zip(layout.texels, sensors, strict=True)],
    }
    text = json.dumps(words).encode()
    return b"".join((_HEAD.pack(len(text), zlib.crc32(text)), text, *sensors))


def unpack_layout(content: bytes) -> Layout:
    """Return the layout that :func:`pack_layout` packed; raises ValueError where it is damaged."""
    try:
        words, at = _text(content)
        texels = {}
        for name, length in words["sensors"]:
            texels[name] = unpack_sensor(content[at : at + length])[0]
            at += length
        features = tuple(Feature(**{key: _plain(value) for key, value in item.items()}) for item in words["features"])
    except DAMAGED as error:
        raise ValueError(f"{type(error).__name__}: {error}") from error
    return Layout(features, words["fps"], texels, words["digest"])


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def record_of(start: Callable[[int], bytes], place: Path) -> RunRecord:
    """Return the numbers of a run, of whose bytes `start` returns the first; raises ValueError where they are damaged."""
    content = start(START_BYTES)
    if len(content) >= _HEAD.size:
        needed = _HEAD.size + _HEAD.unpack_from(content)[0]
        if needed > len(content):
            content = start(needed)
    return record_in(_text(content)[0], place)


def unpack_run(content: bytes, place: Path, layout_of: Callable[[str], Layout]) -> tuple[RunRecord, EncodedRun]:
    """Return a run in a shard; `layout_of` returns a layout by its name. Raises ValueError where it is damaged."""
    words, at = _text(content)
    whole, columns = memoryview(content), []
    for length, size, count in words["columns"]:
        columns.append(EncodedColumn(whole[at : at + length], size, count))
        at += length
    if at != len(content):
        raise ValueError("its columns have other sizes than it says")
    return record_in(words, place), EncodedRun(layout_of(words["layout"]), words["frames"], columns)


def _text(content: bytes) -> tuple[dict[str, Any], int]:
    """Return the words at the beginning, and the place behind them."""
    if len(content) < _HEAD.size:
        raise ValueError("it is cut")
    length, checksum = _HEAD.unpack_from(content)
    text = content[_HEAD.size : _HEAD.size + length]
    if len(text) != length or zlib.crc32(text) != checksum:
        raise ValueError("its first words are damaged")
    words: dict[str, Any] = json.loads(text.decode("utf-8", "surrogatepass"))
    return words, _HEAD.size + length
