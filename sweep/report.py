# SPDX-License-Identifier: GPL-3.0-or-later
"""``report.html``: a study at a glance, one page with its pictures inside."""

from __future__ import annotations

import base64
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import counted
from ..core.figures.figure_canvas import new_figure, save_figure, tidy_axes
from ..core.figures.figure_style import FONT, GREY, INK, NORMAL_COLOUR, SHEAR_COLOUR, SMALL, FigureStyle
from ..core.figures.html_templates import render_html
from ..core.figures.quantities import Extent
from ..core.figures.tactile_image import SensorView, draw_colour_bar
from ..core.geometry.texels import Texels
from ..core.io.file_writing import write_text
from ..core.io.hidden_folder import temporary_folder
from ..core.study.study_file import Study
from .dataset import TABLE_NAME, TIMINGS_NAME, UNNAMED_STUDY
from .dependencies import LEAST_RUNS, RUNS_PER_GROUP, Dependency, dependencies, is_known
from .features import by_texel, net_force_name, tactile_name
from .parts import FINISHED, READING, Parts, frames_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REPORT_NAME = "report.html"
TEMPLATE = Path(__file__).parent / "templates" / "sweep_report.html"
MOST_DEPENDENCIES, MOST_MESSAGES, MOST_IMAGES = 15, 12, 24
PLACE_OF_PRESS = "press."
"""First word of the metrics that say where a press was."""
MOST_PARAMETERS, MOST_METRICS = 6, 6
"""Columns and rows of the small multiples."""
MOST_NAMES = 12
"""Names of a choice that have room below one column."""
MOST_POINTS = 2000
"""Runs that are drawn as points; of more, as many are chosen evenly."""
MEDIAN_BINS, LEAST_PER_BIN = 10, 4
DPI = 130
IMAGES_ACROSS = 6
_NUMBER = re.compile(r"(?<![\w.])-?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)", re.IGNORECASE)


class Columns(Mapping[str, np.ndarray]):
    """Columns of ``runs.parquet``, (n,) float or object; each is read when it is needed, so memory does not hold all of them.

    A number that a run lacks is NaN, as all metrics of one that failed; a text is None.

    Parameters
    ----------
    path : Path
    start : str
        "varied." or "metric."; the keys are the names of the columns without it.
    """

    def __init__(self, path: Path, start: str):
        from pyarrow import parquet

        self._path, self._start = path, start
        self._keys = [name.removeprefix(start) for name in parquet.read_schema(path).names if name.startswith(start)]

    def __getitem__(self, key: str) -> np.ndarray:
        from pyarrow import parquet

        column = parquet.read_table(self._path, columns=[f"{self._start}{key}"], **READING)[0].combine_chunks()
        if column.type != "string":
            found: np.ndarray = column.to_numpy(zero_copy_only=False)
            return found
        words = column.dictionary_encode()  # one object for equal texts
        return np.array([*words.dictionary.to_pylist(), None], object)[words.indices.fill_null(-1).to_numpy()]

    def __iter__(self) -> Iterator[str]:
        return iter(self._keys)

    def __len__(self) -> int:
        return len(self._keys)


