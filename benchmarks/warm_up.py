# SPDX-License-Identifier: GPL-3.0-or-later
"""``palpate gap`` on sessions of a sensor that is switched on with the first recording: a gain that changes until it is warm.

The pad and the presses are those of :mod:`._small_pad`, in a session of six recordings with pauses of up to ten minutes. The
gain follows two exponentials, a stretched one, or a first-order lag with dead time: the library has none of them. In as many
cases something else goes on through the session: a zero that moves with the root of the time, gains that fall with the work of
pressing, or nothing. ``PALPATE_WARM_UP_CASES`` and ``PALPATE_WARM_UP_FIRST`` say which cases
(:func:`._small_pad.count_named`).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ._hidden.rig_text import rig_head
from ._small_pad import COLUMNS, PITCH, RADIUS, RATE, ROWS, TRIALS, K, count_named, loads, presses, write_recording

WARMING = ("two exponentials", "stretched", "late")
OTHERS = {"nothing": (), "zero": ("drift",), "use": ("wear", "softening")}
"""What else goes on, and what the library may call it."""


def change(kind: str, rng: np.random.Generator, forces: list[np.ndarray], times: list[np.ndarray]) -> list[np.ndarray]:
    """Return the forces (T, n) that a sensor shows in each recording of a session, at times since power-on."""
    full, end = max(float(force.max()) for force in forces), float(times[-1][-1])
    most, tau = rng.uniform(0.12, 0.3) * rng.choice([-1, 1]), rng.uniform(0.1, 0.3) * end
    if kind == "two exponentials":
        return [
            f * (1 + most * (1 - 0.6 * np.exp(-t / tau) - 0.4 * np.exp(-4 * t / tau)))[:, None]
            for f, t in zip(forces, times, strict=True)
        ]
    if kind == "stretched":
        return [f * (1 + most * (1 - np.exp(-((t / tau) ** 0.7))))[:, None] for f, t in zip(forces, times, strict=True)]
    if kind == "late":
        late = 0.1 * tau
        return [f * (1 - most * np.expm1(-np.maximum(t - late, 0) / tau))[:, None] for f, t in zip(forces, times, strict=True)]
    if kind == "zero":
        return [f + 0.4 * most * full * np.sqrt(t / end)[:, None] for f, t in zip(forces, times, strict=True)]
    if kind == "use":
        found, used = [], np.zeros(ROWS * COLUMNS)
        for force in forces:
            path = used + np.cumsum(np.maximum(np.diff(force, axis=0, prepend=0.0), 0.0), axis=0)
            found.append(force / (1.0 + abs(most) * path / (6.0 * full)))
            used = path[-1]
        return found
    return forces


def write(kind: str, number: int, folder: Path) -> Path:
    """Write a case as a rig and return the path of its TOML file."""
    rng = np.random.default_rng([17, number])
    paths = [presses(rng) for _ in TRIALS]
    own = [np.arange(len(path)) / RATE for path in paths]
    starts = np.cumsum([0.0, *(t[-1] + p for t, p in zip(own[:-1], rng.uniform(20.0, 600.0, len(TRIALS) - 1), strict=True))])
    forces = [loads(path) for path in paths]
    full = max(float(force.max()) for force in forces)
    shown = change(kind, rng, forces, [start + time for start, time in zip(starts, own, strict=True)])
    words = {"k": round(K * rng.uniform(0.95, 1.05), 2), "cn": 0.0, "unit": "N"}
    lines = rig_head("pad that is switched on", (ROWS, COLUMNS, PITCH), words, RADIUS)
    folder.mkdir(parents=True, exist_ok=True)
    order = rng.permutation(len(TRIALS) - 1) + 1
    checked = set(order[: TRIALS.count("check")].tolist())
    for i, (path, force, time) in enumerate(zip(paths, shown, own, strict=True)):
        table = np.column_stack([time, path, force + 0.005 * full * rng.normal(size=force.shape)])
        lines += [*write_recording(folder / f"trial_{i}.csv", table), f'use = "{"check" if i in checked else "fit"}"']
        lines += ['session = "day"', f"started = {starts[i]:.3f}"]
    path_of_rig = folder / "rig.toml"
    path_of_rig.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path_of_rig


def run() -> Iterator[dict]:
    """Count the cases in which a warm-up is named, alone, and those in which it is named wrongly."""
    yield from count_named("warm-up", write, WARMING, OTHERS)
