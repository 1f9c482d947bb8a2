# SPDX-License-Identifier: GPL-3.0-or-later
"""Gains that fall from recording to recording, with use or with the clock, where no session is named.

A plate presses four texels in recordings that each begin at time zero, so all texels carry the same load. In `used` recordings
the gain falls with the accumulated load, in `aged` ones with time, and use is unequal in both. In `alike` ones every recording
is the same programme, so nobody can tell. Cases numbered below 1000 have formulas of their own.

Environment:

``PALPATE_WEAR_CASES``  how many cases of each kind (6)
``PALPATE_WEAR_FIRST``  number of the first; below 1000 are those to develop on (5000)
"""

from __future__ import annotations

import os
import sys
import tempfile
import time as clock
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

RATE, TEXELS, RECORDINGS, CHECKED = 25.0, 4, 8, 2
FIRST_SEALED = 1000
ANSWERS = {"used": ("wear",), "aged": ("drift",), "alike": ()}
"""The only name that may be sure; of recordings that are alike none may."""


def run() -> Iterator[dict]:
    """Yield for each kind the shares of cases that are named rightly, left open and named wrongly."""
    from .sessions import outcome

    count, first = (int(os.environ.get(f"PALPATE_WEAR_{key}", value)) for key, value in (("CASES", "6"), ("FIRST", "5000")))
    for kind, answer in ANSWERS.items():
        said = []
        for number in range(first, first + count):
            sure, open_names, verdict = _examined(kind, number)
            said.append(outcome(answer, sure, verdict, bool(open_names)))
            print(f"{kind} {number}: {said[-1]}: {sure or open_names or verdict}", file=sys.stderr, flush=True)
        for what, goal in (("right", None), ("ambiguous", None), ("wrong", 0.0)):
            figure = {"name": f"wear_or_drift.{kind}.{what}", "value": said.count(what) / count, "unit": f"share of {count}"}
            yield figure if goal is None else figure | {"goal": goal}


def _examined(kind: str, number: int) -> tuple[set[str], list[tuple[str, ...]], str]:
    """Sure names, names not told apart, and the verdict."""
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.selection.confidence import SURE
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs import run_job

    began = clock.process_time()
    with tempfile.TemporaryDirectory() as folder:
        result = run_job(diagnose(read_rig(write(kind, number, Path(folder)))))
    sure = {one.name for one in result.findings if one.confidence >= SURE}
    if result.between is not None and result.between.confidence >= SURE:
        sure.add(result.between.name)
    told = result.between.evidence if result.between else "session" if result.assumed_session else "-"
    print(f"  told by {told} ({clock.process_time() - began:.0f} s)", file=sys.stderr)
    return sure, result.ambiguous, result.verdict


def write(kind: str, number: int, folder: Path) -> Path:
    """Write a case as a rig and return the path of its TOML file."""
    rng = np.random.default_rng([zlib.crc32(kind.encode()), number])
    k, deep, same = float(rng.uniform(40, 90)), float(rng.uniform(1.5e-3, 2.5e-3)), int(rng.integers(2**31))
    counts = np.round(np.exp(rng.uniform(np.log(2), np.log(12), RECORDINGS))).astype(int)
    depths = []
    for count in counts:
        one = np.random.default_rng(same) if kind == "alike" else rng
        depths.append(_pressed(one, 5 if kind == "alike" else int(count), deep))
    loads = [k * np.maximum(depth, 0.0) for depth in depths]
    by_use = bool(rng.integers(2)) if kind == "alike" else kind == "used"
    grown = _use(rng, loads, number) if by_use else _time(rng, loads)
    left = _gain(rng, number)
    gains = [left(one / grown[-1][-1]) for one in grown]
    noise = rng.uniform(0.002, 0.005) * max(float(load.max()) for load in loads)
    checked = set(rng.choice(np.arange(1, RECORDINGS), CHECKED, replace=False).tolist())
    text = f'format = "palpate-rig/1"\n[sensor]\ngrid = {{ rows = 1, columns = {TEXELS}, pitch = 0.01 }}\n'
    text += f"k = {k * rng.uniform(0.9, 1.1):.3g}\n"
    head = "time,depth," + ",".join(f"texel_{i}" for i in range(TEXELS))
    folder.mkdir(parents=True, exist_ok=True)
    for i, (depth, load, gain) in enumerate(zip(depths, loads, gains, strict=True)):
        reading = (load * gain)[:, None] + noise * rng.normal(size=(len(load), TEXELS))
        table = np.column_stack([np.arange(len(load)) / RATE, depth, reading])
        np.savetxt(folder / f"r{i}.csv", table, "%.9g", ",", header=head, comments="")
        text += f'[[trial]]\nfile = "r{i}.csv"\nuse = "{"check" if i in checked else "fit"}"\n'
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


def _pressed(rng: np.random.Generator, count: int, deep: float) -> np.ndarray:
    """Depth over time of some presses with holds, metres; negative without contact."""
    knots, values = [0.0, 0.8], [-1e-3, -1e-3]
    for _ in range(count):
        depth = deep * rng.uniform(0.5, 1.0)
        for length, value in ((rng.uniform(0.2, 0.6), depth), (rng.uniform(0.2, 1.0), depth), (rng.uniform(0.2, 0.5), -1e-3)):
            knots.append(knots[-1] + length)
            values.append(value)
        knots.append(knots[-1] + 0.4)
        values.append(-1e-3)
    time = np.arange(round(max(8.0, knots[-1]) * RATE)) / RATE
    return np.interp(time, knots, values)


def _use(rng: np.random.Generator, loads: list[np.ndarray], number: int) -> list[np.ndarray]:
    """What has been used up at each sample: loads put on, impulse or its square."""
    ways = (lambda load: np.maximum(np.diff(load, prepend=0.0), 0.0), lambda load: load, lambda load: load**2)
    way = ways[0] if number < FIRST_SEALED else ways[1 + number % 2]
    ends = np.cumsum([way(load).sum() for load in loads])
    return [end - way(load).sum() + np.cumsum(way(load)) for end, load in zip(ends, loads, strict=True)]


def _time(rng: np.random.Generator, loads: list[np.ndarray]) -> list[np.ndarray]:
    """Time that has passed at each sample, with pauses that are nearly alike, s."""
    pauses = rng.choice([0.0, 30.0, 600.0]) * rng.uniform(0.9, 1.1, len(loads))
    starts = np.cumsum([0.0, *[len(load) / RATE for load in loads[:-1]]]) + np.cumsum(pauses)
    return [start + (1.0 + np.arange(len(load))) / RATE for start, load in zip(starts, loads, strict=True)]


def _gain(rng: np.random.Generator, number: int):
    """What is left of the gain after a share of all use or time."""
    most, power = rng.uniform(0.2, 0.5), rng.uniform(0.6, 1.3)
    if number < FIRST_SEALED:
        return lambda x: np.exp(-most * x)
    return (lambda x: 1.0 / (1.0 + most * x), lambda x: 1.0 - most * x**power, lambda x: 1.0 - most * np.log1p(2.0 * x))[
        number % 3
    ]
