# SPDX-License-Identifier: GPL-3.0-or-later
"""Random rigs of every word that a rig may have, also in combinations that make no sense, with small recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.selection.diagnosis import SELECTION_BEGINS, diagnose
from palpate.core.jobs import run_job

SHAPES: list[dict[str, Any]] = [{"sphere": 0.008}, {"box": [0.004, 0.004, 0.01]}, {"cylinder": [0.003, 0.01]}]
HEIGHTS = (0.0, 2e-4, -3e-4, "free", 0.05)
WHOLE = 25
"""One rig in so many is diagnosed to the end, which takes seconds."""
FAULTS = ("sign", "unit", "clock-shift", "stuck-logger", "reversed-channels", "saturated-converter")


def random_rig(seed: int) -> dict[str, bytes]:
    """Return the files of a random rig."""
    rng = np.random.default_rng(seed)
    sensor, texels = _sensor(rng)
    rig: dict[str, Any] = {"format": "palpate-rig/1", "sensor": sensor}
    if rng.random() < 0.97:
        rig["indenter"] = {"shape": SHAPES[rng.integers(3)]}
    if rng.random() < 0.4:
        rig["probe"] = [{"name": "other", "shape": SHAPES[rng.integers(3)]}]
    if rng.random() < 0.3:
        rig["data"] = {"correct": "all" if rng.random() < 0.5 else [str(rng.choice(FAULTS))]}
    if rng.random() < 0.2:
        rig["clock"] = str(rng.choice(["own", "absolute"]))
    kind = str(rng.choice(["pose", "pose", "weight", "depth", "force"]))
    files, trials, repeats = {}, [], rng.random() < 0.15
    for number in range(rng.integers(1, 5)):
        name = f"t{number}.csv"
        files[name] = _recording(rng, kind if rng.random() < 0.9 else "pose", texels)
        trials.append(_trial(rng, name, "probe" in rig) | ({"repeats": "a"} if repeats else {}))
    return {"rig.toml": tomli_w.dumps({**rig, "trial": trials}).encode(), **files}


def _sensor(rng: np.random.Generator) -> tuple[dict[str, Any], int]:
    """A [sensor] and its number of texels."""
    sensor: dict[str, Any] = {}
    if rng.random() < 0.85:
        sensor["k"] = float(rng.choice([1e-3, 80.0, 80.0, 1e5]))
    if rng.random() < 0.3:
        sensor["unit"] = "counts"
    if rng.random() < 0.3:
        sensor["contact_height"] = HEIGHTS[rng.integers(len(HEIGHTS))]
    kind = rng.choice(["grid", "sensors", "strips"])
    if kind == "grid":
        rows, columns = int(rng.integers(1, 4)), int(rng.integers(1, 4))
        return {**sensor, "grid": {"rows": rows, "columns": columns, "pitch": [0.004, 0.003]}}, rows * columns
    count = int(rng.integers(1, 6))
    cover: dict[str, Any] = {"size": [0.02, 0.012], "pitch": float(rng.choice([0.001, 0.002, 0.03]))}
    if kind == "sensors" or rng.random() < 0.5:
        cover["depth"] = float(rng.choice([1e-5, 0.002, 0.05]))
    if kind == "sensors":
        places = rng.uniform([-0.01, -0.006], [0.01, 0.006], (count, 2))
        return {**sensor, "sensors": places.tolist(), "cover": cover}, count
    edges = np.linspace(-0.01, 0.01, count + 1)
    strips = [[[float(a), -0.006], [float(b), 0.006]] for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return {**sensor, "strips": strips, "cover": cover}, count


def _trial(rng: np.random.Generator, name: str, has_probe: bool) -> dict[str, Any]:
    """A [[trial]] with some of its words."""
    trial: dict[str, Any] = {"file": name, "use": "fit" if name == "t0.csv" or rng.random() < 0.7 else "check"}
    words: dict[str, Any] = {
        "contact_height": HEIGHTS[rng.integers(len(HEIGHTS))],
        "specimen": str(rng.choice(["A", "B"])),
        "factor": "free" if rng.random() < 0.7 else 1.2,
        "zero": "free" if rng.random() < 0.7 else 0.01,
        "force_zero": "free" if rng.random() < 0.7 else [0.0, 0.0, 0.1],
        "session": "s",
        "tared": bool(rng.random() < 0.5),
    }
    if has_probe:
        words["probe"] = "other"
    chosen = {word: value for word, value in words.items() if rng.random() < 0.25}
    if "specimen" in chosen and rng.random() < 0.9:
        chosen["factor"] = "free"
    return {**trial, **chosen}


def _recording(rng: np.random.Generator, kind: str, texels: int) -> bytes:
    """A CSV of one or two presses, or of none, with one or both responses."""
    step, count = float(rng.choice([0.01, 0.05])), int(rng.integers(20, 160))
    time = step * np.arange(count)
    deep = float(rng.choice([-1e-3, 5e-4, 2e-3]))
    level = deep * np.clip(1.5 * np.sin(2 * np.pi * rng.uniform(0.5, 2.0) * time / time[-1]), -0.5, 1.0)
    columns: dict[str, np.ndarray] = {"time": time}
    if kind in ("pose", "weight"):
        columns |= {axis: np.full(count, rng.uniform(-0.005, 0.005)) for axis in "xy"}
    if kind == "pose":
        columns["z"] = 0.008 - level
    elif kind == "depth":
        columns["depth"] = level
    else:
        columns["force"] = 500.0 * level
    if rng.random() < 0.2:
        columns |= {axis: 1e-3 * np.sin(time + rng.random()) for axis in ("slide_x", "slide_y")}
    noise = float(rng.choice([0.0, 0.01]))
    if rng.random() < 0.85:
        gains = rng.uniform(0.0, 2.0, texels)
        columns |= {
            f"texel_{i}": g * 80.0 * np.maximum(level, 0.0) + noise * rng.normal(size=count) for i, g in enumerate(gains)
        }
    if rng.random() < 0.3 or "texel_0" not in columns:
        columns["force_z"] = -80.0 * np.maximum(level, 0.0) + noise * rng.normal(size=count)
    table = np.stack(list(columns.values()), axis=1)
    if rng.random() < 0.2:
        table[rng.integers(count, size=3), -1] = np.nan
    rows = [",".join("" if np.isnan(value) else f"{value:.7g}" for value in row) for row in table]
    return ("\n".join([",".join(columns), *rows]) + "\n").encode()


def read_and_diagnose(folder: Path) -> str:
    """Read a rig and return the verdict on it; AssertionError if the answer is not finite."""
    found = run_job(diagnose(read_rig(folder / "rig.toml")))
    assert found.verdict in ("explained", "no gap", "unexplained")
    assert np.isfinite(found.base.sse).all() and np.isfinite(found.best.sse).all(), "errors that are not numbers"
    assert all(np.isfinite(value) for value in found.best.model.recordings.values()), "numbers of recordings"
    return found.verdict


def read_and_fit(folder: Path) -> None:
    """Read a rig, look for faults of its data and fit the base model; one rig in :data:`WHOLE` is diagnosed to the end."""
    if sum((folder / "rig.toml").read_bytes()) % WHOLE == 0:
        read_and_diagnose(folder)
        return
    job = diagnose(read_rig(folder / "rig.toml"))
    for progress in job:
        if progress.done >= SELECTION_BEGINS:
            break
    job.close()
