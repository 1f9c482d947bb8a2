# SPDX-License-Identifier: GPL-3.0-or-later
"""Tactile images over time: one row of images per sensor, one column per frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import response
from ..geometry.texels import Texels
from ..model.recording import Recording
from .figure_canvas import new_figure, save_figure
from .figure_style import FONT, GREY, INK, SMALL, FigureStyle
from .quantities import Scale
from .tactile_image import SMALLEST_ARROW, SensorView, draw_colour_bar, draw_scale_key, scale_key_width

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = {"single": 3, "middle": 5, "double": 6}
"""Images in a row, by the figure's width, where the frames are not chosen by hand."""
LEAST_HEIGHT, LYING_BAR = 1.9, 0.55
"""Inches: height from which on the colour bar stands at the side of a figure, and the height that it takes up below."""
_LEFT, _RIGHT, _ABOVE, _GAP, _BELOW = 0.95, 0.9, 0.28, 0.36, 0.42
"""Inches around the images and between their rows."""


def tactile_strip(
    path: str | Path,
    recording: Recording,
    texels: Mapping[str, Texels],
    frames: Sequence[int] | np.ndarray | None = None,
    style: FigureStyle | None = None,
) -> None:
    """Write :func:`strip_figure`, whose arguments these are, as PNG, PDF or SVG, by the ending of the path."""
    style = style or FigureStyle()
    save_figure(strip_figure(recording, texels, frames, style), path, style.dpi)


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
    strip = _Strip(
        figure=new_figure(page.width, page.height),
        page=page,
        recording=recording,
        index=np.searchsorted(recording.frames, chosen),
        strongest_shear=response.peak_shear(recording),
        scale=style.scale(recording, texels),
    )
    image, y = None, page.height - _ABOVE
    for row, (name, view) in enumerate(zip(texels, views, strict=True)):
        y -= page.rows[row]
        image = strip.draw_row(row, y, name, view)
        y -= _GAP
    assert image is not None
    x, y, across, up = page.colour_bar()
    bar = strip.figure.add_axes((x / page.width, y / page.height, across / page.width, up / page.height))
    draw_colour_bar(strip.figure, image, bar, strip.scale)
    return strip.figure


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


@dataclass(frozen=True)
class _Strip:
    """A figure while its rows are drawn.

    Attributes
    ----------
    index : (columns,) int
        Numbers of the chosen frames in the recording.
    strongest_shear : float, N
        Of the recording, which the longest arrow stands for.
    scale : Scale
    """

    figure: Figure
    page: _Page
    recording: Recording
    index: np.ndarray
    strongest_shear: float
    scale: Scale

    def draw_row(self, row: int, y: float, name: str, view: SensorView) -> Any:
        """Draw the images of one sensor, `y` inches above the lower edge, with its name and scale; return the last image."""
        page, figure, sensor = self.page, self.figure, self.recording.sensors[name]
        across, up = page.cell - 0.06, page.rows[row]
        values = self.scale.values(sensor, view.texels)
        inches = min(across / view.width, up / view.height)
        view = view.at_size(inches)
        image = None
        for column, i in enumerate(self.index):
            x = _LEFT + column * page.cell + 0.03
            axes = figure.add_axes((x / page.width, y / page.height, across / page.width, up / page.height))
            image = view.draw(axes, values[i], sensor.shear[i], self.strongest_shear, self.scale)
            axes.set_anchor("C")
            if row == 0:
                axes.set_title(f"{self.recording.times[i]:.2f} s", fontsize=FONT, color=INK, pad=4)
        middle = (y + up / 2) / page.height
        left = 0.06 / page.width
        figure.text(left, middle + 0.04 / page.height, wrapped(name), fontsize=FONT, color=INK, weight="bold", va="bottom")
        figure.text(left, middle, view.caption, fontsize=SMALL, color=GREY, va="top", linespacing=1.3)
        own = np.linalg.norm(sensor.shear[self.index], axis=2).max(initial=0.0)
        shown = self.strongest_shear if own > SMALLEST_ARROW * self.strongest_shear else 0.0
        centred = _LEFT + 0.5 * (page.cell - inches * view.width)
        start = min(centred, page.width - page.right - scale_key_width(view, shown, inches))
        draw_scale_key(figure, (max(start, 0.06), y - 0.2), view, shown, inches)
        return image


def wrapped(name: str) -> str:
    """Return a sensor's name on lines that fit beside its images."""
    import textwrap

    return "\n".join(textwrap.wrap(name, 12)) or name
