# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on recordings with a column of temperatures: what follows the temperature is named, and nothing else is.

A ball presses a small pad while the room warms and cools. Gain, zero or both follow the temperature by formulas that the
library does not have: a reciprocal gain with a square in it, a zero that bends and is a little different in each texel. In as
many cases something else is hidden, or nothing: a zero that moves with the time, a lag, gains of texels.
``PALPATE_TEMPERATURE_CASES`` says how many there are (10 and 10), ``PALPATE_TEMPERATURE_FIRST`` the number of the first (0;
from 5000 on those that nobody looked at).
"""

from __future__ import annotations

import os
import sys
import tempfile
import time as clock
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ._hidden.rig_text import csv_header, rig_head

ROWS, COLUMNS, PITCH, RADIUS, K = 5, 3, 4e-3, 14e-3, 60.0
SECONDS, RATE, DEEP = 22.0, 25.0, 2.5e-3
TRIALS = ("fit", "fit", "fit", "fit", "check", "check")
FOLLOWING = ("gain", "zero", "both")
OTHERS = {"nothing": "", "drift": "drift", "lag": "lag", "gains": "gain-mismatch"}
"""What else is hidden, and what the library calls it."""

Reading = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


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


def follows(kind: str, rng: np.random.Generator, full: float) -> Reading:
    """Return how readings of forces follow the temperature, from (T, n) N, (T,) s and (T,) °C."""
    a, b = rng.uniform(0.012, 0.03) * rng.choice([-1, 1]), rng.uniform(0.006, 0.02) * full * rng.choice([-1, 1])
    spread = 1.0 + 0.1 * rng.normal(size=ROWS * COLUMNS)

    def act(force: np.ndarray, time: np.ndarray, warmth: np.ndarray) -> np.ndarray:
        above = warmth[:, None] - 22.0
        found = force / (1.0 + a * above + 0.004 * a * above**2) if kind != "zero" else force
        return np.asarray(found + b * above * (1.0 + 0.01 * above) * spread if kind != "gain" else found)

    return act


def other(kind: str, rng: np.random.Generator, full: float) -> Reading:
    """Return another effect, which the temperature does not concern."""
    most, tau = rng.uniform(0.1, 0.2) * full * rng.choice([-1, 1]), rng.uniform(0.1, 0.25)
    gains = np.exp(0.2 * rng.normal(size=ROWS * COLUMNS))

    def act(force: np.ndarray, time: np.ndarray, warmth: np.ndarray) -> np.ndarray:
        if kind == "drift":
            return force + most * ((time - time[0])[:, None] / SECONDS) ** 0.8
        if kind == "gains":
            return force * gains
        found = force.copy()
        if kind == "lag":
            for i in range(1, len(force)):
                found[i] = found[i - 1] + (1.0 - np.exp(-1.0 / RATE / tau)) * (force[i] - found[i - 1])
        return found

    return act


def write(kind: str, number: int, folder: Path) -> Path:
    """Write a case as a rig and return the path of its TOML file."""
    rng = np.random.default_rng([16, number])
    paths = [presses(rng) for _ in TRIALS]
    forces = [loads(path) for path in paths]
    full = max(float(force.max()) for force in forces)
    act = follows(kind, rng, full) if kind in FOLLOWING else other(kind, rng, full)
    words = {"k": round(K * rng.uniform(0.95, 1.05), 2), "cn": 0.0, "unit": "N", "gain": 1.0, "zero": 0.0}
    lines = rig_head("pad in a room", (ROWS, COLUMNS, PITCH), words, RADIUS)
    folder.mkdir(parents=True, exist_ok=True)
    for i, (use, path, force) in enumerate(zip(TRIALS, paths, forces, strict=True)):
        time = np.arange(len(path)) / RATE
        warmth = rng.uniform(15.0, 32.0) + rng.uniform(-4.0, 4.0) * np.sin(2.0 * np.pi * time / rng.uniform(15.0, 60.0))
        reading = act(force, time, warmth) + 0.005 * full * rng.normal(size=force.shape)
        table = np.column_stack([time, path, reading, warmth + 0.02 * rng.normal(size=len(time))])
        rows = "\n".join(",".join(f"{value:.7g}" for value in row) for row in table.tolist())
        header = f"{csv_header(ROWS * COLUMNS)},temperature"
        (folder / f"trial_{i}.csv").write_text(f"{header}\n{rows}\n", encoding="utf-8")
        lines += ["[[trial]]", f'file = "trial_{i}.csv"', f'use = "{use}"']
    path_of_rig = folder / "rig.toml"
    path_of_rig.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path_of_rig


def examined(kind: str, number: int) -> tuple[set[str], Any]:
    """Return what is surely named in a case, and the diagnosis."""
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.report.sentences import SURE
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs.job_runner import run_job

    with tempfile.TemporaryDirectory() as folder:
        result = run_job(diagnose(read_rig(write(kind, number, Path(folder)))))
    return {one.name for one in result.findings if one.confidence >= SURE}, result


def run() -> Iterator[dict]:
    """Count the cases in which temperature is named, alone, and those in which it is named wrongly."""
    count, first = (
        int(os.environ.get(f"PALPATE_TEMPERATURE_{key}", value)) for key, value in (("CASES", "10"), ("FIRST", "0"))
    )
    started, named, wrong, others = clock.process_time(), 0, 0, 0
    for number in range(first, first + count):
        kind = FOLLOWING[number % len(FOLLOWING)]
        sure, result = examined(kind, number)
        named += sure == {"temperature"}
        wrong += bool(sure - {"temperature"})
        _say(kind, number, result)
        kind = list(OTHERS)[number % len(OTHERS)]
        sure, result = examined(kind, number)
        others += bool(sure - {OTHERS[kind]})
        _say(kind, number, result)
    for what, value in (("named", named), ("something else named", wrong)):
        yield {"name": f"temperature, {what}, of {count} that follow it", "value": value, "unit": "cases"}
    yield {"name": f"temperature, wrongly named, of {count} that do not follow it", "value": others, "unit": "cases"}
    yield {"name": "temperature, CPU per case", "value": (clock.process_time() - started) / (2 * count), "unit": "s"}


def _say(kind: str, number: int, result: Any) -> None:
    said = ", ".join(f"{one.name}/{one.form} {one.confidence}" for one in result.findings) or "nothing"
    print(f"{kind} {number}: {said}; {result.verdict}", file=sys.stderr, flush=True)
