# SPDX-License-Identifier: GPL-3.0-or-later
"""``report.html``: a study at a glance, one page with its pictures inside."""

from __future__ import annotations

import base64
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import counted
from ..core.figures.html_templates import render_html
from ..core.io.file_writing import atomic_write
from ..core.io.hidden_folder import temporary_folder
from ..core.study.study_file import Run
from .dependencies import LEAST_RUNS, RUNS_PER_NAME, Dependency, dependencies
from .features import by_texel, net_force_name, tactile_name
from .finished_runs import FailedRun, RunOrder, StoredRuns, failures, finished_runs, run_order, study_name
from .report_figures import MOST_METRICS, MOST_NAMES, MOST_PARAMETERS, RunImage, draw_image_sheet, draw_small_multiples

REPORT_NAME = "report.html"
TEMPLATE = Path(__file__).parent / "templates" / "sweep_report.html"
MOST_DEPENDENCIES, MOST_MESSAGES, MOST_IMAGES = 15, 12, 24
PLACE_OF_PRESS = "press."
"""First word of the metrics that say where a press was."""
_NUMBER = re.compile(r"(?<![\w.])-?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)", re.IGNORECASE)


@dataclass(frozen=True)
class StudyColumns:
    """The finished runs of a study as columns: numbers only, no recordings.

    Attributes
    ----------
    values : dict of str to list
        What was varied; None where a run lacks it.
    metrics : dict of str to (n,) float
        NaN where a run lacks it.
    frames_seconds : float
        Time that computing took, of all runs.
    """

    values: dict[str, list[Any]]
    metrics: dict[str, np.ndarray]
    frames_seconds: float


def write_report(folder: Path, planned: Sequence[Run] = ()) -> None:
    """Write ``report.html`` into the folder of a study.

    Parameters
    ----------
    folder : Path
    planned : sequence of Run
        All runs of the study, which tell what varied in those that failed.

    Raises
    ------
    FileError
        There is no study, a run is damaged, or the page cannot be written.
    """
    order, failed = run_order(folder, planned), failures(folder, planned)
    columns = _columns(folder, order)
    found = dependencies(columns.values, columns.metrics)
    with temporary_folder(folder, "report") as hidden:
        pictures = _draw(hidden, folder, order, columns, found)
        page = render_html(
            TEMPLATE,
            name=study_name(folder),
            headline=_headline(len(order), failed, columns),
            strongest=_strongest_sentence(found, columns, len(order)),
            dependencies=[_dependency_row(one) for one in found[:MOST_DEPENDENCIES] if one.strength > 0],
            left_off=sum(one.strength > 0 for one in found[MOST_DEPENDENCIES:]),
            ranges=[_range_row(f"{name}", values) for name, values in columns.values.items()],
            metrics=[_metric_row(name, values[np.isfinite(values)]) for name, values in columns.metrics.items()],
            messages=_message_rows([run.sentence for run in failed]),
            failures=len(failed),
            failed_dependencies=_failed_rows(folder, order, columns, failed),
            pictures={path.stem: base64.b64encode(path.read_bytes()).decode() for path in pictures},
            shown=_shown_sentence(columns),
        )
        with atomic_write(folder / REPORT_NAME) as temporary:
            temporary.write_text(page, encoding="utf-8")


def _columns(folder: Path, order: RunOrder) -> StudyColumns:
    values: dict[str, list[Any]] = {}
    metrics: dict[str, np.ndarray] = {}
    seconds = 0.0
    for number, run in enumerate(finished_runs(folder, order)):
        seconds += run.seconds
        for name, value in run.values.items():
            if name not in values:  # a column for each name, not for each run
                values[name] = [None] * len(order)
            values[name][number] = value
        for name, metric in run.metrics.items():
            if name not in metrics:
                metrics[name] = np.full(len(order), np.nan)
            metrics[name][number] = metric
    return StudyColumns(values, metrics, seconds)


def _draw(hidden: Path, folder: Path, order: RunOrder, columns: StudyColumns, found: list[Dependency]) -> list[Path]:
    """Draw the pictures that the study has something for, and return their files."""
    drawn = []
    parameters, metrics = _most_dependent(columns, found)
    if parameters and metrics:
        strong = {(one.parameter, one.metric) for one in found if one.strength > 0}
        values = {name: columns.values[name] for name in parameters}
        path = hidden / "multiples.png"
        draw_small_multiples(path, values, {name: columns.metrics[name] for name in metrics}, strong)
        drawn.append(path)
    images = _images(folder, order)
    if images:
        draw_image_sheet(hidden / "images.png", images)
        drawn.append(hidden / "images.png")
    return drawn


def _most_dependent(columns: StudyColumns, found: list[Dependency]) -> tuple[list[str], list[str]]:
    """Return the parameters and metrics that are drawn: those in the strongest dependencies first, then in their order."""
    drawable = [name for name, own in columns.values.items() if _has_few_names(own)]
    strong = [one.parameter for one in found if one.strength > 0 and one.parameter in drawable]
    parameters = list(dict.fromkeys([*strong, *drawable]))
    metrics = list(dict.fromkeys([*(one.metric for one in found if one.strength > 0), *columns.metrics]))
    return parameters[:MOST_PARAMETERS], metrics[:MOST_METRICS]


def _has_few_names(values: list[Any]) -> bool:
    """Return False for a choice of more names than a picture has room for."""
    known = {value for value in values if value is not None}
    return len(known) <= MOST_NAMES or not any(isinstance(value, str) for value in known)


