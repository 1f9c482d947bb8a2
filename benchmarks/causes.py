# SPDX-License-Identifier: GPL-3.0-or-later
"""One rig of each cause for which the gap workflow once gave a wrong answer, by formulas of its own.

The verdict, the names with their confidence, and the error of the check recordings before and after go to stderr. With
PALPATE_CAUSES_FOLDER the rigs are kept there, so that another version can be run on the same files.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

ROWS, COLUMNS, PITCH, RADIUS, STIFFNESS, STEP = 6, 4, 0.0034, 0.010, 80.0, 0.025
NOISE = 0.004
"""Of the largest reading."""


def run() -> Iterator[dict]:
    """Yield for each cause the largest confidence of a wrong name, with everything that was said on stderr."""
    from palpate.core.gap.dataset.rig import read_rig
    from palpate.core.gap.selection.diagnosis import diagnose
    from palpate.core.jobs.job_runner import run_job

    with tempfile.TemporaryDirectory() as scratch:
        root = Path(os.environ.get("PALPATE_CAUSES_FOLDER", scratch))
        for name, (make, right) in CAUSES.items():
            found = run_job(diagnose(read_rig(make(root / name.replace(" ", "_")))))
            names = [(one.name, one.confidence) for one in found.findings]
            between = found.between.name if found.between else "nothing"
            check = [(float(one.before[0]) ** 0.5, float(one.after[0]) ** 0.5) for one in found.check.recordings]
            noise = found.noise[0].deviation / found.full[0]
            errors = [f"{before * noise:.2%} -> {after * noise:.2%}" for before, after in check]
            print(name, found.verdict, names, between, "check", errors, file=sys.stderr)
            wrong = max((confidence for one, confidence in names if one not in right), default=0.0)
            yield {"name": f"causes: {name}: confidence of a wrong name", "value": wrong, "unit": "", "goal": 0.5}


def written(folder: Path, readings: Callable[[int, np.ndarray, np.ndarray], np.ndarray], shift: tuple[float, ...]) -> Path:
    """Write five recordings of a ball on a pad that is displaced by `shift` (m), the last one to check; return the rig."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(11)
    gx, gy = np.meshgrid((np.arange(COLUMNS) - 1.5) * PITCH, (np.arange(ROWS) - 2.5) * PITCH)
    px, py = gx.ravel() + shift[0], gy.ravel() + shift[1]
    grid = f"{{ rows = {ROWS}, columns = {COLUMNS}, pitch = [{PITCH}, {PITCH}] }}"
    text = f'format = "palpate-rig/1"\n[sensor]\ngrid = {grid}\n'
    text += f"k = 70.0\n[indenter]\nshape = {{ sphere = {RADIUS} }}\n"
    head = "time,x,y,z," + ",".join(f"texel_{i}" for i in range(ROWS * COLUMNS))
    for number in range(5):
        low = _presses(rng)
        time = STEP * np.arange(len(low))
        x, y = rng.uniform(-0.003, 0.003), rng.uniform(-0.006, 0.006)
        square = (px - x) ** 2 + (py - y) ** 2
        height = np.sqrt(np.maximum(RADIUS**2 - square, 0.0))
        depth = np.maximum(height - (RADIUS - low[:, None]) + shift[2], 0.0) * height / RADIUS * (square < RADIUS**2)
        reading = readings(number, STIFFNESS * depth, time)
        reading = reading + NOISE * 0.17 * rng.normal(size=reading.shape)
        columns = [time, np.full_like(time, x), np.full_like(time, y), RADIUS - low, reading]
        np.savetxt(folder / f"t{number}.csv", np.column_stack(columns), "%.8g", ",", header=head, comments="")
        text += f'[[trial]]\nfile = "t{number}.csv"\nuse = "{"check" if number == 4 else "fit"}"\n'
    path = folder / "rig.toml"
    path.write_text(text)
    return path


def _presses(rng: np.random.Generator) -> np.ndarray:
    """Lowest point below the surface over time (m): three presses with holds."""
    parts = [np.full(32, -0.001)]
    for _ in range(3):
        deep, down, up = rng.uniform(0.0008, 0.0022), rng.integers(6, 50), rng.integers(6, 50)
        parts += [np.linspace(-0.001, deep, down), np.full(rng.integers(20, 60), deep)]
        parts += [np.linspace(deep, -0.001, up), np.full(rng.integers(12, 30), -0.001)]
    return np.concatenate(parts)


def worn(folder: Path) -> Path:
    """A sensor that loses a tenth of its gain from recording to recording; each file begins at time zero."""
    return written(folder, lambda number, force, time: 0.9**number * force, (0.0, 0.0, 0.0))


def unlike(folder: Path) -> Path:
    """Gains of texels that hold in the fitted recordings and not in the one to check."""
    gains = 1.0 + 0.08 * np.sin(np.arange(ROWS * COLUMNS))
    return written(folder, lambda number, force, time: force * (gains if number < 4 else 2.0 - gains), (0.0, 0.0, 0.0))


def displaced(folder: Path) -> Path:
    """A sensor that is mounted off by three lengths."""
    return written(folder, lambda number, force, time: force, (0.0008, -0.0006, 0.0003))


def untouched(folder: Path) -> Path:
    """A sensor that relaxes, with one recording without contact, as `next_experiment` may advise."""

    def relaxed(number: int, force: np.ndarray, time: np.ndarray) -> np.ndarray:
        slow, out = np.zeros(force.shape[1]), np.empty_like(force)
        for i in range(len(time)):
            slow = slow + (force[i] - slow) * (1.0 - np.exp(-STEP / 0.7))
            out[i] = np.maximum(force[i] - 0.3 * slow, 0.0)
        return out

    path = written(folder, relaxed, (0.0, 0.0, 0.0))
    rows = (folder / "t1.csv").read_text().splitlines()
    table = np.genfromtxt(rows, delimiter=",", skip_header=1)
    table[:, 3] += 0.02
    table[:, 4:] = NOISE * 0.17 * np.random.default_rng(5).normal(size=table[:, 4:].shape)
    np.savetxt(folder / "t1.csv", table, "%.8g", ",", header=rows[0], comments="")
    return path


CAUSES: dict[str, tuple[Callable[[Path], Path], tuple[str, ...]]] = {
    "wear from recording to recording": (worn, ()),
    "the check recording differs": (unlike, ()),
    "displaced by three lengths": (displaced, ("misalignment",)),
    "a recording without contact": (untouched, ("creep",)),
}
"""How the rig of each cause is made, and the names that are right."""
