# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of readings with three signed channels: arrows across the surface, and colours with a sign along the normal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ParameterError
from .figure_canvas import new_figure
from .figure_style import INK, SMALL

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIGNED = "RdBu_r"
"""Colours of a signed value: blue below zero, white at zero, red above it."""
ROOM = 0.6
"""Space around the outermost places, as a share of the distance between neighbours."""


def vector_figure(places: np.ndarray, images: Sequence[np.ndarray], titles: Sequence[str], unit: str) -> Figure:
    """Return images of vectors side by side, on one scale of the arrows and one of the colours.

    Parameters
    ----------
    places : (k, 2) float, m
        Where each vector is measured, in the plane of the image.
    images : sequence of (k, 3) float
        Along x, y and the normal. Arrows show the first two, the colour of a disc the third.
    titles : sequence of str
    unit : str

    Raises
    ------
    ParameterError
        An image has another number of places, or a value that is no number.
    """
    for values in images:
        if np.shape(values) != (len(places), 3) or not np.isfinite(values).all():
            raise ParameterError(
                f"A vector image has the shape {np.shape(values)}: give finite numbers of the shape ({len(places)}, 3)."
            )
    pitch = _pitch(places) * 1e3
    low, high = 1e3 * places.min(axis=0) - ROOM * pitch, 1e3 * places.max(axis=0) + ROOM * pitch
    most = max(max(float(np.abs(values[:, 2]).max()) for values in images), 1e-300)
    longest = max(max(float(np.linalg.norm(values[:, :2], axis=1).max()) for values in images), 1e-300)
    wide, tall = (high - low) / max(high - low)
    figure = new_figure(3.1 * wide * len(images) + 0.9, 3.1 * tall + 0.8)
    all_axes = figure.subplots(1, len(images), squeeze=False)[0]
    for axes, values, title in zip(all_axes, images, titles, strict=True):
        dots = axes.scatter(
            *(1e3 * places.T), c=values[:, 2], cmap=SIGNED, vmin=-most, vmax=most, s=420, edgecolors="0.6", linewidths=0.6
        )
        axes.quiver(
            *(1e3 * places.T),
            values[:, 0],
            values[:, 1],
            angles="xy",
            scale_units="xy",
            scale=longest / (0.9 * pitch),
            color=INK,
            width=0.012,
            zorder=3,
        )
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set_title(title, fontsize=SMALL + 1, color=INK)
        axes.tick_params(labelsize=SMALL)
        axes.set_xlabel("x (mm)", fontsize=SMALL)
    all_axes[0].set_ylabel("y (mm)", fontsize=SMALL)
    bar = figure.colorbar(dots, ax=list(all_axes), fraction=0.03, pad=0.02)
    bar.set_label(f"along the normal ({unit}); longest arrow {longest:.3g} {unit}", fontsize=SMALL)
    bar.ax.tick_params(labelsize=SMALL)
    return figure


def _pitch(places: np.ndarray) -> float:
    """Median distance to the nearest neighbour, m; 1 mm of a single place."""
    if len(places) < 2:
        return 1e-3
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    return float(np.median(np.min(apart + np.where(np.eye(len(places)) > 0, np.inf, 0.0), axis=1)))
