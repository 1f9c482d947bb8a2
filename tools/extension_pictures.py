# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the pictures for extensions.blender.org: python tools/extension_pictures.py, some minutes.

``docs/images/extension-icon.png`` is drawn; ``extension-feature.jpg`` is the baked sample scene with a hand, rendered by
``palpate render``. docs/extension-platform.md says what they are for.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
ICON = 256
"""Side of the icon, pixels."""
FEATURE = (1920, 1080)
COMMAND = [sys.executable, "-m", "palpate.commands"]


def icon(path: Path) -> None:
    """Draw texels on a pad, coloured as a ball presses them."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Circle

    from palpate.core.figures.figure_canvas import new_figure
    from palpate.core.figures.figure_style import FigureStyle

    figure = new_figure(ICON / 100, ICON / 100)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(-0.62, 7.62), ylim=(-0.62, 7.62))
    axes.set_axis_off()
    figure.patch.set_facecolor(to_rgb("#20242b"))
    colours = FigureStyle().matplotlib_colormap()
    for x in range(8):
        for y in range(8):
            depth = max(0.0, 1.0 - np.hypot(x - 3.9, y - 3.4) ** 2 / 12.0)  # of a ball
            axes.add_patch(Circle((x, y), 0.26 + 0.16 * depth, color=colours(depth), lw=0))
    figure.savefig(path, dpi=100)


def feature(path: Path) -> None:
    """Bake the sample hand and render it at its largest settled force."""
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "hand.blend"
        scene.write_bytes((ROOT / "sample_blends" / "hand.blend").read_bytes())
        subprocess.run([*COMMAND, "bake", scene, "--save"], check=True)
        size = [str(side) for side in FEATURE]
        render = [
            "render",
            scene,
            "--only",
            "scene",
            "--engine",
            "cycles",
            "--samples",
            "64",
            "--size",
            *size,
            "--format",
            "png",
        ]
        subprocess.run([*COMMAND, *render, "--out", folder], check=True)
        pictures = [Image.open(file) for file in Path(folder).rglob("*.png")]
        found = next(picture for picture in pictures if picture.size == FEATURE)
        found.convert("RGB").save(path, quality=88, optimize=True)


if __name__ == "__main__":
    icon(IMAGES / "extension-icon.png")
    feature(IMAGES / "extension-feature.jpg")
