# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of a study's report: metrics over what was varied, and a sheet of tactile images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.figures.figure_canvas import new_figure, save_figure, tidy_axes
from ..core.figures.figure_style import FONT, GREY, INK, NORMAL_COLOUR, SHEAR_COLOUR, SMALL, FigureStyle
from ..core.figures.tactile_image import SensorView, draw_colour_bar
from ..core.geometry.texels import Texels
from ..core.response.metrics import scale_limit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_PARAMETERS, MOST_METRICS = 6, 6
"""Columns and rows of the small multiples."""
MOST_NAMES = 12
"""Names of a choice that have room below one column."""
MOST_LETTERS = 14
"""Letters that have room below one column: of all names in a row, or of each upright. The end of a longer one tells more."""
MOST_POINTS = 2000
"""Runs that are drawn as points; of more, as many are chosen evenly."""
MEDIAN_BINS, LEAST_PER_BIN = 10, 4
DPI = 130
IMAGES_ACROSS = 6


@dataclass(frozen=True)
class RunImage:
    """The moment of a run at which the net force on a sensor is largest."""

    label: str
    texels: Texels
    normal_force: np.ndarray
    shear: np.ndarray


def draw_small_multiples(
    path: Path, values: Mapping[str, Sequence[object]], metrics: Mapping[str, np.ndarray], strong: set[tuple[str, str]]
) -> None:
    """Draw each metric over each parameter: a point for each run, and the median where there are enough of them.

    Parameters
    ----------
    path : Path
        PNG.
    values, metrics
        As for :func:`.dependencies.dependencies`; one column and one row of axes each.
    strong : set of (parameter, metric)
        Pairs whose median is drawn in colour, because a dependency was detected.
    """
    columns, rows = len(values), len(metrics)
    has_names = any(isinstance(value, str) for own in values.values() for value in own)
    cell_width, cell_height, left, below = 1.75, 1.3, 0.85, 1.25 if has_names else 0.55
    width, height = left + cell_width * columns + 0.1, below + cell_height * rows + 0.1
    figure = new_figure(width, height)
    for column, (parameter, own) in enumerate(values.items()):
        for row, (metric, numbers) in enumerate(metrics.items()):
            x, y = left + cell_width * column, height - 0.1 - cell_height * (row + 1)
            place = (x / width, (y + 0.12) / height, (cell_width - 0.25) / width, (cell_height - 0.22) / height)
            axes = figure.add_axes(place)
            tidy_axes(axes)
            _draw_cell(axes, own, numbers, SHEAR_COLOUR if (parameter, metric) in strong else GREY)
            _few_ticks(axes, own)
            if column == 0:
                axes.set_ylabel(_wrapped(metric), fontsize=FONT, color=INK)
            else:
                axes.tick_params(labelleft=False)
            if row == rows - 1:
                axes.set_xlabel(_wrapped(parameter), fontsize=FONT, color=INK)
            else:
                axes.tick_params(labelbottom=False)
    save_figure(figure, path, DPI)


def _wrapped(name: str) -> str:
    """Break a long name after a dot or an underscore."""
    if len(name) <= 16:
        return name
    middle = len(name) // 2
    cuts = [place + 1 for place, letter in enumerate(name[:-1]) if letter in "._ /"]
    cut = min(cuts, key=lambda place: abs(place - middle), default=len(name))
    return f"{name[:cut]}\n{name[cut:]}"


def _draw_cell(axes: Axes, own: Sequence[object], numbers: np.ndarray, colour: str) -> None:
    known = np.isfinite(numbers) & np.array([value is not None for value in own], bool)
    chosen = np.nonzero(known)[0]
    if len(chosen) == 0:
        return
    if any(isinstance(value, str) for value in own):
        _draw_choices(axes, own, numbers, chosen, colour)
        return
    column = np.array([value if isinstance(value, float | int) else np.nan for value in own], float)
    if _is_logarithmic(column[chosen]):
        axes.set_xscale("log")
    few = chosen[np.linspace(0, len(chosen) - 1, min(len(chosen), MOST_POINTS)).round().astype(int)]
    axes.plot(column[few], numbers[few], ".", ms=2.5 if len(few) > 200 else 4, color=NORMAL_COLOUR, alpha=0.45, mew=0)
    parts = np.array_split(chosen[np.argsort(column[chosen], kind="stable")], MEDIAN_BINS)
    if min(map(len, parts)) >= LEAST_PER_BIN:
        x, y = [[float(np.median(of[part])) for part in parts] for of in (column, numbers)]
        axes.plot(x, y, "-", color=colour, lw=1.6)


