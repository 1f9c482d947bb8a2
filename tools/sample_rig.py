# SPDX-License-Identifier: GPL-3.0-or-later
"""Write docs/sample-rig, the measurements that docs/gap.md teaches on: python tools/sample_rig.py [FOLDER].

They are made up, by the generator of the benchmark (benchmarks/_hidden), which shares no code with the package and has other
formulas than its library of effects. What is hidden in them stands in the answer below, and in docs/gap.md.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from palpate.benchmarks._hidden import other, world

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "sample-rig"
SEED, RATE, SECONDS = 7, 25.0, 14.0
RADIUS, CLEAR, DEEPEST = 0.015, -1e-3, 3e-3
"""Of the ball; its depth while nothing touches, and the largest, metres."""
NOISE = 0.004
"""Standard deviation, of the largest reading."""
PAD = world.Pad(
    k=58.4, cn=0.6, mus=0.5, mud=0.4, x0=0.01, sigma0=30.0, sigma1=0.3, ct=0.02, gain=9000.0, zero=64.0, unit="counts"
)
STATED = 70.0
"""Stiffness that the rig says, N/m: it is never quite known."""
TRIALS = {"press_0": "fit", "press_1": "fit", "press_2": "fit", "press_3": "check"}
ABOUT = """\
# A pad of 84 texels under a ball of 30 mm. Made up: tools/sample_rig.py wrote it, docs/gap.md shows what to do with it.
format = "palpate-rig/1"
name = "sample pad under a ball"

[sensor]
grid = {{ rows = {rows}, columns = {columns}, pitch = [{pitch}, {pitch}] }}
thickness = {thickness}
k = {k}
unit = "counts"                # what a count is worth, and where it begins, is fitted

[indenter]
shape = {{ sphere = {radius} }}
"""


def main(folder: Path) -> None:
    """Write the rig and its recordings."""
    rng = np.random.default_rng(SEED)
    hidden = (other.creep(rng, 0.8), other.gain_mismatch(rng, 0.55))
    probe = world.Probe(RADIUS, None)
    time = np.arange(round(SECONDS * world.RATE)) / world.RATE
    every = round(world.RATE / RATE)
    paths = [presses(rng, time, probe) for _ in TRIALS]
    readings = [world.respond(world.touch(probe, PAD, time, path), PAD, hidden, slides=False).reading for path in paths]
    noise = NOISE * max(float(reading.max()) - PAD.zero for reading in readings)
    folder.mkdir(parents=True, exist_ok=True)
    words = ABOUT.format(
        rows=world.ROWS, columns=world.COLUMNS, pitch=world.PITCH, thickness=world.THICKNESS, k=STATED, radius=RADIUS
    )
    header = ",".join(["time", "x", "y", "z", *(f"texel_{i}" for i in range(world.ROWS * world.COLUMNS))])
    for (name, use), path, clean in zip(TRIALS.items(), paths, readings, strict=True):
        counts = np.rint(clean + noise * rng.normal(size=clean.shape)).astype(int)
        rows = [
            f"{t:.2f},{x:.5f},{y:.5f},{z:.6f},{','.join(map(str, row))}"
            for t, (x, y, z), row in zip(time[::every], path[::every], counts[::every].tolist(), strict=True)
        ]
        (folder / f"{name}.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
        words += f'\n[[trial]]\nfile = "{name}.csv"\nuse = "{use}"\n'
    (folder / "rig.toml").write_text(words, encoding="utf-8")


def presses(rng: np.random.Generator, time: np.ndarray, probe: world.Probe) -> np.ndarray:
    """The ball's middle (T, 3), m: four presses along the pad, of unequal depth and speed, one of them held for long, two in
    one place.
    """
    along = np.linspace(-0.4, 0.4, 4) * world.ROWS * world.PITCH
    knots, t = [(0.0, 0.0, along[0], CLEAR), (0.6, 0.0, along[0], CLEAR)], 0.6
    for number, (hold, y) in enumerate(zip((0.5, 3.0, 0.4, 1.0), rng.permutation(along), strict=True)):
        x = rng.uniform(-0.3, 0.3) * world.COLUMNS * world.PITCH
        for _ in range(2 if number == 2 else 1):
            deep, down, up = DEEPEST * rng.uniform(0.6, 1.0), *np.exp(rng.uniform(np.log(0.1), np.log(0.9), 2))
            knots += [(t + 0.3, x, y, CLEAR), (t + 0.3 + down, x, y, deep)]
            knots += [(t + 0.3 + down + hold, x, y, deep), (t + 0.3 + down + hold + up, x, y, CLEAR)]
            t += 0.3 + down + hold + up
    knots.append((max(t, SECONDS) + 1.0, x, y, CLEAR))
    table = np.array(knots)
    x_at, y_at, depth = (np.interp(time, table[:, 0], table[:, i]) for i in (1, 2, 3))
    return np.stack([x_at, y_at, probe.lowest - depth], axis=1)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
