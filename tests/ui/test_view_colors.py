# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of heat maps in a real window, pixel by pixel; see roads/colors.py."""

from __future__ import annotations

import matplotlib
import numpy as np
from PIL import Image

PADS = 3
VIEWS = ("solid", "material", "eevee", "workbench", "through")
NAMES = [f"{kind}-{view}" for kind in ("live", "baked") for view in VIEWS] + ["baked-standard-eevee", "baked-standard-material"]
TABLE_TOLERANCE = 9
"""Of 255, in each channel, between the screen and matplotlib's table: Blender shows what is drawn over its 3D views up to 8
off, 4.3 and 5.2 alike, but not materials. Linear values instead of sRGB ones, the fault this is to find, would be 50 off."""
VIEW_TOLERANCE = 2
"""Between a heat map that is drawn over a view and the tactile image of the same texels in the corner: rounding twice."""


def pixel(picture: np.ndarray, x: int, y: int) -> np.ndarray:
    """Return the median colour of five by five pixels; y counts from the lower edge, as in Blender."""
    return np.median(picture[-y - 3 : -y + 2, x - 2 : x + 3].reshape(-1, 3), axis=0)


def test_colors(play_road, real_blender):
    """Heat maps and tactile images have the colours of their bar, and of the colour map, in every view."""
    noted = play_road("colors", timeout=1200)["values"]["spots"]
    assert set(noted) == set(NAMES)
    seen, wrong = {}, []
    for name, spots in noted.items():
        with Image.open(real_blender.work / "colors" / f"{name}.png") as image:
            picture = np.array(image.convert("RGB"), dtype=int)
        seen[name] = [pixel(picture, x, y) for x, y, _ in spots]
        for color, (x, y, share) in zip(seen[name], spots, strict=True):
            expected = np.array(matplotlib.colormaps["viridis"](share)[:3]) * 255
            if np.abs(color - expected).max() > TABLE_TOLERANCE:
                wrong.append(f"{name} at {x}, {y}: {color} instead of {expected.round()} at {share:.2f} of the bar")
    for name, colors in seen.items():
        if "standard" in name:
            continue
        images = seen[f"{name.partition('-')[0]}-solid"][PADS : 2 * PADS]
        for pad, (color, image) in enumerate(zip(colors[:PADS], images, strict=True)):
            if np.abs(color - image).max() > VIEW_TOLERANCE:
                wrong.append(f"{name}, pad {pad}: {color} on the surface and {image} in the tactile image")
    assert not wrong, "\n".join(wrong)
