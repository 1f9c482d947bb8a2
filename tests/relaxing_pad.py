# SPDX-License-Identifier: GPL-3.0-or-later
"""A pad whose stress relaxes, under a ball that presses it slowly and once: recordings that leave open what is hidden.

``test_carried_through.py`` carries the next experiment through on it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from small_pad import COLUMNS, DEEP, PITCH, RADIUS, RATE, ROWS, K, loads, write_recording

from palpate.benchmarks._hidden.rig_text import rig_head

SHARE, TAU, POWER = 0.35, 2.5, 0.6
"""Of the stress that relaxes: by a stretched exponential (Kohlrausch), which the library does not have."""
NOISE = 0.003
"""Of full load."""


def measured(path: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return readings (T, n) N of the pad under a ball whose centre follows a path (T, 3), m."""
    force = loads(path)
    time = np.arange(len(path)) / RATE
    lost = SHARE * (1.0 - np.exp(-((time / TAU) ** POWER)))
    rises = np.diff(force, axis=0, prepend=0.0)
    relaxed = np.stack([np.convolve(rises[:, i], lost)[: len(path)] for i in range(force.shape[1])], axis=1)
    return np.asarray(np.maximum(force - relaxed, 0.0) + NOISE * K * DEEP * rng.normal(size=force.shape))


def record(folder: Path, name: str, path: np.ndarray, rng: np.random.Generator) -> str:
    """Write a recording along a path and return its entry in the rig."""
    table = np.column_stack([np.arange(len(path)) / RATE, path, measured(path, rng)])
    return "\n".join([*write_recording(folder / name, table), ""])


def slow_press() -> np.ndarray:
    """Return a path (T, 3), m: down once, slowly, and up, without a hold or another speed."""
    time = np.arange(int(14 * RATE)) / RATE
    depth = np.interp(time, [0.0, 1.0, 7.0, 13.0, 14.0], [-1e-3, -1e-3, DEEP, -1e-3, -1e-3])
    return np.stack([0.0 * time, 0.0 * time, RADIUS - depth], axis=1)


def write(folder: Path, rng: np.random.Generator) -> Path:
    """Write three slow presses as a rig, one of them to check, and return the path of its TOML file."""
    words = {"k": K, "cn": 0.0, "unit": "N", "gain": 1.0, "zero": 0.0}
    rig = rig_head("pad that relaxes", (ROWS, COLUMNS, PITCH), words, RADIUS)
    rig += [record(folder, f"press_{i}.csv", slow_press(), rng) + ('use = "check"\n' if i == 2 else "") for i in range(3)]
    (folder / "rig.toml").write_text("\n".join(rig), encoding="utf-8")
    return folder / "rig.toml"


def add_planned(rig: Path, planned: Path, rng: np.random.Generator) -> np.ndarray:
    """Record along the trajectory in a CSV, add the recording to a rig, and return the path of the ball (T, 3), m."""
    table = np.genfromtxt(planned, delimiter=",", names=True)
    time = np.arange(0.0, table["time"][-1], 1.0 / RATE)
    path = np.stack([np.interp(time, table["time"], table[axis]) for axis in "xyz"], axis=1)
    entry = record(rig.parent, "planned.csv", path, rng)
    rig.write_text(f"{rig.read_text(encoding='utf-8')}\n{entry}", encoding="utf-8")
    return path
