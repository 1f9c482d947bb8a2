# SPDX-License-Identifier: GPL-3.0-or-later
"""Plots of the fits: foam compression (paper, Fig. 6) and friction curve (Fig. 7), at the width of a journal column."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...figures.figure_canvas import new_figure, save_figure
from ...figures.figure_style import GREY, INK, NORMAL_COLOUR, SHEAR_COLOUR
from .friction import FrictionFit, friction_over_time, steady_friction
from .readout import ReadoutFit
from .stiffness import StiffnessFit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMN = 3.5
"""Width of a journal's column, inches."""
DPI = 200


def plot_stiffness(path: str | Path, fit: StiffnessFit) -> None:
    """Plot the measurements with both lines into a file (PNG, PDF or SVG by its suffix)."""
    figure = new_figure(COLUMN, 2.7)
    axes = figure.add_axes((0.165, 0.165, 0.8, 0.8))
    x = np.array([0.0, fit.data.compression.max() * 1.06])
    axes.plot(fit.data.compression * 1e3, fit.data.pressure / 1e3, "o", color=INK, ms=3.5, label="measured")
    axes.plot(x * 1e3, fit.slope * x / 1e3, color=NORMAL_COLOUR, lw=1.3, label=f"through zero: k = {fit.k.value:.4g} N/m")
    offset = fit.offset.value + fit.slope_offset * x
    axes.plot(x * 1e3, offset / 1e3, "--", color=SHEAR_COLOUR, lw=1.1, label=f"with offset: k = {fit.k_offset.value:.4g} N/m")
    axes.axhline(0.0, color=GREY, lw=0.5)
    axes.set(xlim=(0.0, x[1] * 1e3), xlabel="compression (mm)", ylabel="pressure (kPa)")
    _finish(axes)
    save_figure(figure, path, DPI)


def plot_friction(path: str | Path, fit: FrictionFit) -> None:
    """Plot the measured friction with the fitted law into a file (PNG, PDF or SVG by its suffix)."""
    figure = new_figure(COLUMN, 2.7)
    axes = figure.add_axes((0.165, 0.165, 0.8, 0.8))
    data, law = fit.data, fit.parameters
    axes.plot(data.velocity, data.force * 1e3, "o", color=INK, ms=2.5, alpha=0.7, mew=0, label="measured")
    if data.time is not None:
        force = friction_over_time(data.time, data.velocity, fit.normal_force, law)
        axes.plot(data.velocity, force * 1e3, color=NORMAL_COLOUR, lw=1.3, label="fitted, from rest (Eq. 9, 13)")
    # Steady friction jumps at velocity zero, so each sign of the velocity is a line of its own.
    low, high = min(data.velocity.min(), 0.0), max(data.velocity.max(), 0.0)
    label = "steady sliding (Eq. 10, 13)"
    for start, stop in ((low, -1e-12), (0.0, high)):
        if stop > start:
            v = np.linspace(start, stop, 300)
            axes.plot(v, steady_friction(v, fit.normal_force, law) * 1e3, "--", color=SHEAR_COLOUR, lw=1.1, label=label)
            label = "_"
    axes.set(xlabel="sliding velocity (m/s)", ylabel="friction of one texel (mN)")
    if low == 0.0:
        axes.set_xlim(0.0, None)
    if data.force.min() >= 0.0:
        axes.set_ylim(0.0, None)
    _finish(axes)
    save_figure(figure, path, DPI)


def plot_readout(path: str | Path, fit: ReadoutFit) -> None:
    """Plot what drove the sensor, and what its readings say of it, over a check recording, or else a fitted one."""
    one = (fit.data.check or fit.data.fit)[0]
    found = fit.best.estimate(one.time, one.readings)
    figure = new_figure(2.0 * COLUMN, 1.9 * len(fit.data.targets) + 0.4)
    since, share = one.time - one.time[0], 1.0 / len(fit.data.targets)
    for i, target in enumerate(fit.data.targets):
        axes = figure.add_axes((0.09, 1.0 - (i + 0.84) * share, 0.89, 0.78 * share))
        axes.fill_between(since, found.low[:, i], found.high[:, i], color=SHEAR_COLOUR, alpha=0.3, lw=0, label="95 % interval")
        axes.plot(since, found.value[:, i], color=SHEAR_COLOUR, lw=1.0, label="from readings")
        axes.plot(since, one.targets[:, i], color=INK, lw=0.7, label="measured")
        axes.set_ylabel(f"{target} ({fit.data.unit(target)})")
        _finish(axes)
    axes.set_xlabel(f"time in {one.name} (s)")
    save_figure(figure, path, DPI)


def _finish(axes: Axes) -> None:
    """Style the axes and add the legend."""
    axes.tick_params(labelsize=8, length=2.5, width=0.6, colors=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, handlelength=1.6, loc="best")
