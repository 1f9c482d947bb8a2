# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour maps of heat maps, as a few stops in sRGB; between them colours are mixed linearly."""

from __future__ import annotations

import numpy as np

STOPS = {
    # Entries 0, 32, 64, 96, 128, 159, 191, 223 and 255 of matplotlib's tables (Smith, van der Walt, Firing; CC0).
    "VIRIDIS": (
        (0.267004, 0.004874, 0.329415),
        (0.278826, 0.175490, 0.483397),
        (0.229739, 0.322361, 0.545706),
        (0.172719, 0.448791, 0.557885),
        (0.127568, 0.566949, 0.550556),
        (0.153894, 0.680203, 0.504172),
        (0.360741, 0.785964, 0.387814),
        (0.668054, 0.861999, 0.196293),
        (0.993248, 0.906157, 0.143936),
    ),
    "MAGMA": (
        (0.001462, 0.000466, 0.013866),
        (0.113094, 0.065492, 0.276784),
        (0.316654, 0.071690, 0.485380),
        (0.512831, 0.148179, 0.507648),
        (0.716387, 0.214982, 0.475290),
        (0.899552, 0.314616, 0.391037),
        (0.985693, 0.528148, 0.379371),
        (0.997019, 0.762398, 0.528821),
        (0.987053, 0.991438, 0.749504),
    ),
    "PAPER": ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)),
}


def linear(srgb: np.ndarray) -> np.ndarray:
    """Return scene-linear values of sRGB ones; material nodes and the 3D view's shaders count in these."""
    srgb = np.asarray(srgb, float)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def colors(name: str, share: np.ndarray) -> np.ndarray:
    """(n, 3) sRGB colours of (n,) values from 0 to 1."""
    stops = np.array(STOPS[name])
    at = np.linspace(0.0, 1.0, len(stops))
    share = np.clip(share, 0.0, 1.0)
    return np.column_stack([np.interp(share, at, channel) for channel in stops.T])
