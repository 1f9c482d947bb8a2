# SPDX-License-Identifier: GPL-3.0-or-later
"""Tactile images over time: one row of images per sensor, one column per frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .. import response
from ..geometry.texels import Texels
from ..model.recording import Recording
from .figure_canvas import axes_in_inches, new_figure
from .figure_style import FONT, GREY, INK, SMALL, FigureStyle
from .tactile_image import SensorView, draw_colour_bar, draw_scale_key, scale_key_widths, shear_of_arrow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = {"single": 3, "middle": 5, "double": 6}
"""Images in a row, by the figure's width, where the frames are not chosen by hand."""
LEAST_HEIGHT, LYING_BAR = 1.9, 0.55
"""Inches: height from which on the colour bar stands at the side of a figure, and the height that it takes up below."""
_LEFT, _RIGHT, _ABOVE, _GAP, _BELOW = 0.95, 0.9, 0.28, 0.36, 0.42
"""Inches around the images and between their rows."""


def strip_figure(
    recording: Recording,
    texels: Mapping[str, Texels],
    frames: Sequence[int] | np.ndarray | None = None,
    style: FigureStyle | None = None,
) -> Figure:
    """Return a figure of the tactile images of all sensors over time: a quantity in colour, shear as arrows.

    Parameters
    ----------
    recording : Recording
    texels : mapping of str to Texels
        By sensor name; one row of images each, in this order.
    frames : sequence of int, optional
        Frame numbers, one column each. Default: as many as fit, spread over the time in which the forces change.
    style : FigureStyle, optional
    """
    style = style or FigureStyle()
    chosen = response.choose_frames(recording, COLUMNS[style.width]) if frames is None else np.asarray(frames)
    views = [SensorView.of(own, recording.sensors[name].normal_force.sum(axis=0)) for name, own in texels.items()]
    page = _Page.of(style.width_inches, len(chosen), views)
    figure, index = new_figure(page.width, page.height), np.searchsorted(recording.frames, chosen)
    strongest, scale = response.peak_shear(recording), style.scale(recording, texels)
    image, y = None, page.height - _ABOVE
    for row, (name, view, up) in enumerate(zip(texels, views, page.rows, strict=True)):
        y -= up
        sensor, across = recording.sensors[name], page.cell - 0.06
        inches = min(across / view.width, up / view.height)
        view, values = view.at_size(inches), scale.values(sensor, view.texels)
        for column, i in enumerate(index):
            axes = axes_in_inches(figure, _LEFT + column * page.cell + 0.03, y, across, up)
            image = view.draw(axes, values[i], sensor.shear[i], strongest, scale)
            axes.set_anchor("C")
            if row == 0:
                axes.set_title(f"{recording.times[i]:.2f} s", fontsize=FONT, color=INK, pad=4)
        middle, left = (y + up / 2) / page.height, 0.06 / page.width
        figure.text(left, middle + 0.04 / page.height, wrapped(name), fontsize=FONT, color=INK, weight="bold", va="bottom")
        figure.text(left, middle, view.caption, fontsize=SMALL, color=GREY, va="top", linespacing=1.3)
        shown = shear_of_arrow(sensor.shear[index], strongest)
        centred = _LEFT + 0.5 * (page.cell - inches * view.width)
        start = min(centred, page.width - page.right - scale_key_widths(view, shown, inches)[0])
        draw_scale_key(figure, (max(start, 0.06), y - 0.2), view, shown, inches)
        y -= _GAP
    assert image is not None
    draw_colour_bar(figure, image, axes_in_inches(figure, *page.colour_bar()), scale)
    return figure


@dataclass(frozen=True)
class _Page:
    """Sizes in inches: the figure is as high as its rows need, so that images keep their shape and text its size.

    Attributes
    ----------
    width, height : float
    cell : float
        Width of an image with the space around it.
    rows : list of float
        Heights of the rows of images.
    right : float
        Space at the right edge.
    bar_below : bool
        The colour bar lies below the images, because the figure is too low for it to stand.
    """

    width: float
    height: float
    cell: float
    rows: list[float]
    right: float
    bar_below: bool

    @classmethod
    def of(cls, width: float, columns: int, views: Sequence[SensorView]) -> _Page:
        """Return the sizes of a figure that is to be `width` wide; it is wider where its columns need more."""

        def sizes(right: float) -> tuple[float, list[float], float]:
            cell = max(0.5, (width - _LEFT - right) / columns)
            rows = [min(max(cell * 0.86 * view.height / view.width, 0.5), 2.4) for view in views]
            return cell, rows, _ABOVE + sum(rows) + _GAP * (len(views) - 1) + _BELOW

        right = _RIGHT
        cell, rows, height = sizes(right)
        bar_below = height < LEAST_HEIGHT  # it would be higher than all else
        if bar_below:
            right = 0.1
            cell, rows, height = sizes(right)
        return cls(max(width, _LEFT + right + columns * cell), height + bar_below * LYING_BAR, cell, rows, right, bar_below)

    def colour_bar(self) -> tuple[float, float, float, float]:
        """Return x, y, width and height of the colour bar."""
        if self.bar_below:
            return _LEFT + 0.03, LYING_BAR - 0.15, min(0.5 * self.width, 3.2), 0.11
        tall = min(self.height - 0.5, 3.2)
        return self.width - self.right + 0.1, 0.5 * (self.height - tall), 0.11, tall


def wrapped(name: str) -> str:
    """Return a sensor's name on lines that fit beside its images."""
    import textwrap

    return "\n".join(textwrap.wrap(name, 12)) or name