def write_report(folder: Path, study: Study) -> None:
    """Write ``report.html`` into the folder of a study, from its table of runs and its parts.

    Raises
    ------
    FileError
        A part is damaged, or the page cannot be written.
    """
    table = folder / TABLE_NAME
    values, metrics, is_done = Columns(table, "varied."), Columns(table, "metric."), Columns(table, "")["status"] == FINISHED
    found = dependencies(values, metrics)
    failing = [] if is_done.all() else dependencies(values, {"failing": 1.0 - is_done})
    drawn, images = _most_dependent(values, metrics, found), _images(Parts(folder))
    with temporary_folder(folder, "report") as hidden:
        if all(drawn):
            strong = {(one.parameter, one.metric) for one in found}
            _draw_small_multiples(hidden / "multiples.png", values, metrics, drawn, strong)
        if images:
            _draw_image_sheet(hidden / "images.png", images)
        pictures = {path.stem: base64.b64encode(path.read_bytes()).decode() for path in hidden.iterdir()}
    page = render_html(
        TEMPLATE,
        name=study.name or UNNAMED_STUDY,
        headline=_headline(is_done, len(values), _seconds_of(folder / TIMINGS_NAME)),
        strongest=_strongest_sentence(found),
        dependencies=[_dependency_row(one) for one in found[:MOST_DEPENDENCIES]],
        left_off=len(found[MOST_DEPENDENCIES:]),
        ranges=[_range_row(name, own[is_done & is_known(own)]) for name, own in values.items()],
        metrics=[_metric_row(name, own[is_known(own)]) for name, own in metrics.items()],
        messages=_message_rows(table),
        failures=int(np.sum(~is_done)),
        failed_dependencies=[_dependency_row(one)[1:] for one in failing],
        pictures=pictures,
        shown=_shown_sentence(values, metrics, *drawn),
    )
    write_text(folder / REPORT_NAME, page)


def _seconds_of(timings: Path) -> float:
    from pyarrow import csv

    return float(np.sum(csv.read_csv(timings, convert_options=csv.ConvertOptions(include_columns=["seconds"]))["seconds"]))


def _most_dependent(values: Columns, metrics: Columns, found: list[Dependency]) -> tuple[list[str], list[str]]:
    """Return the parameters and metrics that are drawn: those in the strongest dependencies first, then in their order."""
    drawable = [name for name, own in values.items() if own.dtype != object or len(set(own)) <= MOST_NAMES]
    parameters = dict.fromkeys([*(one.parameter for one in found if one.parameter in drawable), *drawable])
    measured = dict.fromkeys([*(one.metric for one in found), *metrics])
    return list(parameters)[:MOST_PARAMETERS], list(measured)[:MOST_METRICS]


def _images(parts: Parts) -> list[tuple[int, Texels, np.ndarray]]:
    """Return the first sensor of runs that are spread evenly over the design, when the net force on it is largest.

    Each has the index of the run, the texels, and (n, 3) forces: normal, and shear along the texels' x and y axes.
    """
    done = parts.done
    chosen = np.unique(np.linspace(0, len(done) - 1, min(len(done), MOST_IMAGES)).round().astype(int))
    images = []
    for index in done[chosen].tolist():
        run = parts.run(index)
        layout = parts.layout(run)
        if layout is None:
            continue
        (sensor, texels), *_ = layout.texels.items()
        _, columns = frames_in(run, layout)
        frame = int(np.argmax(np.linalg.norm(columns[net_force_name(sensor)], axis=1)))
        images.append((index, texels, by_texel(columns[tactile_name(sensor)], texels)[frame].astype(float)))
    return images


def _headline(is_done: np.ndarray, parameters: int, seconds: float) -> str:
    done = int(is_done.sum())
    failed = len(is_done) - done
    text = f"{counted(done, 'run') if done else 'No run'} finished, {f'{failed:,}' if failed else 'none'} failed."
    if parameters:
        text += f" {counted(parameters, 'parameter')} varied."
    return f"{text} Computing took {_duration(seconds)} of processor time."


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.3g} s"
    return f"{seconds / 60:.3g} min" if seconds < 7200 else f"{seconds / 3600:.3g} h"


def _strongest_sentence(found: list[Dependency]) -> str:
    # Where a press was follows the numbers that chose it, and says nothing of the sensor.
    measured = [one for one in found if not one.metric.startswith(PLACE_OF_PRESS)] or found
    if measured:
        return f"The strongest dependency is that of {measured[0].metric} on {measured[0].parameter}."
    least = f"{LEAST_RUNS} runs in which both vary, and {RUNS_PER_GROUP} for each name of a choice"
    return f"No dependency of a metric on a parameter was detected, which takes at least {least}."


