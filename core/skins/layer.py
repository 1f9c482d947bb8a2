# SPDX-License-Identifier: GPL-3.0-or-later
"""How what is inside a compliant layer moves with the texels on its surface."""

from __future__ import annotations

import numpy as np

from ..geometry.texels import Texels

NEGLIGIBLE = 1e-6
"""Share of the largest weight up to which a texel does not move a point of the layer."""


def pressure_below_point_load(depth: np.ndarray | float, squares: np.ndarray) -> np.ndarray:
    """Return the normal stress in a half-space below a point load of one newton (Boussinesq; Johnson 1985, Eq. 3.19), 1/m².

    Parameters
    ----------
    depth : (...) float, m
        Below the surface.
    squares : (...) float, m²
        Squared distance from the axis of the load.
    """
    found: np.ndarray = 1.5 / np.pi * depth**3 * (depth**2 + squares) ** -2.5
    return found


def texel_displacements(
    texels: Texels, depth: np.ndarray, shear: np.ndarray | None = None, shear_stiffness: float = np.inf
) -> np.ndarray:
    """Return how the surface moves at the texels, in the frame of the sensor's body.

    Parameters
    ----------
    texels : Texels
        n of them.
    depth : (T, n) float, m
        How deep each is pressed in.
    shear : (T, n, 2) float, N, or None
        Force along the texels' x and y axes.
    shear_stiffness : float, N/m
        Of one texel.

    Returns
    -------
    (T, n, 3) float, m
    """
    moved = -np.asarray(depth, float)[..., None] * texels.normal
    if shear is not None:
        moved = moved + (shear[..., :1] * texels.tangent + shear[..., 1:] * texels.bitangent) / shear_stiffness
    return moved


def layer_weights(texels: Texels, place: np.ndarray, thickness: float) -> np.ndarray:
    """Return the share of each texel's displacement with which points of a layer move.

    The layer is bonded to a rigid base. A displacement spreads as the stress below a point load does, and falls in a line to
    zero at the base, so that a layer that is pressed in evenly moves evenly.

    Parameters
    ----------
    texels : Texels
        n of them, on the layer's surface.
    place : (m, 3) float, m
        Points inside the layer, in the frame of the sensor's body.
    thickness : float, m

    Returns
    -------
    (m, n) float
    """
    offset = texels.position[None] - np.asarray(place, float)[:, None]
    below = np.einsum("mnk,nk->mn", offset, texels.normal)
    depth = np.maximum(below, 1e-3 * thickness)
    squares = np.maximum(np.sum(offset**2, axis=2) - below**2, 0.0)
    shares = pressure_below_point_load(depth, squares) * texels.area
    shares = np.where(shares > NEGLIGIBLE * shares.max(axis=1, keepdims=True), shares, 0.0)
    shares /= shares.sum(axis=1, keepdims=True)
    own_depth = np.sum(shares * below, axis=1)
    kept: np.ndarray = np.clip(1.0 - own_depth / thickness, 0.0, 1.0)[:, None] * shares
    return kept
