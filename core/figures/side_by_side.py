# SPDX-License-Identifier: GPL-3.0-or-later
"""A rendered picture with tactile images, a colour bar and the force up to the frame beside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .. import response
from ..geometry.texels import Texels
from ..io.bake_reader import frame_index
from ..model.recording import Recording, SensorRecording
from .figure_canvas import axes_in_inches, new_figure, save_figure, tidy_axes
from .figure_style import FONT, INK, SERIES, SMALL, FigureStyle, width_below
from .tactile_image import (
    SCALE_KEY_LINE,
    SensorView,
    draw_colour_bar,
    draw_scale_key,
    scale_key_widths,
    shear_of_arrow,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST = 4
"""Sensors whose images fit over one another."""
_TALL, _SIDE, _MARGIN = 4.5, 2.5, 0.14
"""Inches: height of the whole, width of what is beside the picture, and around and between that."""
_NAME, _BAR, _CURVE = 0.22, 0.72, 1.05
"""Inches that a sensor's name and the colour bar take up, and the curves at least."""
_MOST_CURVE = 1.7
"""Inches of the curves where images leave so much."""
_LETTER = 0.085
"""Inches that a letter of a name takes."""


def side_by_side(
    source: str | Path,
    path: str | Path,
    recording: Recording,
    texels: Mapping[str, Texels],
    frame: int,
    style: FigureStyle | None = None,
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

    style = style or FigureStyle()
    picture = imread(source)
    i = frame_index(recording, frame)
    shown = dict(list(texels.items())[:_MOST])
    dpi = height / _TALL  # text of 8 pt can then be read at the height of a page's figure
    wide = _TALL * picture.shape[1] / picture.shape[0]
    pixels = 2 * round(0.5 * (wide + _SIDE) * dpi), 2 * round(0.5 * height)
    width = pixels[0] / dpi
    figure = new_figure(width, _TALL)
    axes = axes_in_inches(figure, 0.0, 0.0, wide, _TALL)
    axes.imshow(picture, aspect="auto", interpolation="antialiased")
    axes.set_axis_off()

    scale, strongest = style.scale(recording, texels), response.peak_shear(recording)
    left, beside = wide + _MARGIN, _SIDE - 2 * _MARGIN
    parts = [_Part.of(own, recording.sensors[name], strongest) for name, own in shown.items()]
    places, room = _placed(parts, beside, _TALL - _CURVE - _BAR - _MARGIN)
    image, low = None, _TALL
    for number, ((name, own), part, (x, y, inches)) in enumerate(zip(shown.items(), parts, places, strict=True)):
        sensor, view = recording.sensors[name], part.view.at_size(inches)
        x, y, across, up = left + x, _TALL - _MARGIN - y, inches * view.width, inches * view.height
        colour = SERIES[number] if len(shown) > 1 else INK
        words = name if len(name) * _LETTER < room else name[: int(room / _LETTER) - 1] + "…"
        figure.text(x / width, y / _TALL, words, fontsize=FONT, color=colour, weight="bold", va="top")
        place = axes_in_inches(figure, x, y - _NAME - up, across, up)
        image = view.draw(place, scale.values(sensor, own)[i], sensor.shear[i], strongest, scale)
        draw_scale_key(figure, (x, y - _NAME - up - 0.1), view, part.strongest, inches, room)
        low = min(low, y - _NAME - up - part.below(inches, room))
    if image is not None:
        draw_colour_bar(figure, image, axes_in_inches(figure, left + 0.1, low - 0.24, beside - 0.2, 0.1), scale)
    curve = min(low - _BAR, _MOST_CURVE)
    _force_so_far(axes_in_inches(figure, left + 0.3, 0.3, beside - 0.38, curve - 0.5), recording, i, shown)
    save_figure(figure, path, dpi)


class _Part(NamedTuple):
    """A sensor's image, and the shear that its arrow stands for (N, zero without any)."""

    view: SensorView
    strongest: float

    @classmethod
    def of(cls, texels: Texels, sensor: SensorRecording, strongest: float) -> _Part:
        view = SensorView.of(texels, sensor.normal_force.sum(axis=0))
        return cls(view, shear_of_arrow(sensor.shear, strongest))

    def inches(self, room: float, up: float) -> float:
        """Return the inches per millimetre that fit into a cell, `room` inches wide, with name, scale bar and arrow."""
        for lines in (1, 2):
            size = min(room / self.view.width, (up - _NAME - 0.03 - lines * SCALE_KEY_LINE) / self.view.height)
            if self.below(size, room) < 0.03 + 1.5 * SCALE_KEY_LINE:
                break
        return size

    def below(self, inches: float, room: float) -> float:
        """Return the inches that scale bar and arrow take up."""
        both = scale_key_widths(self.view.at_size(inches), self.strongest, inches)[0] > room
        return 0.03 + (1 + both) * SCALE_KEY_LINE


def _placed(parts: list[_Part], across: float, up: float) -> tuple[list[tuple[float, float, float]], float]:
    """Return x, y downwards and inches per millimetre of each image, in columns that make them largest, and their room."""
    best: list[tuple[float, float, float]] = []
    most, best_room = -1.0, across
    for columns in range(1, len(parts) + 1):
        rows = -(-len(parts) // columns)
        room, height = (across - (columns - 1) * _MARGIN) / columns, (up - (rows - 1) * 0.06) / rows
        sized = [(part, part.inches(room, height)) for part in parts]
        area = sum(size**2 * part.view.width * part.view.height for part, size in sized)
        lines = (scale_key_widths(part.view.at_size(size), part.strongest, size)[1] for part, size in sized)
        legible = columns == 1 or all(line <= room for line in lines)
        if legible and min(size for _, size in sized) > 0 and area > most:
            most, best_room = area, room
            best = [
                (number % columns * (room + _MARGIN), number // columns * (height + 0.06), size)
                for number, (_, size) in enumerate(sized)
            ]
    return best, best_room


def _force_so_far(axes: Axes, recording: Recording, i: int, texels: Mapping[str, Texels]) -> None:
    for number, name in enumerate(texels):
        force = recording.sensors[name].normal_force.sum(axis=1)
        width = width_below(len(texels) - 1 - number)
        axes.plot(recording.times, force, color=SERIES[number], lw=width - 0.5, alpha=0.35)
        axes.plot(recording.times[: i + 1], force[: i + 1], color=SERIES[number], lw=width)
        axes.plot(recording.times[i], force[i], "o", color=SERIES[number], ms=2.3 + width, clip_on=False)
    axes.margins(x=0.02, y=0.12)  # room for the marker at the peak
    axes.set_ylim(bottom=0)
    axes.set_xlabel("time (s)", labelpad=-7)
    axes.set_title("normal force (N)", fontsize=SMALL, color=INK, loc="left", pad=3)
    tidy_axes(axes)
    last = float(np.max(recording.times))
    axes.set_xticks([0.0, round(last, 1)] if last > 0.1 else [0.0])
