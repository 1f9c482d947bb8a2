# SPDX-License-Identifier: GPL-3.0-or-later
"""Tactile images over time: one row of images per sensor, one column per frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..geometry.texels import Texels
from ..model.recording import Recording
from ..response import metrics
from .figure_canvas import new_figure, save_figure
from .figure_style import FONT, GREY, INK, SMALL, FigureStyle
from .tactile_image import SMALLEST_ARROW, SensorView, draw_colour_bar, draw_scale_key, scale_key_width

COLUMNS = {"single": 3, "middle": 5, "double": 6}
"""Images in a row, by the figure's width, where the frames are not chosen by hand."""
LEAST_HEIGHT, LYING_BAR = 1.9, 0.55
"""Inches: of a figure with the colour bar at its side; lower ones have it below, where it takes up so much."""


def tactile_strip(
    path: str | Path,
    recording: Recording,
    texels: Mapping[str, Texels],
    frames: Sequence[int] | np.ndarray | None = None,
    style: FigureStyle | None = None,
) -> None:
    """Draw the tactile images of all sensors over time: normal force or pressure in colour, shear as arrows.

    Parameters
    ----------
    path : str or Path
        PNG, PDF or SVG, by its ending.
    recording : Recording
    texels : mapping of str to Texels
        By sensor name; one row of images each, in this order.
    frames : sequence of int, optional
        Frame numbers, one column each. Default: as many as fit, spread over the time in which the forces change.
    style : FigureStyle, optional
    """
    style = style or FigureStyle()
    chosen = metrics.choose_frames(recording, COLUMNS[style.width]) if frames is None else np.asarray(frames)
    index = np.searchsorted(recording.frames, chosen)
    top = style.scale_limit(recording, texels)
    views = [SensorView.of(texels[name], recording.sensors[name].normal_force.sum(axis=0)) for name in texels]
    strongest = metrics.peak_shear(recording)
    columns = len(chosen)

    # Sizes in inches: the figure is as high as its rows need, so that images keep their shape and text its size.
    left, right, above, gap, below = 0.95, 0.9, 0.28, 0.36, 0.42

    def rows(cell: float) -> list[float]:
        return [min(max(cell * 0.86 * view.height / view.width, 0.5), 2.4) for view in views]

    def whole(heights: list[float]) -> float:
        return above + sum(heights) + gap * (len(views) - 1) + below

    width = style.width_inches
    cell = max(0.5, (width - left - right) / columns)
    lies = whole(rows(cell)) < LEAST_HEIGHT  # the colour bar: it would be higher than all else
    if lies:
        right = 0.1
        cell = max(0.5, (width - left - right) / columns)
    width = max(width, left + right + columns * cell)
    heights = rows(cell)
    height = whole(heights) + lies * LYING_BAR
    figure = new_figure(width, height)
    y = height - above
    image = None
    for row, (name, view) in enumerate(zip(texels, views, strict=True)):
        y -= heights[row]
        sensor = recording.sensors[name]
        values = style.values(sensor, texels[name])
        inches = min((cell - 0.06) / view.width, heights[row] / view.height)
        view = view.at_size(inches)
        for column, i in enumerate(index):
            x = left + column * cell + 0.03
            axes = figure.add_axes((x / width, y / height, (cell - 0.06) / width, heights[row] / height))
            image = view.draw(axes, values[i], sensor.shear[i], strongest, top, style)
            axes.set_anchor("C")
            if row == 0:
                axes.set_title(f"{recording.times[i]:.2f} s", fontsize=FONT, color=INK, pad=4)
        middle = (y + heights[row] / 2) / height
        figure.text(0.06 / width, middle + 0.04 / height, wrapped(name), fontsize=FONT, color=INK, weight="bold", va="bottom")
        figure.text(0.06 / width, middle, view.caption, fontsize=SMALL, color=GREY, va="top", linespacing=1.3)
        shown = strongest if np.linalg.norm(sensor.shear[index], axis=2).max(initial=0.0) > SMALLEST_ARROW * strongest else 0.0
        start = min(left + 0.5 * (cell - inches * view.width), width - right - scale_key_width(view, shown, inches))
        draw_scale_key(figure, (max(start, 0.06), y - 0.2), view, shown, inches)
        y -= gap
    assert image is not None
    if lies:
        long = min(0.5 * width, 3.2)
        place = (left + 0.03, LYING_BAR - 0.15, long, 0.11)
    else:
        tall = min(height - 0.5, 3.2)
        place = (width - right + 0.1, 0.5 * (height - tall), 0.11, tall)
    bar = figure.add_axes((place[0] / width, place[1] / height, place[2] / width, place[3] / height))
    draw_colour_bar(figure, image, bar, style)
    save_figure(figure, path, style.dpi)


def wrapped(name: str) -> str:
    """Return a sensor's name on lines that fit beside its images."""
    import textwrap

    return "\n".join(textwrap.wrap(name, 12)) or name
