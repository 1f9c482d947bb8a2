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
from ..core.figures.quantities import Extent
from ..core.figures.tactile_image import SensorView, draw_colour_bar
from ..core.geometry.texels import Texels
from .dependencies import is_known

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_PARAMETERS, MOST_METRICS = 6, 6
"""Columns and rows of the small multiples."""
MOST_NAMES = 12
"""Names of a choice that have room below one column."""
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
    path: Path,
    values: Mapping[str, np.ndarray],
    metrics: Mapping[str, np.ndarray],
    parameters: Sequence[str],
    measured: Sequence[str],
    strong: set[tuple[str, str]],
) -> None:
    """Draw each metric over each parameter: a point for each run, and the median where there are enough of them.

    Parameters
    ----------
    path : Path
        PNG.
    values, metrics
        As for :func:`.dependencies.dependencies`.
    parameters, measured : sequence of str
        Those that get a column and a row of axes.
    strong : set of (parameter, metric)
        Pairs whose median is drawn in colour, because a dependency was detected.
    """
    figure = new_figure(1.2 + 1.75 * len(parameters), 0.8 + 1.3 * len(measured))
    figure.set_layout_engine("constrained")
    grid = figure.subplots(len(measured), len(parameters), sharex="col", sharey="row", squeeze=False)
    for column, parameter in enumerate(parameters):
        own = values[parameter]
        for row, metric in enumerate(measured):
            axes, numbers = grid[row, column], metrics[metric]
            tidy_axes(axes)
            axes.locator_params(axis="y", nbins=3)
            known = np.isfinite(numbers) & is_known(own)
            colour = SHEAR_COLOUR if (parameter, metric) in strong else GREY
            if known.any():
                (_draw_choices if own.dtype == object else _draw_numbers)(axes, own[known], numbers[known], colour)
            if column == 0:
                axes.set_ylabel(_wrapped(metric), fontsize=FONT, color=INK)
            if row == len(measured) - 1:
                axes.set_xlabel(_wrapped(parameter), fontsize=FONT, color=INK)
    save_figure(figure, path, DPI)


def _wrapped(name: str) -> str:
    """Break a long name after the dot or underscore that is nearest to its middle."""
    cuts = [place + 1 for place, letter in enumerate(name[:-1]) if letter in "._ /"] if len(name) > 16 else []
    cut = min(cuts, key=lambda place: abs(place - len(name) // 2), default=len(name))
    return f"{name[:cut]}\n{name[cut:]}"


def _draw_numbers(axes: Axes, column: np.ndarray, numbers: np.ndarray, colour: str) -> None:
    if column.min() > 0.0 and np.median(column) < 0.5 * (column.min() + column.max()) / 2:  # as of a log-uniform distribution
        axes.set_xscale("log")
    else:
        axes.locator_params(axis="x", nbins=3)
    few = np.linspace(0, len(column) - 1, min(len(column), MOST_POINTS)).round().astype(int)
    axes.plot(column[few], numbers[few], ".", ms=2.5 if len(few) > 200 else 4, color=NORMAL_COLOUR, alpha=0.45, mew=0)
    parts = np.array_split(np.argsort(column, kind="stable"), MEDIAN_BINS)
    if min(map(len, parts)) >= LEAST_PER_BIN:
        x, y = [[float(np.median(of[part])) for part in parts] for of in (column, numbers)]
        axes.plot(x, y, "-", color=colour, lw=1.6)


def _draw_choices(axes: Axes, column: np.ndarray, numbers: np.ndarray, colour: str) -> None:
    """Draw a box for each name of a choice."""
    names = sorted(set(column))
    groups = [numbers[column == name] for name in names]
    drawn = axes.boxplot(groups, widths=0.5, showfliers=False, medianprops={"color": colour, "lw": 1.6})
    for line in (*drawn["boxes"], *drawn["whiskers"], *drawn["caps"]):
        line.set(color=NORMAL_COLOUR, lw=0.8)
    axes.set_xticks(range(1, len(names) + 1), names, rotation=90 if len("".join(names)) > 14 else 0)


def draw_image_sheet(path: Path, images: Sequence[RunImage]) -> None:
    """Draw tactile images of some runs, all in one scale of colours and one of arrows.

    Parameters
    ----------
    path : Path
        PNG.
    images : sequence of RunImage
        One at least.
    """
    high = max(float(image.normal_force.max(initial=0.0)) for image in images)
    scale = FigureStyle().scale_of(Extent(0.0, high, ("N",)))
    shear = max(float(np.linalg.norm(image.shear, axis=1).max(initial=0.0)) for image in images)
    views = [SensorView.of(image.texels, image.normal_force) for image in images]
    across = min(len(images), IMAGES_ACROSS)
    rows = -(-len(images) // across)
    tall = float(np.clip(max(view.height / view.width for view in views) * 1.35, 0.5, 2.4))
    figure = new_figure(max(across * 1.35, 3.4) + 0.9, rows * (tall + 0.3) + 0.1)
    grid = figure.subplots(rows, across, squeeze=False)
    drawn: Any = None
    for axes in grid.flat[len(images) :]:
        axes.set_axis_off()
    for axes, image, view in zip(grid.flat, images, views, strict=False):
        drawn = view.at_size(tall / max(view.height, view.width)).draw(axes, image.normal_force, image.shear, shear, scale)
        axes.set_title(image.label, fontsize=SMALL, color=INK, pad=2)
    draw_colour_bar(figure, drawn, figure.add_axes((0.9, 0.25, 0.015, 0.5)), scale)
    figure.subplots_adjust(0.01, 0.01, 0.88, 1.0 - 0.2 / figure.get_figheight(), 0.1, 0.15)
    save_figure(figure, path, DPI)
