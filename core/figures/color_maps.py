# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour maps, as stops in sRGB between which colours are mixed linearly: the same in materials, 3D view and figures."""

from __future__ import annotations

from typing import Any

import numpy as np


def _stops(text: str) -> np.ndarray:
    """(m, 3) sRGB from hexadecimal colours."""
    return np.array([[int(color[i : i + 2], 16) for i in (0, 2, 4)] for color in text.split()]) / 255.0


STOPS = {
    # 32 entries each, evenly spread over matplotlib's tables (Smith, van der Walt, Firing; cividis: Nuñez, Anderton, Renslow;
    # all CC0): as many as a colour ramp of Blender holds.
    "VIRIDIS": _stops(
        "440154 470d60 48186a 482475 472e7c 453882 424186 3e4c8a 3a548c 365d8d 32658e 2e6d8e 2b758e 287d8e 25848e 228c8d "
        "1f948c 1e9c89 20a386 25ab82 2eb37c 3aba76 48c16e 58c765 69cd5b 7fd34e 93d741 a8db34 bddf26 d5e21a eae51a fde725"
    ),
    "MAGMA": _stops(
        "000004 030312 0a0822 140e36 1e1149 2a115c 38106c 471078 54137d 601880 6d1d81 792282 882781 942c80 a1307e ae347b "
        "bd3977 ca3e72 d6456c e24d66 ec5860 f3655c f8745c fb835f fd9266 fea36f feb27a fec185 fecf92 fde0a1 fceeb0 fcfdbf"
    ),
    "INFERNO": _stops(
        "000004 040312 0b0724 160b39 230c4c 310a5c 3e0966 4d0d6c 5a116e 67166e 741a6e 801f6c 8f2469 9b2964 a82e5f b43359 "
        "c13a50 cc4248 d74b3f e05536 e9612b ef6e21 f57b17 f8890c fb9706 fca80d fbb81d f9c72f f6d746 f2e865 f3f586 fcffa4"
    ),
    "CIVIDIS": _stops(
        "00224e 00285b 002e6a 083370 1c396f 293f6e 33446d 3d4a6c 45506c 4d556c 555b6d 5c616e 646770 6b6d72 727274 787877 "
        "807f78 888578 908b78 979177 a09875 a89e73 b0a571 b9ab6d c1b26a cbb965 d3c05f dcc859 e5cf52 efd748 f8df3c fee838"
    ),
    "PAPER": _stops("ffffff 000000"),
}
"""(m, 3) float, sRGB, by the name that scenes use."""

SIGNED = "SIGNED"
"""Map of values with a sign: blue below zero, white at it, red above."""
ALL = {**STOPS, SIGNED: _stops("053061 2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b 67001f")}
"""The maps to choose from, and that of signed values (ColorBrewer, RdBu)."""

NAMES = {
    "VIRIDIS": ("Viridis", "Dark blue to yellow, perceptually uniform"),
    "MAGMA": ("Magma", "Black to pale yellow, perceptually uniform"),
    "INFERNO": ("Inferno", "Black over red to yellow, perceptually uniform"),
    "CIVIDIS": ("Cividis", "Blue to yellow, perceptually uniform and alike for the colour-blind"),
    "PAPER": ("White to Black", "White is no force, black the largest, as in the paper's Fig. 10"),
}


def linear(srgb: np.ndarray) -> np.ndarray:
    """Return scene-linear values of sRGB ones; material nodes and the 3D view's shaders count in these."""
    srgb = np.asarray(srgb, float)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def srgb(linear_values: np.ndarray) -> np.ndarray:
    """Return the sRGB values of scene-linear ones: the inverse of :func:`linear`."""
    values = np.asarray(linear_values, float)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * np.maximum(values, 0.0) ** (1 / 2.4) - 0.055)


def colors(name: str, share: np.ndarray) -> np.ndarray:
    """(n, 3) sRGB colours of (n,) values from 0 to 1; what lies outside has the colour of the nearer end."""
    stops, share = ALL[name], np.clip(share, 0.0, 1.0)
    at = np.linspace(0.0, 1.0, len(stops))
    return np.column_stack([np.interp(share, at, channel) for channel in stops.T])


def matplotlib_colormap(name: str) -> Any:
    """Return a map as an object of matplotlib."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list(name, [tuple(color) for color in ALL[name]], N=1024)
