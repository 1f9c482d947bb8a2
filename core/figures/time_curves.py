# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves over time: forces with their friction limits, slip, centre of pressure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .. import response
from ..errors import ParameterError
from ..geometry.texels import Texels
from ..model.recording import Recording, SensorRecording
from ..model.sensor_parameters import SensorParameters
from .figure_canvas import new_figure, save_figure, tidy_axes
from .figure_style import FONT, INK, NORMAL_COLOUR, SERIES, SHEAR_COLOUR, SMALL, FigureStyle, width_below

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOADED = 1e-3
"""Share of the largest net force below which a centre of pressure is not drawn: it would jump about."""
_STROKES = ((1.0, "-"), (0.8, (0, (4, 2))))
"""Widths, as shares of a curve's, and dashes of the first and of the second line of a sensor."""


class _Panel(NamedTuple):
    """One kind of curves: its label, what solid and dashed lines are, the lines of a sensor, each (F,), and its limits."""

    label: str
    words: tuple[str, ...]
    values: Callable[[SensorRecording, Texels, SensorParameters], Sequence[np.ndarray]]
    set_limits: Callable[[Axes], object]


def _forces(sensor: SensorRecording, texels: Texels, _: SensorParameters) -> Sequence[np.ndarray]:
    return sensor.normal_force.sum(axis=1), np.linalg.norm(response.net_shear(sensor, texels), axis=1)


def _centre(sensor: SensorRecording, texels: Texels, _: SensorParameters) -> Sequence[np.ndarray]:
    load = sensor.normal_force.sum(axis=1)
    touching = (load > _LOADED * load.max(initial=0.0))[:, None]
    return (np.where(touching, 1e3 * sensor.centre_of_pressure, np.nan) @ _plane(texels).T).T


def _plane(texels: Texels) -> np.ndarray:
    """(2, 3) float: the sensor's mean x axis, and the y axis across it."""
    x = texels.tangent.mean(axis=0)
    y = texels.bitangent.mean(axis=0)
    if min(np.linalg.norm(x), np.linalg.norm(y)) < 0.1:  # all around a body: its own axes
        return np.eye(3)[:2]
    x /= np.linalg.norm(x)
    y -= (y @ x) * x
    return np.stack([x, y / np.linalg.norm(y)])


def _at_least_a_millimetre(axes: Axes) -> None:
    low, high = axes.get_ylim()
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 0.5)
    axes.set_ylim(middle - half, middle + half)


_PANELS = {
    "force": _Panel("force (N)", ("normal", "shear"), _forces, lambda axes: axes.set_ylim(bottom=0)),
    "slip": _Panel(
        "slipping\n(% of load)",
        (),
        lambda sensor, _, parameters: [100 * response.slip_share(sensor, parameters)],
        lambda axes: axes.set_ylim(-3, 103),
    ),
    "pressure centre": _Panel("centre of\npressure (mm)", ("x", "y"), _centre, _at_least_a_millimetre),
}
KINDS = tuple(_PANELS)


