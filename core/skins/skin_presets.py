# SPDX-License-Identifier: GPL-3.0-or-later
"""Magnetic skins as they are built: how many magnets and magnetometers, and where.

Numbers and arrangement are those of the skins that are named. Lengths and moments are round numbers of the right size and no
datasheet's, since builders vary them; whoever has such a skin measures his own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import SensorError, suggestion
from ..geometry.texels import Texels

LARGEST_TILT = 0.02
"""Largest sine of the angle between the normals of two texels of a pad that is flat."""


@dataclass(frozen=True)
class SkinPreset:
    """A skin on a flat pad.

    Attributes
    ----------
    name, text : str
    magnets : (m, 3) float, m
        From the middle of the pad's surface along its x, y and normal.
    moment : (3,) float, A·m²
        Of each magnet, along the same axes.
    magnetometers : (k, 3) float, m
    thickness : float, m
        Of the compliant layer.
    """

    name: str
    text: str
    magnets: np.ndarray
    moment: np.ndarray
    magnetometers: np.ndarray
    thickness: float


def _grid(count: int, pitch: float, height: float) -> np.ndarray:
    """Places of a square grid at a height, row by row, (count², 3) m."""
    along = (np.arange(count) - 0.5 * (count - 1)) * pitch
    x, y = np.meshgrid(along, along)
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, height)], axis=1)


def _five(apart: float, height: float) -> np.ndarray:
    """One place in the middle and four around it, as the chips of ReSkin's circuit board, (5, 3) m."""
    return np.array([[0, 0, height], [apart, 0, height], [0, apart, height], [-apart, 0, height], [0, -apart, height]])


_UP = np.array([0.0, 0.0, 1.0])
PRESETS = {
    one.name: one
    for one in (
        SkinPreset(
            "uskin",
            "4 × 4 magnets in silicone, each over a magnetometer of its own, as in uSkin (Tomo et al. 2018)",
            _grid(4, 4.7e-3, -3e-3),
            4e-3 * _UP,
            _grid(4, 4.7e-3, -7e-3),
            6e-3,
        ),
        SkinPreset(
            "eflesh",
            "five magnets in a printed lattice over five magnetometers (Pattabiraman et al. 2025)",
            _five(7e-3, -12e-3),
            12e-3 * _UP,
            _five(7e-3, -20e-3),
            18e-3,
        ),
        SkinPreset(
            "anyskin",
            "a sheet of magnetised elastomer, here 6 × 6 dipoles, over five magnetometers (Bhirangi et al. 2024)",
            _grid(6, 3e-3, -1e-3),
            7e-4 * _UP,
            _five(7e-3, -4e-3),
            2e-3,
        ),
    )
}


def preset_named(name: str) -> SkinPreset:
    """Return a preset; raise :class:`SensorError` if there is none of this name."""
    if name not in PRESETS:
        raise SensorError(f"There is no skin '{name}'{suggestion(name, PRESETS)}; there are {', '.join(PRESETS)}.")
    return PRESETS[name]


def placed(preset: SkinPreset, texels: Texels) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a preset under a flat pad: magnets (m, 3), moment (3,), magnetometers (k, 3) and its axes in rows (3, 3).

    Raises
    ------
    SensorError
        The pad is not flat, or does not reach over all magnets.
    """
    normal, tangent = texels.normal[0], texels.tangent[0]
    tilt = float(np.linalg.norm(np.cross(texels.normal, normal), axis=1).max())
    if tilt > LARGEST_TILT or (texels.normal @ normal).min() < 0.0:
        raise SensorError(f"The skin '{preset.name}' is flat and the texels are not: give places instead of the name.")
    frame = np.stack([tangent, np.cross(normal, tangent), normal])
    middle = 0.5 * (texels.position.max(axis=0) + texels.position.min(axis=0))
    within = np.abs((texels.position - middle) @ frame[:2].T).max(axis=0) + 0.5 * np.sqrt(texels.area.max())
    needed = np.abs(preset.magnets[:, :2]).max(axis=0)
    if (needed > within).any():
        size, wanted = (" × ".join(f"{2e3 * one:.3g}" for one in sizes) for sizes in (within, needed))
        raise SensorError(
            f"The pad covers {size} mm and the magnets of the skin '{preset.name}' lie within {wanted} mm: use a larger pad."
        )
    return middle + preset.magnets @ frame, preset.moment @ frame, middle + preset.magnetometers @ frame, frame
