# SPDX-License-Identifier: GPL-3.0-or-later
"""The number of every texel at one frame, over its colour."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import SensorError
from ..geometry.grid_layout import GridLayout
from ..geometry.texels import Texels
from ..model.recording import Recording
from .figure_canvas import axes_in_inches, new_figure, save_figure
from .figure_style import FONT, INK, SMALL, FigureStyle
from .tactile_image import SensorView, draw_colour_bar

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST = 1024
"""Texels whose numbers can still be told apart on a page."""
_LETTER = 0.62
"""Width of a digit over the size of its font."""
ZERO = "0"
_RIGHT, _ABOVE, _SIDE = 0.95, 0.32, 0.12
"""Inches around the image: for the colour bar, for the title, and elsewhere."""


def why_unreadable(name: str, texels: Texels) -> str:
    """Return why the numbers of a sensor cannot be drawn; empty if they can."""
    if len(texels) <= _MOST:
        return ""
    return (
        f"Sensor '{name}' has {len(texels):,} texels, whose numbers could not be read (at most {_MOST:,}): "
        "export them as CSV instead."
    )


def texel_numbers(
    path: str | Path,
    recording: Recording,
    texels: Mapping[str, Texels],
    name: str,
    frame: int,
    style: FigureStyle | None = None,
) -> None:
    """Write the values of one sensor's texels at one frame as numbers on its tactile image.

    Numbers below one are in a finer unit where there is one, so that three digits suffice. The colours
    are those of the sensor's other figures. Where a journal's column is too narrow for the numbers, the figure is wider.

    Parameters
    ----------
    name : str
        Of the sensor.
    frame : int

    Raises
    ------
    SensorError
        The sensor has so many texels that their numbers could not be read.
    KeyError
        The frame was not recorded.
    """
    style = style or FigureStyle()
    own = texels[name]
    if reason := why_unreadable(name, own):
        raise SensorError(reason)
    scale = style.scale(recording, texels)
    values = scale.values(recording.at(frame).sensors[name], own)
    peak = float(np.abs(values).max(initial=0.0))
    scale, factor = scale.in_finer_unit(peak)
    values = values * factor
    view = SensorView.of(own, recording.sensors[name].normal_force.sum(axis=0))
    words = [_digits(value, peak * factor) for value in values]

    # The closest pair of texels must leave room for a number of 8 pt between their middles.
    letters = max(len(word) for word in words) * _LETTER * SMALL / 72 + 0.05
    inches = max(letters / _room(view), (1.5 * SMALL / 72) / _room(view, 1))
    inches = max(inches, min((style.width_inches - _RIGHT - 2 * _SIDE) / view.width, 6.0 / view.height))
    width, height = inches * view.width + 2 * _SIDE + _RIGHT, max(inches * view.height + _ABOVE + _SIDE, 1.9)
    figure = new_figure(width, height)
    axes = axes_in_inches(figure, _SIDE, _SIDE, inches * view.width, inches * view.height)
    axes.set_anchor("NW")
    image = view.draw(axes, values, np.zeros((len(own), 2)), 0.0, scale)
    if not isinstance(own.layout, GridLayout):  # texels lie on the very rim there: room for their numbers
        room = 0.5 * letters / inches
        left, right, bottom, top = view.window
        axes.set(xlim=(left - room, right + room), ylim=(bottom - room, top + room))
    _write_numbers(axes, view, words, image.cmap(image.norm(values)))
    time = recording.times[int(np.searchsorted(recording.frames, frame))]
    title = f"{name}, {time:.2f} s, numbers in {scale.unit}"
    figure.text(_SIDE / width, 1 - 0.05 / height, title, fontsize=FONT, color=INK, weight="bold", va="top")
    tall = max(inches * view.height, 1.2)
    bar = axes_in_inches(figure, width - _RIGHT + 0.08, _SIDE, 0.11, tall)
    draw_colour_bar(figure, image, bar, scale)
    save_figure(figure, path, style.dpi)


def _write_numbers(axes: Axes, view: SensorView, words: list[str], colours: np.ndarray) -> None:
    """Write a word on each texel in view that is not at zero, in ink that is legible on the texel's (n, 4) colour."""
    from matplotlib.patheffects import withStroke

    on_grid = isinstance(view.texels.layout, GridLayout)
    for texel in np.flatnonzero(view.seen):
        (x, y), word, colour = view.points[texel], words[texel], colours[texel]
        if word == ZERO:  # the colour says it, and so many zeros would hide the others
            continue
        light = float(np.dot(colour[:3], (0.299, 0.587, 0.114))) > 0.5
        ink, around = (INK, "white") if light else ("white", INK)
        # Without a grid, numbers at the edge lie half on the white page.
        rim = [] if on_grid else [withStroke(linewidth=1.2, foreground=around, alpha=0.55)]
        axes.text(x, y, word, fontsize=SMALL, color=ink, ha="center", va="center_baseline", path_effects=rim)


def _digits(value: float, peak: float) -> str:
    """Return a number with as many decimals as give the largest one three digits."""
    decimals = 0 if peak <= 0 else int(np.clip(2 - np.floor(np.log10(peak)), 0, 3))
    text = f"{value:.{decimals}f}"
    return ZERO if float(text) == 0.0 else text


def _room(view: SensorView, axis: int = 0) -> float:
    """Millimetres between the middles of neighbouring texels along the image's x (0) or y (1) axis."""
    layout = view.texels.layout
    if isinstance(layout, GridLayout):
        return (view.width / layout.columns, view.height / layout.rows)[axis]
    # without rows and columns: what a square of the mean area per texel has as its side, a little less
    return 0.8 * float(np.sqrt(view.width * view.height / len(view.texels)))
