# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour bar, tactile images and labels on a rendered picture of the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .. import response
from ..geometry.texels import Texels
from ..model.recording import Recording
from .figure_canvas import axes_in_inches, new_figure, save_figure
from .figure_style import FONT, FigureStyle
from .tactile_image import SensorView, draw_colour_bar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 160
"""Of a picture 1280 pixels wide: text then has its 8 pt when the picture is shown at eight inches."""


def label_picture(
    source: str | Path,
    path: str | Path,
    recording: Recording,
    texels: Mapping[str, Texels],
    frame: int,
    *,
    style: FigureStyle | None = None,
    labels: Sequence[tuple[str, tuple[float, float]]] = (),
) -> None:
    """Put a colour bar, the tactile images of `frame`, and labels on a rendered picture.

    Parameters
    ----------
    source, path : str or Path
        The rendered PNG and the PNG to write; they may be the same file. The size in pixels stays as it is.
    labels : sequence of (str, (float, float)), optional
        Words, the first line of which is set bold, and where they stand: shares of the picture's width and height from its
        lower left corner.
    """
    from matplotlib.image import imread

    style = style or FigureStyle()
    picture = imread(source)
    pixels_y, pixels_x = picture.shape[:2]
    dpi = round(DPI * pixels_x / 1280)
    width, height = pixels_x / dpi, pixels_y / dpi
    figure = new_figure(width, height)
    background = figure.add_axes((0, 0, 1, 1))
    background.imshow(picture, aspect="auto", interpolation="none")
    background.set_axis_off()

    sensors = recording.at(frame).sensors
    scale, strongest = style.scale(recording, texels), response.peak_shear(recording)
    views = [SensorView.of(texels[name], recording.sensors[name].normal_force.sum(axis=0)) for name in texels]
    image = None
    # A column at the right edge: one tactile image per sensor over each other, the colour bar beside them.
    column, bar_room, title = 0.74, 0.72, 0.24
    x = width - column - bar_room - 0.12
    room = height - 0.3
    each = min(1.75, room / max(len(views), 1) - title)
    y = height - 0.5 * (height - len(views) * (each + title))
    y_top = y - title
    for name, view in zip(texels, views, strict=True):
        y -= title
        figure.text(
            (x + column / 2) / width, (y + 0.05) / height, name, fontsize=FONT, color="white", weight="bold", ha="center"
        )
        y -= each
        axes = axes_in_inches(figure, x, y, column, each)
        values = scale.values(sensors[name], texels[name])
        view = view.at_size(min(column / view.width, each / view.height))
        image = view.draw(axes, values, sensors[name].shear, strongest, scale, edge="#ffffff80")
    if image is not None:
        bar = axes_in_inches(figure, width - bar_room, y, 0.12, y_top - y)
        draw_colour_bar(figure, image, bar, scale, ink="white")
    for words, place in labels:
        _draw_label(figure, words, place)
    save_figure(figure, path, dpi)


def _draw_label(figure: Figure, words: str, place: tuple[float, float]) -> None:
    (x, y), (first, _, rest) = place, words.partition("\n")
    below = y - 0.03 / float(figure.get_figheight())
    figure.text(x, y, first, fontsize=FONT + 1.5, color="white", weight="bold", va="bottom", ha="left")
    figure.text(x, below, rest, fontsize=FONT, color="#e3e8ee", va="top", ha="left", linespacing=1.35)
