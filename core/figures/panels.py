# SPDX-License-Identifier: GPL-3.0-or-later
"""A rendered picture with what the sensors feel beside it: tactile images, colour bar, and the force so far."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .. import measures
from ..bakes import frame_index
from ..canvas import FONT, INK, SERIES, SMALL, new_figure, save_figure, tidy_axes
from ..recording import Recording
from ..texels import Texels
from .images import View, colour_bar
from .look import Look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST = 4
"""Sensors whose images fit over one another."""


def side_by_side(
    source: str | Path,
    path: str | Path,
    recording: Recording,
    texels: Mapping[str, Texels],
    frame: int,
    look: Look | None = None,
    height: int = 720,
) -> None:
    """Put a rendered picture and the tactile images of the same frame side by side, with the force over time below them.

    Parameters
    ----------
    source, path : str or Path
        The rendered PNG, and the PNG to write.
    texels : mapping of str to Texels
        The first four are shown.
    frame : int
    height : int, pixels
        Of the result. Width and height are even numbers, as videos ask for.
    """
    from matplotlib.image import imread

    look = look or Look()
    picture = imread(source)
    i = frame_index(recording, frame)
    shown = dict(list(texels.items())[:_MOST])
    dpi = height / 4.5  # text of 8 pt can then be read at the height of a page's figure
    tall = 4.5
    wide = tall * picture.shape[1] / picture.shape[0]
    side = 2.35
    pixels = 2 * round(0.5 * (wide + side) * dpi), 2 * round(0.5 * height)
    width = pixels[0] / dpi
    figure = new_figure(width, tall)
    axes = figure.add_axes((0.0, 0.0, wide / width, 1.0))
    axes.imshow(picture, aspect="auto", interpolation="antialiased")
    axes.set_axis_off()

    top, strongest = look.top(recording, texels), measures.peak_shear(recording)
    x, room, curve = wide + 0.15, 1.15, 1.15
    each = (tall - curve - 0.45) / len(shown)
    image = None
    y = tall - 0.1
    for name, own in shown.items():
        felt = recording.sensors[name]
        figure.text(x / width, y / tall, name, fontsize=FONT, color=INK, weight="bold", va="top")
        place = figure.add_axes((x / width, (y - each + 0.12) / tall, room / width, (each - 0.32) / tall))
        view = View.of(own, felt.normal_force.sum(axis=0))
        view = view.at_size(min(room / view.width, (each - 0.32) / view.height))
        image = view.draw(place, look.values(felt, own)[i], felt.shear[i], strongest, top, look)
        place.set_anchor("NW")
        y -= each
    if image is not None:
        bar = figure.add_axes(((x + room + 0.12) / width, (curve + 0.55) / tall, 0.1 / width, (tall - curve - 0.9) / tall))
        colour_bar(figure, image, bar, look)
    place = figure.add_axes(((x + 0.32) / width, 0.42 / tall, (side - 0.6) / width, (curve - 0.42) / tall))
    _force_so_far(place, recording, i, shown)
    save_figure(figure, path, dpi)


def _force_so_far(axes: Axes, recording: Recording, i: int, texels: Mapping[str, Texels]) -> None:
    for number, name in enumerate(texels):
        force = recording.sensors[name].normal_force.sum(axis=1)
        axes.plot(recording.times, force, color=SERIES[number], lw=0.8, alpha=0.35)
        axes.plot(recording.times[: i + 1], force[: i + 1], color=SERIES[number], lw=1.6)
        axes.plot(recording.times[i], force[i], "o", color=SERIES[number], ms=3.5)
    axes.set_ylim(bottom=0)
    axes.margins(x=0.02)
    axes.set_xlabel("time (s)", labelpad=1)
    axes.set_title("normal force (N)", fontsize=SMALL, color=INK, loc="left", pad=3)
    tidy_axes(axes)
    last = float(np.max(recording.times))
    axes.set_xticks([0.0, round(last, 1)] if last > 0.1 else [0.0])
