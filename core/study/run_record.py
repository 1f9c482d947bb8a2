# SPDX-License-Identifier: GPL-3.0-or-later
"""``run.json``: values and metrics of a run; written with its recordings, read for tables and datasets."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import FileError
from ..io.group_sync import write_hashed
from ..io.schema import Number, read_json

RUN_FORMAT = "palpate-run/1"
RUN_NAME = "run.json"

Value = float | str
"""A varied value, as it is read: a number, or a name from a choice. Whole numbers and switches count as numbers."""


@dataclass(frozen=True)
class RunRecord:
    """One finished run, without its recordings.

    Attributes
    ----------
    folder : Path
    digest : str
        Name of the folder of a finished run.
    index : int
        Place of the run in the design.
    values : dict of str to value
        What was varied, in the order of the study.
    metrics : dict of str to float
        Numbers that sum the run up; a metric that has no value in it (no slip, no time of first slip) is missing.
    seconds : float
        Time that computing took. No result depends on it.
    sensors : tuple of str
    frames : int
        Frames of the recordings.
    """

    folder: Path
    digest: str
    index: int
    values: dict[str, Any] = field(default_factory=dict)
    metrics: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    sensors: tuple[str, ...] = ()
    frames: int = 0


def write_run_record(record: RunRecord) -> None:
    """Write ``run.json`` into the folder of a record that is not yet in its place.

    Raises
    ------
    OSError
        It cannot be written.
    """
    write_hashed(record.folder / RUN_NAME, record_bytes(record))


def record_bytes(record: RunRecord, **more: Any) -> bytes:
    """Return what ``run.json`` says of a run, with more words where it stands in a shard."""
    content = {
        "format": RUN_FORMAT,
        "digest": record.digest,
        "index": record.index,
        "values": record.values,
        "metrics": record.metrics,
        "seconds": round(record.seconds, 6),
        "frames": record.frames,
        "sensors": list(record.sensors),
        **more,
    }
    text = json.dumps(content, ensure_ascii=False, allow_nan=False) + "\n"
    return text.encode("utf-8", "surrogatepass")


def record_in(words: dict[str, Any], folder: Path) -> RunRecord:
    """Return the run that :func:`record_bytes` describes, in words that were found whole."""
    values, metrics = values_read(words["values"]), words["metrics"]
    numbers = words["seconds"], tuple(words["sensors"]), words["frames"]
    return RunRecord(folder, words["digest"], words["index"], values, metrics, *numbers)


def read_run_record(folder: Path) -> RunRecord:
    """Read ``run.json`` in the folder of a run.

    Raises
    ------
    FileError
        It cannot be read, or it is not one that this version reads.
    """
    path = folder / RUN_NAME
    try:
        found, _ = read_json(path, _RunFile, RUN_FORMAT, f"delete the folder '{folder.name}' and run the sweep again")
    except FileNotFoundError as error:
        raise FileError(f"'{path}' is missing: delete the folder '{folder.name}' and run the sweep again.") from error
    metrics = {name: value for name, value in found.metrics.items() if value is not None}
    values = values_read(found.values)
    return RunRecord(folder, folder.name, found.index, values, metrics, found.seconds, found.sensors, found.frames)


@dataclass
class _RunFile:
    """What a ``run.json`` has to say."""

    index: int
    values: dict[str, bool | Number | str]
    metrics: dict[str, Number | None]
    sensors: tuple[str, ...]
    seconds: float = 0.0
    frames: int = 0


def values_read(content: dict[str, Any]) -> dict[str, Value]:
    """Return what was varied, with all numbers as floats."""
    return {name: value if isinstance(value, str) else float(value) for name, value in content.items()}
