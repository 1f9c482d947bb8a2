# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on recordings with a column of temperatures: what follows the temperature is named, and nothing else is.

A ball presses a small pad while the room warms and cools. Gain, zero or both follow the temperature by formulas that the
library does not have: a reciprocal gain with a square in it, a zero that bends and is a little different in each texel. In as
many cases something else is hidden, or nothing: a zero that moves with the time, a lag, gains of texels.
``PALPATE_TEMPERATURE_CASES`` and ``PALPATE_TEMPERATURE_FIRST`` say which cases (:func:`._small_pad.count_named`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ._hidden.rig_text import rig_head
from ._small_pad import (
    COLUMNS,
    PITCH,
    RADIUS,
    RATE,
    ROWS,
    SECONDS,
    TRIALS,
    K,
    count_named,
    loads,
    presses,
    write_recording,
)

FOLLOWING = ("gain", "zero", "both")
OTHERS = {"nothing": (), "drift": ("drift",), "lag": ("lag",), "gains": ("gain-mismatch",)}
"""What else is hidden, and what the library calls it."""

Reading = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


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
        lines += [*write_recording(folder / f"trial_{i}.csv", table, ("temperature",)), f'use = "{use}"']
    path_of_rig = folder / "rig.toml"
    path_of_rig.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path_of_rig


def run() -> Iterator[dict]:
    """Count the cases in which temperature is named, alone, and those in which it is named wrongly."""
    yield from count_named("temperature", write, FOLLOWING, OTHERS)
