# SPDX-License-Identifier: GPL-3.0-or-later
"""A surface as it looks from outside, for a picture in which places can be read. Of a closed one, both sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .layout.rasterization import front_triangles
from .texels import Texels

HIDDEN_SHARE = 0.05
"""Share of the area that may face away in a single view; of a surface that hides more there are two."""
ONE_SIDED = 0.2
"""Length of the mean normal from which it says where outside is: 0.5 for half of a ball, 0 for a closed surface."""
APART = 0.06
"""Distance between two views, as a share of their longer side."""


@dataclass(frozen=True)
class Projection:
    """Views of texels side by side, in orthographic projection; values are linear on each triangle.

    Attributes
    ----------
    names : tuple of str
        Of the views, from left to right: the direction from which each is seen, along an axis of the sensor's body, as in
        "+Z"; a single empty string for one view along the mean normal.
    height, width : int, pixels
    pixel : (p,) int
        Pixels that show the surface, flat indices.
    corner : (p, 3) int
        Texels of the triangle in front at each of them.
    weights : (p, 3) float
        Of these texels, sum 1.
    """

    names: tuple[str, ...]
    height: int
    width: int
    pixel: np.ndarray
    corner: np.ndarray
    weights: np.ndarray

    def image(self, values: np.ndarray) -> np.ndarray:
        """Return the picture of (n,) values: (height, width) float, row 0 at the bottom, zero beside the surface."""
        picture = np.zeros(self.height * self.width)
        picture[self.pixel] = np.einsum("ij,ij->i", np.asarray(values, float)[self.corner], self.weights)
        return picture.reshape(self.height, self.width)

    def mask(self) -> np.ndarray:
        """Return (height, width) bool: which pixels show the surface."""
        mask = np.zeros(self.height * self.width, bool)
        mask[self.pixel] = True
        return mask.reshape(self.height, self.width)


def projection_of(texels: Texels, side: int) -> Projection:
    """Return the texels as seen from outside, in one view, or in two from opposite directions.

    Parameters
    ----------
    texels : Texels
        With a layout that has triangles.
    side : int, pixels
        Longer side of each view.
    """
    triangles, names, out = texels.layout.triangles, *_directions(texels)
    views = [_axes(direction) for direction in out]
    flat = texels.position @ views[0].T  # the other view is its mirror image: equally large
    low, extent = flat.min(axis=0), np.maximum(np.ptp(flat, axis=0), 1e-12)[:2]
    scale = (side - 1) / extent.max()
    width, height = (int(length) for length in np.ceil(extent * scale - 1e-9) + 1)
    step = width + round(APART * side)
    parts = []
    for number, axes in enumerate(views):
        seen = texels.position @ axes.T
        seen -= [seen[:, 0].min(), low[1], 0.0]
        corners = seen[triangles] * [scale, scale, 1.0]
        pixel, triangle, weights = front_triangles(corners, height, width)
        x, y = pixel % width + number * step, pixel // width
        parts.append((y * (step * (len(views) - 1) + width) + x, triangles[triangle], weights))
    pixel, corner, weights = (np.concatenate(part) for part in zip(*parts))
    return Projection(names, height, step * (len(views) - 1) + width, pixel, corner, weights)


def _directions(texels: Texels) -> tuple[tuple[str, ...], Sequence[np.ndarray]]:
    """Return the names of the views and the directions, (3,) each, from which they are seen."""
    weight = texels.area / max(float(texels.area.sum()), 1e-300)
    mean = weight @ texels.normal
    if np.linalg.norm(mean) > ONE_SIDED:
        out = mean / np.linalg.norm(mean)
        if weight[texels.normal @ out <= 0.0].sum() <= HIDDEN_SHARE:
            return ("",), (out,)
        axis = int(np.abs(mean).argmax())
        out = np.sign(mean[axis]) * np.eye(3)[axis]
    else:
        axis = int(np.ptp(texels.position, axis=0).argmin())  # across it there is most to see
        out = np.eye(3)[axis]
    return tuple(("+" if way[axis] > 0 else "−") + "XYZ"[axis] for way in (out, -out)), (out, -out)


def _axes(out: np.ndarray) -> np.ndarray:
    """Return (3, 3): right, up and towards the viewer; up is the body's z, or its y where it is seen along z."""
    up = np.eye(3)[2 if abs(out[2]) < 0.9 else 1]
    right = np.cross(up, out)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(out, right), out])