def _images(folder: Path, order: RunOrder) -> list[RunImage]:
    """Return images of the first sensor of runs that are spread evenly over the design."""
    chosen = np.unique(np.linspace(0, len(order) - 1, min(len(order), MOST_IMAGES)).round().astype(int))
    images = []
    runs = StoredRuns(folder)
    for index, digest in (order[i] for i in chosen):
        if not runs.record(digest).sensors:
            continue
        _, frames = runs.run(digest)
        (sensor, texels), *_ = frames.layout.texels.items()
        features = {item.name: item for item in frames.layout.features}
        force = np.linalg.norm(frames.decoded(features[net_force_name(sensor)]), axis=1)
        image = by_texel(frames.decoded(features[tactile_name(sensor)]), texels)[int(np.argmax(force))]
        images.append(RunImage(f"run {index}", texels, image[:, 0], image[:, 1:]))
    return images


def _headline(runs: int, failed: list[FailedRun], columns: StudyColumns) -> str:
    if not runs and not failed:
        return "No run has finished yet."
    text = f"{counted(runs, 'run') if runs else 'No run'} finished, {f'{len(failed):,}' if failed else 'none'} failed."
    if columns.values:
        text += f" {counted(len(columns.values), 'parameter')} varied."
    if columns.frames_seconds > 0:
        text += f" Computing took {_duration(columns.frames_seconds)} of processor time."
    return text


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.3g} s"
    return f"{seconds / 60:.3g} min" if seconds < 7200 else f"{seconds / 3600:.3g} h"


def _strongest_sentence(found: list[Dependency], columns: StudyColumns, runs: int) -> str:
    strong = [one for one in found if one.strength > 0]
    # Where a press was follows the numbers that chose it, and says nothing of the sensor.
    measured = [one for one in strong if not one.metric.startswith(PLACE_OF_PRESS)]
    strong = measured or strong
    if strong:
        return f"The strongest dependency is that of {strong[0].metric} on {strong[0].parameter}."
    if not found:
        least = f"{LEAST_RUNS} runs in which both vary, and {RUNS_PER_NAME} for each name of a choice"
        return f"No dependency of a metric on a parameter was looked for, as that takes {least}."
    judged = {one.parameter for one in found}
    these = "any parameter" if judged >= set(columns.values) else " or ".join(sorted(judged))
    return f"No metric depends on {these} as far as {counted(runs, 'run')} can tell."


def _message_rows(sentences: list[str]) -> list[tuple[str, int]]:
    """Return the most frequent sentences with their numbers of runs; those that differ in numbers alone are one, the first."""
    counts = Counter(_without_numbers(sentence) for sentence in sentences)
    first: dict[str, str] = {}
    for sentence in sentences:
        first.setdefault(_without_numbers(sentence), sentence)
    return [(first[kind], count) for kind, count in counts.most_common(MOST_MESSAGES)]


def _without_numbers(sentence: str) -> str:
    return _NUMBER.sub("0", sentence)


def _shown_sentence(columns: StudyColumns) -> str:
    """Say what the small multiples leave out."""
    drawable = sum(map(_has_few_names, columns.values.values()))
    left = max(0, drawable - MOST_PARAMETERS), max(0, len(columns.metrics) - MOST_METRICS)
    named = len(columns.values) - drawable
    parts = [counted(number, what) for number, what in zip(left, ("parameter", "metric")) if number]
    weaker = [f"{' and '.join(parts)} with weaker dependencies"] if parts else []
    crowded = [f"{counted(named, 'choice')} of more than {MOST_NAMES} names"] if named else []
    if not weaker + crowded:
        return ""
    verb = "is" if sum(left) + named == 1 else "are"
    return f"Not drawn {verb} {', and '.join(weaker + crowded)}; runs.parquet has all."


def _dependency_row(one: Dependency) -> list[str]:
    correlation = "–" if one.rank_correlation is None else f"{one.rank_correlation:+.2f}".replace("-", "−")
    return [one.metric, one.parameter, correlation, f"{one.information:.2f}", f"{one.runs:,}"]


def _range_row(name: str, values: Any) -> list[str]:
    """Return name, smallest, median and largest value, and how many runs have one; for names, how many there are."""
    known = [value for value in values if value is not None]
    if any(isinstance(value, str) for value in known):
        names = Counter(map(str, known))
        shown = ", ".join(sorted(names)[:6]) + (" …" if len(names) > 6 else "")
        return [name, shown, "", "", f"{len(known):,}"]
    if not known:
        return [name, "", "", "", "0"]
    return [name, *map(_digits, (min(known), float(np.median(known)), max(known))), f"{len(known):,}"]


def _metric_row(name: str, known: np.ndarray) -> list[str]:
    """Return name, mean, smallest, median and largest value, and how many runs have one."""
    ranges = _range_row(name, known.tolist())
    return [name, _digits(float(known.mean())) if len(known) else "", *ranges[1:]]


def _digits(number: float) -> str:
    return f"{number:.4g}".replace("-", "−")


def _failed_rows(folder: Path, order: RunOrder, columns: StudyColumns, failed: list[FailedRun]) -> list[list[str]]:
    """Return how failing depends on each parameter, as far as it is known which runs failed."""
    known = [run for run in failed if run.values]
    if not known or not columns.values:
        return []
    values = {name: own + [run.values.get(name) for run in known] for name, own in columns.values.items()}
    outcome = np.concatenate([np.zeros(len(order)), np.ones(len(known))])
    return [_dependency_row(one)[1:] for one in dependencies(values, {"failing": outcome}) if one.strength > 0]
