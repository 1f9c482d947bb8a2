# SPDX-License-Identifier: GPL-3.0-or-later
"""A small pad of springs under a ball, written as a rig: what smaller benchmarks of ``palpate gap`` hide their effects in.

It imports nothing of Palpate until a case is diagnosed.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time as clock
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._hidden.rig_text import csv_header
from ._rows import sure_names

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
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs import run_job

    with tempfile.TemporaryDirectory() as folder:
        result = run_job(diagnose(read_rig(write(kind, number, Path(folder)))))
    return sure_names(result), result


def count_named(name: str, write: Write, hidden: Sequence[str], others: Mapping[str, Collection[str]]) -> Iterator[dict]:
    """Count the cases in which an effect is named, alone, and those in which it or another is named wrongly.

    Parameters
    ----------
    name : str
        Of the effect. ``PALPATE_NAME_CASES`` says how many cases have it and how many have not (10 and 10), and
        ``PALPATE_NAME_FIRST`` the number of the first (0; from 5000 on those that nobody looked at).
    write : callable
    hidden : sequence of str
        Kinds of cases that have it.
    others : mapping of str to collection of str
        Kinds of cases that have not, and what the library may call each.
    """
    variable = f"PALPATE_{name.upper().replace('-', '_')}"
    count, first = (int(os.environ.get(f"{variable}_{key}", value)) for key, value in (("CASES", "10"), ("FIRST", "0")))
    started, named, wrong, wrong_without = clock.process_time(), 0, 0, 0
    for number in range(first, first + count):
        kind = hidden[number % len(hidden)]
        sure, result = examined(write, kind, number)
        named += sure == {name}
        wrong += bool(sure - {name})
        _say(kind, number, result)
        kind = list(others)[number % len(others)]
        sure, result = examined(write, kind, number)
        wrong_without += bool(sure - set(others[kind]))
        _say(kind, number, result)
    for what, value in (("named", named), ("something else named", wrong)):
        yield {"name": f"{name}, {what}, of {count} with it", "value": value, "unit": "cases"}
    yield {"name": f"{name}, wrongly named, of {count} without it", "value": wrong_without, "unit": "cases"}
    yield {"name": f"{name}, CPU per case", "value": (clock.process_time() - started) / (2 * count), "unit": "s"}


def _say(kind: str, number: int, result: Any) -> None:
    said = ", ".join(f"{one.name}/{one.form} {one.confidence}" for one in result.findings) or "nothing"
    print(f"{kind} {number}: {said}; {result.verdict}; {result.ambiguous}", file=sys.stderr, flush=True)