def curves_figure(
    recording: Recording,
    texels: Mapping[str, Texels],
    parameters: Mapping[str, SensorParameters],
    kinds: Sequence[str] = KINDS,
    style: FigureStyle | None = None,
) -> Figure:
    """Return a figure of forces, slip and centre of pressure of all sensors over time.

    There is one panel of each kind, and one colour per sensor.

    Parameters
    ----------
    kinds : sequence of {"force", "slip", "pressure centre"}
        "slip" is the share of the normal force that rests on slipping texels (:func:`.response.slip_share`); the centre of
        pressure is along the sensor's x and y axes, from the origin of its body.
    """
    style = style or FigureStyle()
    for kind in kinds:
        if kind not in KINDS:
            raise ParameterError(f"There are no curves of '{kind}': choose from {', '.join(KINDS)}.")
    names = list(texels)
    legend_columns = max(1, int(style.width_inches / 1.3))
    legend = 0.2 * (1 + (len(names) - 1) // legend_columns)
    each, above, below, gap, left = 1.25, 0.12 + legend, 0.45, 0.12, 0.8
    height = above + below + len(kinds) * each + (len(kinds) - 1) * gap
    figure = new_figure(style.width_inches, height)
    grid = figure.subplots(len(kinds), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(grid, [_PANELS[kind] for kind in kinds], strict=True):
        for i, name in enumerate(names):
            width = width_below(len(names) - 1 - i)
            lines = panel.values(recording.sensors[name], texels[name], parameters[name])
            for line, (share, dashes) in zip(lines, _STROKES, strict=False):
                axes.plot(recording.times, line, color=SERIES[i % len(SERIES)], lw=share * width, ls=dashes)
        axes.set_ylabel(panel.label)
        tidy_axes(axes)
        axes.margins(x=0)
        panel.set_limits(axes)
        _style_legend(axes, panel.words)
    grid[-1].set_xlabel("time (s)")
    figure.subplots_adjust(
        left=left / style.width_inches,
        right=1 - 0.15 / style.width_inches,
        top=1 - above / height,
        bottom=below / height,
        hspace=gap / each,
    )
    figure.align_ylabels(list(grid))
    _sensor_legend(figure, names, (left / style.width_inches, 1 - 0.02 / height), legend_columns)
    return figure


def _sensor_legend(figure: Figure, names: Sequence[str], corner: tuple[float, float], columns: int) -> None:
    """Name the sensors' colours above all panels."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=SERIES[i % len(SERIES)], lw=1.6, label=name) for i, name in enumerate(names)]
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=corner,
        ncols=columns,
        frameon=False,
        fontsize=SMALL,
        handlelength=1.4,
        borderaxespad=0,
        columnspacing=1.2,
    )


def _style_legend(axes: Axes, words: Sequence[str]) -> None:
    """Say what solid and dashed lines are; the colours are the sensors'."""
    from matplotlib.lines import Line2D

    if not words:
        return
    handles = [
        Line2D([], [], color=INK, lw=1.5 * share, ls=dashes, label=word)
        for word, (share, dashes) in zip(words, _STROKES, strict=True)
    ]
    legend = axes.legend(
        handles=handles, loc="best", fontsize=SMALL, handlelength=1.8, borderaxespad=0.3, frameon=True, framealpha=0.75
    )
    legend.get_frame().set_linewidth(0)


def force_curves(
    path: str | Path,
    recording: Recording,
    texels: Mapping[str, Texels],
    parameters: Mapping[str, SensorParameters],
    required: Mapping[str, float] | None = None,
    style: FigureStyle | None = None,
) -> None:
    """Draw each sensor's summed normal force and shear over time, with the friction limits ``mus · N`` and ``mud · N``.

    Parameters
    ----------
    required : mapping of str to float, N, optional
        The normal force that a sensor ought to show at the end (a weight at rest), drawn as a dashed line.
    """
    style = style or FigureStyle()
    names = list(texels)
    figure = new_figure(style.width_inches, 0.75 + 1.75 * len(names))
    grid = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(grid, names, strict=True):
        sensor, mu = recording.sensors[name], parameters[name]
        normal = sensor.normal_force.sum(axis=1)
        axes.plot(recording.times, normal, color=NORMAL_COLOUR, lw=1.8, label="normal, sum of texels")
        if required and name in required:
            axes.axhline(required[name], color=INK, lw=0.9, ls=(0, (4, 3)), label=f"required: {required[name]:.4f} N")
            axes.annotate(
                f"{normal[-1]:.4f} N",
                (recording.times[-1], normal[-1]),
                (-4, -6),
                textcoords="offset points",
                ha="right",
                va="top",
                fontsize=SMALL,
                color=NORMAL_COLOUR,
            )
        else:
            shear = np.linalg.norm(response.net_shear(sensor, texels[name]), axis=1)
            axes.fill_between(
                recording.times,
                mu.mud * normal,
                mu.mus * normal,
                color=SHEAR_COLOUR,
                alpha=0.18,
                lw=0,
                label="friction limit,\nµd N to µs N",
            )
            axes.plot(recording.times, shear, color=SHEAR_COLOUR, lw=1.8, label="shear, net")
        axes.set_title(name, loc="left", fontsize=FONT, color=INK, weight="bold")
        axes.set_ylabel("force (N)")
        axes.set_ylim(bottom=0)
        axes.margins(x=0)
        axes.legend(
            loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, handlelength=1.6, borderaxespad=0, fontsize=SMALL
        )
        tidy_axes(axes)
    grid[-1].set_xlabel("time (s)")
    width, height = figure.get_size_inches()
    figure.subplots_adjust(left=0.58 / width, right=1 - 1.75 / width, top=1 - 0.3 / height, bottom=0.5 / height, hspace=0.45)
    figure.align_ylabels(list(grid))
    save_figure(figure, path, style.dpi)
