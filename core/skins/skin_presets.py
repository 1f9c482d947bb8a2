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
from .magnetic_skin import FULL_SCALE, Magnetometers, Magnets

LEAST_NORMAL = 0.2
"""Least cosine between the normal of a texel and the mean of all, for a skin to lie below it."""


@dataclass(frozen=True)
class SkinPreset:
    """A skin, as it lies on a flat pad.

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


def placed(preset: SkinPreset, texels: Texels) -> tuple[Magnets, Magnetometers]:
    """Return a preset under the middle of a sensor's texels; on a curved surface it follows the surface.

    The last axis of each magnetometer is along the normal above it.

    Raises
    ------
    SensorError
        The texels do not reach over all magnets, or look in all directions.
    """
    mean = texels.area @ texels.normal / texels.area.sum()
    if np.linalg.norm(mean) < LEAST_NORMAL:
        raise SensorError(
            f"The texels look in all directions and the skin '{preset.name}' lies on one side: make a region of that side."
        )
    up = mean / np.linalg.norm(mean)
    facing = np.flatnonzero(texels.normal @ up > LEAST_NORMAL)
    position, normals = texels.position[facing], texels.normal[facing]
    middle = 0.5 * (position.max(axis=0) + position.min(axis=0))
    along = texels.tangent[facing[np.argmin(np.sum((position - middle) ** 2, axis=1))]]
    along = along - up * (up @ along)
    along = along / np.linalg.norm(along)
    frame = np.stack([along, np.cross(up, along), up])
    flat = (position - middle) @ frame.T
    _check_size(preset, np.abs(flat[:, :2]).max(axis=0) + 0.5 * np.sqrt(texels.area.max()))

    def under(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return places (m, 3) below the surface, and in rows the axes (m, 3, 3) of the surface above them."""
        above = np.argmin(np.sum((places[:, None, :2] - flat[None, :, :2]) ** 2, axis=2), axis=1)
        normal = normals[above] @ frame.T
        rise = -np.sum(normal[:, :2] * (places[:, :2] - flat[above, :2]), axis=1) / normal[:, 2]  # in its tangent plane
        surface = np.column_stack([places[:, :2], flat[above, 2] + rise])
        first = np.cross([0.0, 1.0, 0.0], normal)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        axes = np.stack([first, np.cross(normal, first), normal], axis=1)
        return middle + (surface + places[:, 2:] * normal) @ frame, axes @ frame

    (magnets, turned), (chips, axes) = under(preset.magnets), under(preset.magnetometers)
    moments = np.einsum("i,mij->mj", preset.moment, turned)
    return Magnets(magnets, moments), Magnetometers(chips, axes, FULL_SCALE, np.zeros(chips.shape))


def _check_size(preset: SkinPreset, within: np.ndarray) -> None:
    needed = np.abs(preset.magnets[:, :2]).max(axis=0)
    if (needed > within).any():
        size, wanted = (" × ".join(f"{2e3 * one:.3g}" for one in sizes) for sizes in (within, needed))
        raise SensorError(
            f"The pad covers {size} mm and the magnets of the skin '{preset.name}' lie within {wanted} mm: use a larger pad."
        )