def _message_rows(table: Path) -> list[tuple[str, int]]:
    """Return why most runs failed, with their numbers; sentences that differ in numbers alone are one, the first."""
    from pyarrow import parquet

    counts, first = Counter[str](), dict[str, str]()
    with parquet.ParquetFile(table) as file:
        for batch in file.iter_batches(columns=["message"]):
            for sentence in filter(None, batch["message"].to_pylist()):
                kind = _NUMBER.sub("0", sentence)
                counts[kind] += 1
                first.setdefault(kind, sentence)
    return [(first[kind], count) for kind, count in counts.most_common(MOST_MESSAGES)]


def _shown_sentence(values: Columns, metrics: Columns, parameters: list[str], measured: list[str]) -> str:
    """Say what the small multiples leave out."""
    counts = [(len(parameters), len(values), "parameter"), (len(measured), len(metrics), "metric")]
    parts = [f"{drawn} of {counted(count, what)}" for drawn, count, what in counts if drawn < count]
    return f"Drawn are {' and '.join(parts)}; runs.parquet has all." if parts else ""


def _dependency_row(one: Dependency) -> list[str]:
    correlation = "–" if one.rank_correlation is None else f"{one.rank_correlation:+.2f}".replace("-", "−")
    return [one.metric, one.parameter, correlation, f"{one.strength:.2f}", f"{one.runs:,}"]


def _range_row(name: str, known: np.ndarray) -> list[str]:
    """Return name, smallest, median and largest value, and how many runs have one; for names, how many there are."""
    if known.dtype == object:
        names = np.unique(known).tolist()
        return [name, ", ".join(names[:6]) + (" …" if len(names) > 6 else ""), "", "", f"{len(known):,}"]
    ends = (known.min(), np.median(known), known.max()) if len(known) else ()
    return [name, *map(_digits, ends), *[""] * (3 - len(ends)), f"{len(known):,}"]


def _metric_row(name: str, known: np.ndarray) -> list[str]:
    """Return name, mean, smallest, median and largest value, and how many runs have one."""
    return [name, _digits(float(known.mean())) if len(known) else "", *_range_row(name, known)[1:]]


def _digits(number: float) -> str:
    return f"{number:.4g}".replace("-", "−")


def _draw_small_multiples(
    path: Path, values: Columns, metrics: Columns, drawn: tuple[list[str], list[str]], strong: set[tuple[str, str]]
) -> None:
    """Draw parameters as columns and metrics as rows: a point for each run, and the median where there are enough of them.

    The median of `strong` pairs of parameter and metric is drawn in colour, because a dependency was detected.
    """
    parameters, measured = drawn
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


def _draw_image_sheet(path: Path, images: Sequence[tuple[int, Texels, np.ndarray]]) -> None:
    """Draw tactile images of some runs, one at least, all in one scale of colours and one of arrows."""
    high = max(float(forces[:, 0].max(initial=0.0)) for _, _, forces in images)
    scale = FigureStyle().scale_of(Extent(0.0, high, ("N",)))
    shear = max(float(np.linalg.norm(forces[:, 1:], axis=1).max(initial=0.0)) for _, _, forces in images)
    views = [SensorView.of(texels, forces[:, 0]) for _, texels, forces in images]
    across = min(len(images), IMAGES_ACROSS)
    rows = -(-len(images) // across)
    tall = float(np.clip(max(view.height / view.width for view in views) * 1.35, 0.5, 2.4))
    figure = new_figure(max(across * 1.35, 3.4) + 0.9, rows * (tall + 0.3) + 0.1)
    grid = figure.subplots(rows, across, squeeze=False)
    drawn: Any = None
    for axes in grid.flat[len(images) :]:
        axes.set_axis_off()
    for axes, (index, _, forces), view in zip(grid.flat, images, views, strict=False):
        drawn = view.at_size(tall / max(view.height, view.width)).draw(axes, forces[:, 0], forces[:, 1:], shear, scale)
        axes.set_title(f"run {index}", fontsize=SMALL, color=INK, pad=2)
    draw_colour_bar(figure, drawn, figure.add_axes((0.9, 0.25, 0.015, 0.5)), scale)
    figure.subplots_adjust(0.01, 0.01, 0.88, 1.0 - 0.2 / figure.get_figheight(), 0.1, 0.15)
    save_figure(figure, path, DPI)
