# SPDX-License-Identifier: GPL-3.0-or-later
"""How often the names that ``palpate gap`` says are right, by the confidence at which it says them.

``python tools/reliability.py RESULTS.jsonl …`` takes results of ``make bench ONLY=gap`` (build/gap) and of
``python -m benchmarks foreign --rigs DIR`` (DIR/results.jsonl), prints the counts and draws docs/images/gap-reliability.png.
Names below one half count, too: they are what cases without a sure name offer.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

HOUSE = Path(__file__).resolve().parent.parent
PICTURE = HOUSE / "docs" / "images" / "gap-reliability.png"
BINS = (0.0, 0.4, 0.5, 0.8, 0.9, 0.95, 0.98, 1.0)
"""Ends of the bins of confidence. Doubts without a rival are below 0.4, those with one above."""
LEAST_DRAWN = 5
"""Names in a bin that is drawn; the table has the others, too."""
LARGEST = 0.9995
"""Where a confidence of 1 is drawn: results hold three digits, and no logistic scale reaches 1."""
TICKS = (0.1, 0.3, 0.5, 0.8, 0.9, 0.95, 0.98, 0.995, 0.999)
"""Confidences that are written at the axis."""
FAMILIES = (
    ("the library's formulas", ("own",), "#1f5fa8", "s"),
    ("other formulas", ("other", "two", "three", "poor"), "#c4541a", "o"),
    ("a third family, on which nothing was set", ("third", "pairs"), "#2a7f3f", "^"),
    ("rigs of another generator", ("0", "1", "2", "3", "outside the library"), "#6a3d9a", "D"),
)
"""Words, kinds of cases, colour and mark of what is drawn."""


@dataclass(frozen=True)
class Bin:
    """Names of about one confidence: its ends, its mean, and how many of how many are right."""

    low: float
    high: float
    mean: float
    right: int
    count: int

    @property
    def share(self) -> float:
        """Share of the names that are right."""
        return self.right / self.count

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the share."""
        low, high = binomtest(self.right, self.count).proportion_ci(method="wilson")
        return float(low), float(high)


def read(paths: Sequence[Path]) -> list[dict[str, Any]]:
    """Return the results in some files or folders of studies, one for each case."""
    files = [file for path in paths for file in (sorted(path.glob("runs/*/case.json")) if path.is_dir() else [path])]
    return [json.loads(line) for file in files for line in file.read_text(encoding="utf-8").splitlines()]


def named(rows: Sequence[dict[str, Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Return of all names that were said the confidence, (N,) float, and whether it is right, (N,) bool."""
    said = [(confidence, name in row["answer"]) for row in rows for name, _, confidence in row["said"]]
    return np.array([one[0] for one in said], float), np.array([one[1] for one in said], bool)


def binned(confidence: np.ndarray, right: np.ndarray) -> list[Bin]:
    """Return the bins that have names."""
    place = np.clip(np.searchsorted(BINS, confidence, side="right") - 1, 0, len(BINS) - 2)
    found = []
    for i in np.unique(place):
        own = place == i
        found.append(Bin(BINS[i], BINS[i + 1], float(confidence[own].mean()), int(right[own].sum()), int(own.sum())))
    return found


def group_coverage(rows: Sequence[dict[str, Any]]) -> tuple[int, int]:
    """Return how many groups that were called ambiguous contain a hidden effect, and how many groups there are."""
    groups = [(row["answer"], group) for row in rows for group in row["ambiguous"]]
    return sum(bool(set(answer) & set(group)) for answer, group in groups), len(groups)


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return counts as Markdown."""
    text = ["| confidence | mean | right | share and its 95 % interval |", "| --- | ---: | ---: | --- |"]
    for one in binned(*named(rows)):
        low, high = one.interval
        ends = f"{one.low:.2f} – {one.high:.2f} | {one.mean:.3f}"
        text.append(f"| {ends} | {one.right} of {one.count} | {one.share:.0%} ({low:.0%} – {high:.0%}) |")
    covered, groups = group_coverage(rows)
    return "\n".join([*text, "", f"Of {groups} ambiguous groups {covered} contain a hidden effect."])


def draw(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw confidence against the share of names that are right."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.4), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    line = np.linspace(0.02, 0.999, 1000)
    axes.plot(line, line, color="0.6", linewidth=1.0, label="right as often as said")
    for words, kinds, colour, mark in FAMILIES:
        found = binned(*named([row for row in rows if row["kind"] in kinds]))
        bins = [one for one in found if one.count >= LEAST_DRAWN]
        if bins:
            share, ends = np.array([one.share for one in bins]), np.array([one.interval for one in bins]).T
            mean, spread = [min(one.mean, LARGEST) for one in bins], np.abs(ends - share)
            axes.errorbar(mean, share, yerr=spread, fmt=mark, color=colour, markersize=4, capsize=2, elinewidth=1, label=words)
            below = {"textcoords": "offset points", "xytext": (0, -8), "ha": "center"}
            for one, at, low in zip(bins, mean, ends[0], strict=True):
                axes.annotate(f"{one.right}/{one.count}", (at, low), fontsize=6, color=colour, **below)
    axes.set_xscale("logit")  # most names are near 1
    axes.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
    axes.set_xticks([], minor=True)
    axes.set(xlabel="confidence that is said", ylabel="share of names that are right", xlim=(0.05, 0.9999), ylim=(-0.06, 1.05))
    axes.legend(loc="lower right", frameon=False, fontsize=8)
    figure.savefig(path, metadata={"Software": None})


def main(arguments: Sequence[str]) -> None:
    """Print the counts and draw them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", nargs="+", type=Path)
    parser.add_argument("--picture", type=Path, default=PICTURE)
    options = parser.parse_args(arguments)
    rows = read(options.results)
    print(table(rows))
    draw(rows, options.picture)


if __name__ == "__main__":
    main(sys.argv[1:])
