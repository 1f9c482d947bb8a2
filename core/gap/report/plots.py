# SPDX-License-Identifier: GPL-3.0-or-later
"""The report's pictures: the gap before and after, curves of what was measured and simulated, where the error sits."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...effects.engine.registry import kind_of
from ...figures import color_maps
from ...figures.figure_canvas import new_figure, save_figure, tidy_axes
from ...figures.figure_style import GREY, INK, NORMAL_COLOUR, SHEAR_COLOUR, WIDTHS, width_below
from ...figures.quantities import ERROR, error_scale
from ...geometry.grid_layout import GridLayout
from ...jobs import Job, Progress
from ..forward.contact_phases import PHASES
from ..forward.predictor import Model, Predictor
from ..selection.findings import Diagnosis
from .comparison import GapErrors, error_location, rms_by_texel, squared_errors
from .sentences import said_confidence

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEFORE, AFTER = SHEAR_COLOUR, NORMAL_COLOUR
LONG = 12
"""How many times as long as wide a grid is no picture any more."""
Pick = Callable[[Model], np.ndarray]
"""What a model predicts of one channel."""
Place = tuple[float, float, float, float]
"""Left, bottom, width and height of a part of a figure, as shares of it."""
HEADING: dict[str, Any] = {"fontsize": 8.5, "color": INK, "weight": "bold"}


def gap_bars(result: Diagnosis, errors: GapErrors) -> Figure:
    """NRMSE of base and amended model on fitted and on check trials, with the noise floor."""
    figure = new_figure(WIDTHS["single"], 2.5)
    axes = figure.add_axes((0.15, 0.18, 0.82, 0.58))
    names = {"fit": "fitted trials", "check": "check trials,\nnever fitted"}
    uses = [use for use in names if result.of(use)]
    by_label = {"without friction": (errors.frictionless, GREY), "base model": (errors.base, BEFORE)}
    if result.best.model.effects:
        by_label["amended"] = (errors.amended, AFTER)
    shown = [(label, error, colour) for label, (error, colour) in by_label.items() if error is not None]
    width = 0.72 / max(len(shown), 2)
    for offset, (label, error, colour) in enumerate(shown):
        heights = [100.0 * (error[use] or 0.0) for use in uses]
        places = np.arange(len(uses)) + width * (offset - 0.5 * (len(shown) - 1))
        bars = axes.bar(places, heights, 0.95 * width, color=colour, label=label)
        axes.bar_label(bars, fmt="%.2f", fontsize=8, color=INK)
    floor = 100.0 * errors.noise_floor
    axes.axhline(floor, color=INK, lw=0.9, ls=(0, (4, 3)), label=f"noise floor {floor:.2f} %")
    axes.set_xticks(np.arange(len(uses)), [names[use] for use in uses])
    axes.set_ylabel("error (% of range)")
    axes.margins(y=0.18)
    tidy_axes(axes)
    axes.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(-0.03, 1.0), ncols=2, columnspacing=1.2)
    return figure


def _models(result: Diagnosis) -> list[tuple[str, Model, str]]:
    """The models to be compared: the base alone where nothing was added to it."""
    base = ("base model", result.base.model, BEFORE)
    return [base, ("amended", result.best.model, AFTER)] if result.best.model.effects else [base]


def curves(result: Diagnosis) -> Figure:
    """Measured, base and amended over time, for the two texels (or force components) with the largest base error."""
    trials = [*result.of("fit")[:2], *result.of("check")[:1]]
    figure = new_figure(WIDTHS["double"], 1.75 * len(trials) + 0.5)
    grid = figure.subplots(len(trials), 1, squeeze=False)[:, 0]
    for axes, predictor in zip(grid, trials, strict=True):
        _, name, quantity, measured, pick = _worst_channel(result, predictor)
        time = predictor.trial.time
        axes.plot(time, measured, color=INK, lw=width_below(1), label="measured")
        _draw_models(axes, result, time, measured, pick, lw=1.0)
        axes.set_title(f"{predictor.trial.name} ({predictor.trial.use}): {name}", loc="left", fontsize=8.5, color=INK)
        axes.set_ylabel(quantity)
        axes.margins(x=0)
        tidy_axes(axes)
    grid[0].legend(frameon=False, fontsize=8, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0)
    grid[-1].set_xlabel("time (s)")
    height = figure.get_figheight()
    figure.subplots_adjust(left=0.105, right=0.985, top=1 - 0.3 / height, bottom=0.45 / height, hspace=0.42)
    return figure


def _draw_models(axes: Axes, result: Diagnosis, x: np.ndarray, measured: np.ndarray, pick: Pick, **style: Any) -> None:
    """Draw what each model predicts over x, where something was measured."""
    for label, model, colour in _models(result):
        shown = np.where(np.isfinite(measured), pick(model), np.nan)
        axes.plot(x, shown, color=colour, ls="--" if label == "base model" else "-", label=label, **style)


def _worst_channel(
    result: Diagnosis, predictor: Predictor, stimulus: np.ndarray | None = None
) -> tuple[int, str, str, np.ndarray, Pick]:
    """The channel with the largest error: its index, name and quantity, what was measured, and what a model predicts.

    With the `stimulus` of each texel (samples, n), those whose stimulus changes come first.
    """
    part = "force" if predictor.trial.reading is None else "reading"
    measured = getattr(predictor.trial, part)
    miss = np.nansum((measured - getattr(predictor.predict(result.base.model), part)) ** 2, axis=0)
    if part == "reading" and stimulus is not None and (changes := np.ptp(stimulus, axis=0) > 0.0).any():
        miss[~changes] = 0.0
    channel = int(np.argmax(miss))
    unit, name = result.rig.parameters.unit, f"texel {channel}" if part == "reading" else f"force {'xyz'[channel]}"
    quantity = f"{name} (N)" if part == "force" else "normal force (N)" if unit == "N" else f"reading ({unit})"
    return channel, name, quantity, measured[:, channel], lambda model: getattr(predictor.predict(model), part)[:, channel]


def error_map(result: Diagnosis) -> Figure:
    """Root mean square error of each texel, base and amended, on one scale."""
    figure = new_figure(WIDTHS["single"], 2.5 if _is_row(result) else 2.9)
    _draw_errors(figure, result, (0.15, 0.2, 0.82, 0.62), (0.02, 0.04, 0.96, 0.84))
    return figure


def _is_row(result: Diagnosis) -> bool:
    """Return True if the texels form a row that is too long for a map."""
    layout = result.rig.texels.layout
    return isinstance(layout, GridLayout) and LONG * min(layout.mask().shape) < max(layout.mask().shape)


def _draw_errors(figure: Figure, result: Diagnosis, line: Place, maps: Place) -> None:
    """Draw the error of each texel into a part of a figure: as a `line` where texels form a long row, else as `maps`."""
    texels = result.rig.texels
    errors = [(name, ERROR.values(rms_by_texel(result, model), texels), colour) for name, model, colour in _models(result)]
    if _is_row(result):
        axes = figure.add_axes(line)
        for label, values, colour in errors:
            axes.stairs(values, np.arange(len(values) + 1) - 0.5, baseline=None, color=colour, lw=0.9, label=label)
        axes.set(xlabel="texel", ylabel="error (% of range)")
        axes.locator_params("x", integer=True)
        axes.margins(x=0)
        tidy_axes(axes)
        axes.legend(frameon=False, fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2)
        return
    scale = error_scale(max(float(values.max()) for _, values, _ in errors))
    colours: dict[str, Any] = {"cmap": color_maps.matplotlib_colormap(scale.colour_map), "vmin": scale.low, "vmax": scale.high}
    left, bottom, width, height = maps
    image: Any = None
    for i, (label, values, _) in enumerate(errors):
        start = left + width * 0.42 * (i + 0.5 * (2 - len(errors)))
        axes = figure.add_axes((start, bottom, 0.375 * width, height))
        if isinstance(texels.layout, GridLayout):
            picture: Any = np.ma.masked_array(texels.layout.image(values), ~texels.layout.mask())
            image = axes.imshow(picture, origin="lower", interpolation="nearest", **colours)
        else:
            image = axes.scatter(texels.position[:, 0], texels.position[:, 1], c=values, s=14, **colours)
            axes.set_aspect("equal")
        axes.set_title(label, fontsize=8.5, color=INK)
        axes.set(xticks=[], yticks=[])
    beside = (left + 0.835 * width, bottom + 0.095 * height, 0.0365 * width, 0.81 * height)
    bar = figure.colorbar(image, cax=figure.add_axes(beside))
    bar.ax.tick_params(labelsize=8, colors=INK)
    bar.set_label(f"{scale.quantity.label[0]} ({scale.unit})", fontsize=8.5, color=INK)


def overview(result: Diagnosis, errors: GapErrors) -> Figure:
    """Where the error is on the sensor, which effects were found, and the error without and with each of them."""
    bars = len(errors.stages) + 2 * bool(result.of("check"))
    figure = new_figure(WIDTHS["double"], max(2.7, 0.9 + 0.36 * bars))
    height = figure.get_figheight()
    bottom, top = 0.5 / height, 1.0 - 0.55 / height
    if len(result.rig.texels) > 1:
        figure.text(0.015, 1.0 - 0.06 / height, "Where: error of each texel", va="top", **HEADING)
        _draw_errors(figure, result, (0.08, bottom, 0.32, top - bottom), (0.015, 0.1 / height, 0.4, top - 0.1 / height))
    left = 0.7 if len(result.rig.texels) > 1 else 0.3
    figure.text(left - 0.2, 1.0 - 0.06 / height, "What: error without and with each effect", va="top", **HEADING)
    _draw_stages(figure.add_axes((left, bottom, 0.985 - left, 1.0 - 0.3 / height - bottom)), result, errors)
    return figure


def _draw_stages(axes: Axes, result: Diagnosis, errors: GapErrors) -> None:
    """Draw a bar for the base model and one for each effect that is added to it, then those of the check trials."""
    rows: list[tuple[str, float | None, str]] = [("base model", errors.base["fit"], BEFORE)]
    if result.alike is not None:
        rows.append(("+ level and gain\nof each recording", errors.stages[0], AFTER))
    for one in sorted(result.findings, key=lambda one: one.effect):
        name = " or ".join(kind_of(kind).title.lower() for kind in (one.name, *one.rivals))
        rows.append((f"+ {name}\n(confidence {said_confidence(one.confidence)})", errors.stages[one.effect + 1], AFTER))
    count = len(rows)
    if result.of("check"):
        rows.append(("check trials, base", errors.base["check"], BEFORE))
        rows += [("check trials, amended", errors.amended["check"], AFTER)] if count > 1 else []
    places = [-float(i) - 0.5 * (i >= count) for i in range(len(rows))]
    values = [100.0 * (error or 0.0) for _, error, _ in rows]
    bars = axes.barh(places, values, 0.72, color=[colour for *_, colour in rows])
    behind = {"facecolor": "white", "edgecolor": "none", "pad": 0.0}  # the line of the noise floor does not cross the numbers
    axes.bar_label(bars, fmt=" %.2f", fontsize=8, color=INK, bbox=behind)
    floor = 100.0 * errors.noise_floor
    axes.axvline(floor, color=INK, lw=0.9, ls=(0, (4, 3)))
    axes.text(floor, 0.25 - count, f" noise floor {floor:.2f}", ha="left", va="center", fontsize=8, color=INK)
    axes.set(ylim=(min(places[-1] - 0.5, -float(count)), 0.5), xlim=(0.0, 1.18 * max(*values, floor)))
    axes.set_yticks(places, [name for name, *_ in rows])
    axes.set_xlabel("error (% of range)")
    tidy_axes(axes)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)


def phase_bars(result: Diagnosis, errors: GapErrors) -> Figure:
    """Squared error by phase of base and amended model, as shares of that of the base model."""
    figure = new_figure(WIDTHS["single"], 2.3)
    axes = figure.add_axes((0.17, 0.27, 0.8, 0.6))
    models, base = _models(result), errors.stages[0] or 1.0
    for offset, ((label, model, colour), error) in enumerate(
        zip(models, (errors.stages[0], errors.amended["fit"]), strict=False)
    ):
        left = ((error or 0.0) / base) ** 2
        heights = [100.0 * left * entry["share"] for entry in error_location(result, model) if "phase" in entry]
        places = np.arange(len(PHASES)) + 0.36 * (offset - 0.5 * (len(models) - 1))
        axes.bar(places, heights, 0.34, color=colour, label=label)
    axes.set_xticks(np.arange(len(PHASES)), PHASES, rotation=25, ha="right", rotation_mode="anchor")
    axes.set_ylabel("squared error\n(% of that of the base)")
    tidy_axes(axes)
    axes.legend(frameon=False, fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2)
    return figure


def loops(result: Diagnosis) -> Figure:
    """Reading over depth (or load, or travel) of the texel with the largest error: what an effect's signature looks like."""
    predictor = max(result.of("fit"), key=lambda p: float(squared_errors(p, result.base.model, result).sum()))
    s, trial = predictor.stimulus, predictor.trial
    over, label = (1e3 * s.depth, "depth (mm)") if s.force_share is None else (s.force_share, "load (N)")
    channel, name, quantity, measured, pick = _worst_channel(result, predictor, over)
    if trial.reading is not None:
        x = over[:, channel]
    elif s.slide_speed.any():
        travel = trial.travel if trial.position is None or trial.travel.any() else trial.position[:, :2]
        x, label = 1e3 * travel[:, int(np.argmax(np.ptp(travel, axis=0)))], "travel (mm)"
    else:
        x, label = 1e3 * s.depth.max(axis=1), "depth (mm)"
    figure = new_figure(WIDTHS["single"], 2.5)
    axes = figure.add_axes((0.21, 0.18, 0.76, 0.62))
    axes.plot(x, measured, ".", ms=4.0, mew=0, color=INK, alpha=0.55, zorder=3, label="measured")
    _draw_models(axes, result, x, measured, pick, lw=0.8, zorder=4)  # above the samples, which hide a line that fits them
    axes.set(xlabel=label, ylabel=quantity)
    axes.set_title(f"{trial.name}: {name}", loc="left", fontsize=8.5, color=INK, pad=18)
    tidy_axes(axes)
    place = {"loc": "lower right", "bbox_to_anchor": (1.02, 0.98), "borderaxespad": 0.2}
    axes.legend(frameon=False, fontsize=8, ncols=3, columnspacing=0.9, handlelength=1.4, handletextpad=0.5, **place)
    return figure


