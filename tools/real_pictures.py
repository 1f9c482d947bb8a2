# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the pictures of benchmarks/RESULTS.md: python tools/real_pictures.py, after python -m benchmarks real.

The curves are those of the reports in build/real; the counts of the insole are read from the recordings
(``PALPATE_REAL_DATA``).
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
CURVES = ("insole", "tube", "adhesive", "foam")


def curves(reports: list[Path], path: Path) -> None:
    """Put the curves of reports into a sheet of two columns."""
    from PIL import Image

    pictures = [Image.open(report / "curves.png").convert("RGB") for report in reports]
    width = max(picture.width for picture in pictures)
    tops = [0]
    for i in range(0, len(pictures), 2):
        tops.append(tops[-1] + max(picture.height for picture in pictures[i : i + 2]))
    sheet = Image.new("RGB", (2 * width, tops[-1]), "white")
    for i, picture in enumerate(pictures):
        sheet.paste(picture, (i % 2 * width, tops[i // 2]))
    sheet.thumbnail((1600, 2400))
    sheet.save(path, optimize=True)


def rest(data: Path, path: Path) -> None:
    """What each texel of the insole reads without pressure and under the largest, in the first recording."""
    from palpate.benchmarks._recordings import insole
    from palpate.core.figures.figure_canvas import new_figure, save_figure, tidy_axes
    from palpate.core.figures.figure_style import GREY, INK, NORMAL_COLOUR, SHEAR_COLOUR

    _, _, columns = insole(data, cleaned=False).trials[0]
    counts = np.stack([value for key, value in columns.items() if key.startswith("texel_")])
    pressed = columns["force"] > 0.9 * columns["force"].max()
    figure = new_figure(7.0, 2.6)
    axes = figure.add_axes((0.08, 0.19, 0.9, 0.68))
    for values, colour, label in (
        (np.median(counts[:, columns["force"] < 0.04 * columns["force"].max()], axis=1), NORMAL_COLOUR, "without pressure"),
        (np.median(counts[:, pressed], axis=1), SHEAR_COLOUR, "above nine tenths of the largest pressure"),
    ):
        axes.plot(np.arange(len(values)), values, ".", ms=3.5, mew=0, color=colour, label=label)
    for first in (140, 250, 260):
        axes.axvspan(first - 0.5, first + 9.5, color=GREY, alpha=0.18, lw=0)
    axes.set_xlabel("texel")
    axes.set_ylabel("counts")
    axes.set_xlim(-2, len(counts) + 1)
    axes.set_title(
        "insole, first recording: modules of ten texels that do not answer in grey", loc="left", fontsize=8.5, color=INK
    )
    tidy_axes(axes)
    axes.legend(frameon=False, fontsize=8, loc="center", ncols=2, bbox_to_anchor=(0.5, 0.42))
    save_figure(figure, path, 150)


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT.parent))
    curves([ROOT / "build" / "real" / name for name in CURVES], IMAGES / "gap-real.png")
    rest(Path(os.environ.get("PALPATE_REAL_DATA", ROOT.parent / "shared" / "data")), IMAGES / "gap-insole.png")
    print(f"wrote gap-real.png and gap-insole.png in {IMAGES}")
