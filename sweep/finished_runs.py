# SPDX-License-Identifier: GPL-3.0-or-later
"""The runs of a study as they stand in its folder: those that finished, those that failed, and the study itself.

A finished run is the folder ``runs/<digest>`` with ``run.json`` in it, and one folder for each sensor. A failed run is the
file ``failed/<digest>.txt``, whose first line says why; ``failed/<digest>.json`` beside it, where there is one, says which run
it was.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any

from ..core.errors import FileError
from ..core.io.file_writing import os_error_reason
from ..core.io.regular_file import read_bytes
from ..core.io.toml_file import read_toml

RUN_FORMAT = "palpate-run/1"
RUN_NAME = "run.json"
STUDY_NAME = "study.toml"
RUNS_FOLDER, FAILED_FOLDER = "runs", "failed"
UNNAMED_STUDY = "study of a tactile sensor"
"""Name of a study whose file gives none. The name of its folder does not serve, so that equal studies give equal files."""

Value = float | str
"""What a run may vary: a number, or a name from a choice. Whole numbers and switches count as numbers."""


@dataclass(frozen=True)
class FinishedRun:
    """One finished run, without its recordings.

    Attributes
    ----------
    folder : Path
    digest : str
        Name of the folder.
    index : int
        Place of the run in the design.
    values : dict of str to float or str
        What was varied, in the order of the study.
    metrics : dict of str to float
        Numbers that summarise the run; a metric that has no value in it (no slip, no time of first slip) is missing.
    seconds : float
        Time that computing took. No result depends on it.
    sensors : tuple of str
    """

    folder: Path
    digest: str
    index: int
    values: dict[str, Value] = field(default_factory=dict)
    metrics: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    sensors: tuple[str, ...] = ()


@dataclass(frozen=True)
class FailedRun:
    """One run that failed: why, in one sentence, and which one it was, as far as the folder says so."""

    digest: str
    sentence: str
    index: int | None = None
    values: dict[str, Value] = field(default_factory=dict)


def run_order(folder: Path) -> list[tuple[int, str]]:
    """Return index and digest of each finished run, in the order of the design, whatever the order of finishing.

    This is all of a study that is in memory at once.

    Raises
    ------
    FileError
        There is no study in the folder, or a run is damaged.
    """
    runs = folder / RUNS_FOLDER
    if not (folder / STUDY_NAME).is_file():
        raise FileError(f"'{folder}' holds no study: give the folder that `palpate sweep` wrote.")
    if not runs.is_dir():
        return []
    found = [path for path in runs.iterdir() if not path.name.startswith(".") and (path / RUN_NAME).is_file()]
    return sorted((read_run(path).index, path.name) for path in found)


def finished_runs(folder: Path, order: list[tuple[int, str]] | None = None) -> Iterator[FinishedRun]:
    """Yield the finished runs in the order of the design.

    Parameters
    ----------
    folder : Path
        Of the study.
    order : list, optional
        What :func:`run_order` returned, to read the same runs again though more may have finished.

    Raises
    ------
    FileError
        As :func:`run_order`.
    """
    for _, digest in run_order(folder) if order is None else order:
        yield read_run(folder / RUNS_FOLDER / digest)


def read_run(folder: Path) -> FinishedRun:
    """Read ``run.json`` in the folder of a run.

    Raises
    ------
    FileError
        It cannot be read, or it is not one that this version reads.
    """
    path = folder / RUN_NAME
    content = _read_json(path)
    if not isinstance(content, dict) or content.get("format") != RUN_FORMAT:
        raise FileError(f"'{path}' is not a '{RUN_FORMAT}' file: delete the folder '{folder.name}' and run the sweep again.")
    try:
        sensors = content["sensors"]
        if not isinstance(sensors, list) or not all(isinstance(name, str) for name in sensors):
            raise TypeError("its sensors are no names")
        return FinishedRun(
            folder=folder,
            digest=folder.name,
            index=int(content["index"]),
            values=_values(content["values"]),
            metrics=_numbers(content["metrics"]),
            seconds=float(content.get("seconds", 0.0)),
            sensors=tuple(sensors),
        )
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise FileError(f"'{path}' is damaged ({error}): delete the folder '{folder.name}' and run the sweep again.") from error


def failed_runs(folder: Path) -> list[FailedRun]:
    """Return the failed runs of a study, those with a known place in the design first, in its order.

    Raises
    ------
    FileError
        A file cannot be read.
    """
    found = [_failed_run(path) for path in sorted((folder / FAILED_FOLDER).glob("[!.]*.txt"))]
    return sorted(found, key=lambda run: (run.index is None, run.index or 0, run.digest))


def _failed_run(path: Path) -> FailedRun:
    try:
        text = read_bytes(path).decode("utf-8", "replace")
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): check its permissions.") from error
    sentence = next((line.strip() for line in text.splitlines() if line.strip()), "The run failed and left no message.")
    about = path.with_suffix(".json")
    content = _read_json(about) if about.is_file() else {}
    try:
        index = content.get("index")
        return FailedRun(path.stem, sentence, None if index is None else int(index), _values(content.get("values", {})))
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        raise FileError(f"'{about}' is damaged ({error}): delete it.") from error


def study_name(folder: Path) -> str:
    """Return the name that the study's file gives, :data:`UNNAMED_STUDY` where it gives none.

    Raises
    ------
    FileError
        The file is missing or no TOML.
    """
    study = read_toml(folder / STUDY_NAME, "study")
    name = study.get("name")
    return name if isinstance(name, str) and name.strip() else UNNAMED_STUDY


def _read_json(path: Path) -> Any:
    try:
        return json.loads(read_bytes(path))
    except OSError as error:
        raise FileError(f"'{path}' could not be read ({os_error_reason(error)}): check its permissions.") from error
    except (ValueError, RecursionError) as error:
        raise FileError(f"'{path}' is damaged (no JSON): delete the folder '{path.parent.name}' and sweep again.") from error


def _values(content: dict[str, Any]) -> dict[str, Value]:
    return {name: value if isinstance(value, str) else _finite(name, value) for name, value in content.items()}


def _numbers(content: dict[str, Any]) -> dict[str, float]:
    """Return the metrics that have a value; those without are written as null."""
    return {name: _finite(name, value) for name, value in content.items() if value is not None}


def _finite(name: str, value: Any) -> float:
    number = float(value)
    if not isfinite(number):
        raise ValueError(f"{name} is {value}")
    return number