CAPTIONS = {
    "overview": "Where there are several texels, the error of each on the fitted trials; the error without and with each "
    "effect that was found.",
    "gap": "The gap before and after. Check trials were never fitted and choose no effect; they decide the verdict.",
    "curves": "Measured and simulated curves where the error of the base model is largest in each trial.",
    "loops": "The same, plotted against the stimulus: the characteristic shape of an effect.",
    "map": "Root mean square error of each texel on the fitted trials.",
    "phases": "Squared error by phase of contact, as a share of that of the base model.",
}
"""Captions of the pictures by file name."""
FILE_TYPES = ("png", "pdf")
"""Each picture is written as all of them."""


def picture(name: str, result: Diagnosis, errors: GapErrors) -> Figure:
    """Draw the picture of this name (see :data:`CAPTIONS`)."""
    without_errors = {"curves": curves, "loops": loops, "map": error_map}
    with_errors = {"overview": overview, "gap": gap_bars, "phases": phase_bars}
    return without_errors[name](result) if name in without_errors else with_errors[name](result, errors)


def draw(result: Diagnosis, errors: GapErrors, folder: Path) -> Job[list[str]]:
    """Write every picture that makes sense for a rig as PNG and PDF; return their names.

    Yields
    ------
    Progress
        Before each picture; its total is the number of pictures.
    """
    names = [name for name in CAPTIONS if name != "map" or len(result.rig.texels) > 1]
    for done, name in enumerate(names):
        yield Progress("drawing", done, len(names))
        figure = picture(name, result, errors)
        for kind in FILE_TYPES:
            save_figure(figure, folder / f"{name}.{kind}", 200)
    return names
