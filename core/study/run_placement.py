# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts a run that no solver computes into the folder of a study, as a whole or not at all, as :mod:`.run_files` does."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Mapping
from math import isfinite
from pathlib import Path
from typing import Any

from ..errors import PalpateError
from ..io.file_writing import sync_file, sync_folder
from .run_files import placed_run
from .run_record import RunRecord, write_run_record
from .study_file import Run

Compute = Callable[[Path], Mapping[str, Any]]
"""Writes files of its own into a folder and returns metrics."""
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)


def place_run(folder: Path, run: Run, compute: Compute, clock: Callable[[], float]) -> None:
    """Let a run be computed in a hidden folder, and put it into its place; an earlier failure of it is removed.

    Parameters
    ----------
    folder : Path
        Of the study.
    run : study_file.Run
    compute : callable
    clock : callable
        Returns seconds.

    Raises
    ------
    FileError
        A file cannot be written.
    PalpateError
        The metrics are no finite numbers by name; and whatever `compute` raises.
    """
    with placed_run(folder, run) as place:
        began = clock()
        metrics = _checked(_computed(compute, place), run)
        write_run_record(RunRecord(place, run.digest, run.index, dict(run.values), metrics, clock() - began))
        _sync_tree(place)


def _computed(compute: Compute, place: Path) -> Mapping[str, Any]:
    try:
        return compute(place)
    except OSError as error:
        if error.errno in _NO_ROOM:
            raise
        raise RuntimeError(f"{type(error).__name__}: {error}") from error  # its own fault: the study's folder is well


def _checked(metrics: Any, run: Run) -> dict[str, float]:
    """Return metrics as numbers; those that are None are left out."""
    if not isinstance(metrics, Mapping):
        raise PalpateError(f"The job gave {metrics!r:.60} for run {run.index}: let its run() return metrics by name.")
    found = {}
    for name, value in metrics.items():
        if value is None:
            continue
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            number = float("nan")
        if not isinstance(name, str) or not isfinite(number):
            raise PalpateError(f"Metric {name!r:.60} of run {run.index} is {value!r:.60}: give finite numbers, or None.")
        found[name] = number
    return found


def _sync_tree(folder: Path) -> None:
    """Bring a folder with all that it holds onto the disk."""
    for parent, _, files in os.walk(folder, topdown=False):
        for name in files:
            sync_file(Path(parent) / name)
        sync_folder(Path(parent))
