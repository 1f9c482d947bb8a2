# SPDX-License-Identifier: GPL-3.0-or-later
"""A small pad of springs under a ball, written as a rig, in which tests of ``palpate gap`` hide effects."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate.benchmarks._hidden.rig_text import csv_header
from palpate.benchmarks._rows import sure_names
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job

ROWS, COLUMNS, PITCH, RADIUS, K = 5, 3, 4e-3, 14e-3, 60.0
SECONDS, RATE, DEEP = 22.0, 25.0, 2.5e-3
TRIALS = ("fit", "fit", "fit", "fit", "check", "check")

Write = Callable[[str, int, Path], Path]
"""Writes a case of a kind, by its number, into a folder as a rig and returns the path of its TOML file."""


def presses(rng: np.random.Generator) -> np.ndarray:
    """Return a path (T, 3) of the ball's centre: touches at several places, held and repeated."""
    time = np.arange(int(SECONDS * RATE)) / RATE
    knots, at = [(0.0, 0.0, 0.0, -1e-3), (1.0, 0.0, 0.0, -1e-3)], 1.0
    while at < SECONDS - 4.0:
        x, y = rng.uniform(-0.4, 0.4, 2) * np.array([COLUMNS, ROWS]) * PITCH
        deep, quick, hold = DEEP * rng.uniform(0.4, 1.0), rng.uniform(0.3, 1.0), rng.uniform(0.2, 2.0)
        knots += [(at + 0.3, x, y, -1e-3), (at + 0.3 + quick, x, y, deep), (at + 0.3 + quick + hold, x, y, deep)]
        at += 0.6 + 2.0 * quick + hold
        knots.append((at, x, y, -1e-3))
    table = np.array(knots)
    x, y, depth = (np.interp(time, table[:, 0], table[:, i]) for i in (1, 2, 3))
    return np.stack([x, y, RADIUS - depth], axis=1)


def loads(path: np.ndarray) -> np.ndarray:
    """Return forces (T, n) N of springs under the ball."""
    row, column = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    x, y = (column - 0.5 * (COLUMNS - 1)) * PITCH, (row - 0.5 * (ROWS - 1)) * PITCH
    across = (path[:, :1] - x) ** 2 + (path[:, 1:2] - y) ** 2
    high = np.sqrt(np.maximum(RADIUS**2 - across, 0.0))  # of the ball's middle above the point where it meets the texel's line
    return K * np.maximum(high - path[:, 2:], 0.0) * high / RADIUS  # across the ball's surface


def write_recording(file: Path, table: np.ndarray, more: Sequence[str] = ()) -> list[str]:
    """Write the time, the ball's centre, the readings and the columns that `more` names; return the trial's entry in a rig."""
    rows = "\n".join(",".join(f"{value:.7g}" for value in row) for row in table.tolist())
    header = ",".join([csv_header(ROWS * COLUMNS), *more])
    file.write_text(f"{header}\n{rows}\n", encoding="utf-8")
    return ["[[trial]]", f'file = "{file.name}"']


def examined(write: Write, kind: str, number: int) -> tuple[set[str], Any]:
    """Return what is surely named in a case, and the diagnosis."""
    with tempfile.TemporaryDirectory() as folder:
        result = run_job(diagnose(read_rig(write(kind, number, Path(folder)))))
    return sure_names(result), result
