# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw docs/images/planned-experiment.png: a planned experiment carried through. python tools/planned_experiment.py."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "images" / "planned-experiment.png"
SEED = 5


def main() -> None:
    """Find the gap, record along the trajectory that is written, find the gap again, and draw all three."""
    from palpate.benchmarks import _relaxing_pad as pad

    rng = np.random.default_rng(SEED)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rig = pad.write(folder, rng)
        before = _said(rig, folder / "before")
        planned = pad.add_planned(rig, folder / "before" / "next_experiment.csv", rng)
        after = _said(rig, folder / "after")
        _draw(pad.slow_press(), planned, before, after)
    print(f"wrote {PICTURE}")


def _said(rig: Path, out: Path) -> dict[str, Any]:
    command = [sys.executable, "-m", "palpate.commands", "gap", str(rig), "--out", str(out)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    found: dict[str, Any] = json.loads((out / "gap.json").read_text(encoding="utf-8"))
    return found


def _draw(press: np.ndarray, planned: np.ndarray, before: dict[str, Any], after: dict[str, Any]) -> None:
    from matplotlib.figure import Figure

    from palpate.benchmarks._relaxing_pad import RADIUS, RATE, measured
    from palpate.core.figures.figure_canvas import save_figure, tidy_axes
    from palpate.core.figures.figure_style import GREY, SERIES

    figure = Figure(figsize=(10.0, 5.2))
    plan = before["planned_experiment"]
    for column, (path, said, title) in enumerate(
        ((press, before, "What was recorded: slow presses"), (planned, after, "What was planned: next_experiment.csv"))
    ):
        time = np.arange(len(path)) / RATE
        depth, reading = (figure.add_subplot(2, 2, column + 1 + 2 * row) for row in (0, 1))
        depth.plot(time, 1e3 * (RADIUS - path[:, 2]), color=SERIES[0], lw=1.2)
        depth.axhline(0.0, color=GREY, lw=0.8)
        depth.set_title(title, fontsize=10, loc="left")
        depth.set_ylabel("depth (mm)")
        shown = measured(path, np.random.default_rng(1))
        reading.plot(time, shown[:, np.argmax(shown.max(axis=0))], color=SERIES[1], lw=1.0)
        reading.set_ylabel("most loaded texel (N)")
        reading.set_xlabel("time (s)")
        reading.set_title(_sentence(said), fontsize=9, loc="left")
        for axes in (depth, reading):
            tidy_axes(axes)
    sure = f"{plan['sure_before']:.0%} sure without it, about {plan['sure_after']:.0%} with it"
    figure.suptitle(f"To distinguish {', '.join(plan['between'])}: {sure}", fontsize=11, x=0.07, ha="left")
    figure.subplots_adjust(left=0.07, right=0.98, top=0.86, bottom=0.1, hspace=0.5, wspace=0.22)
    save_figure(figure, PICTURE, 110)


def _sentence(said: dict[str, Any]) -> str:
    """What is said of the recordings."""
    found = ", ".join(f"{one['effect']} ({one['confidence']:.2f})" for one in said["found"]) or "nothing"
    groups = "; ".join(" or ".join(group) for group in said["ambiguous"])
    return f"Found: {found}. " + (f"Open: {groups}." if groups else "Nothing is open.")


if __name__ == "__main__":
    main()