def _draw_choices(axes: Axes, own: Sequence[object], numbers: np.ndarray, chosen: np.ndarray, colour: str) -> None:
    """Draw a box for each name of a choice."""
    names = sorted({str(own[i]) for i in chosen})
    groups = [numbers[[i for i in chosen if str(own[i]) == name]] for name in names]
    drawn = axes.boxplot(groups, widths=0.5, showfliers=False, medianprops={"color": colour, "lw": 1.6})
    for line in (*drawn["boxes"], *drawn["whiskers"], *drawn["caps"]):
        line.set(color=NORMAL_COLOUR, lw=0.8)
    shown = [name if len(name) <= MOST_LETTERS else f"…{name[1 - MOST_LETTERS :]}" for name in names]
    if len(set(shown)) < len(names):
        shown = names
    axes.set_xticks(range(1, len(names) + 1), shown, rotation=90 if len("".join(shown)) > MOST_LETTERS else 0)


def _is_logarithmic(column: np.ndarray) -> bool:
    """Return True if numbers are spread more evenly over their logarithms, as those of a log-uniform design are."""
    if column.min() <= 0 or column.max() < 5 * column.min():
        return False

    def unevenness(of: np.ndarray) -> float:
        even = np.linspace(of.min(), of.max(), len(of))
        return float(np.abs(np.sort(of) - even).max() / np.ptp(of))

    return unevenness(np.log(column)) < unevenness(column)


def _few_ticks(axes: Axes, own: Sequence[object]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

    axes.yaxis.set_major_locator(MaxNLocator(3))
    if axes.get_xscale() == "log":
        low, high = axes.get_xlim()
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 100 * low else (1.0,), numticks=5))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
    elif not any(isinstance(value, str) for value in own):
        axes.xaxis.set_major_locator(MaxNLocator(3))


def draw_image_sheet(path: Path, images: Sequence[RunImage]) -> None:
    """Draw tactile images of some runs, all in one scale of colours and one of arrows.

    Parameters
    ----------
    path : Path
        PNG.
    images : sequence of RunImage
        One at least.
    """
    style = FigureStyle()
    peak = max(float(image.normal_force.max(initial=0.0)) for image in images)
    shear = max(float(np.linalg.norm(image.shear, axis=1).max(initial=0.0)) for image in images)
    views = [SensorView.of(image.texels, image.normal_force) for image in images]
    across = min(len(images), IMAGES_ACROSS)
    rows = -(-len(images) // across)
    cell = 1.35
    tall = float(np.clip(max(view.height / view.width for view in views) * cell, 0.5, 2.4))
    width, height = max(across * cell, 3.4) + 0.9, rows * (tall + 0.3) + 0.1
    figure = new_figure(width, height)
    drawn: Any = None
    for number, (image, view) in enumerate(zip(images, views, strict=True)):
        row, column = divmod(number, across)
        place = (column * cell + 0.08) / width, (height - (row + 1) * (tall + 0.3) + 0.02) / height
        axes = figure.add_axes((*place, (cell - 0.16) / width, tall / height))
        drawn = view.at_size(tall / max(view.height, view.width)).draw(
            axes, image.normal_force, image.shear, shear, scale_limit(peak) if peak > 0 else 1.0, style
        )
        axes.set_title(image.label, fontsize=SMALL, color=INK, pad=2)
    up = min(height - 0.3, 3.0)
    bar = figure.add_axes(((width - 0.8) / width, (height - up) / 2 / height, 0.11 / width, up / height))
    draw_colour_bar(figure, drawn, bar, style)
    save_figure(figure, path, DPI)
