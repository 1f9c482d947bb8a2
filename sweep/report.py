# SPDX-License-Identifier: GPL-3.0-or-later
"""``report.html``: a study at a glance, one page with its pictures inside."""

from __future__ import annotations

import base64
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import counted
from ..core.figures.html_templates import render_html
from ..core.io.file_writing import atomic_write
from ..core.io.hidden_folder import temporary_folder
from ..core.study.study_file import Study
from .dataset import TABLE_NAME, TIMINGS_NAME, UNNAMED_STUDY
from .dependencies import LEAST_RUNS, RUNS_PER_GROUP, Dependency, dependencies
from .features import by_texel, net_force_name, tactile_name
from .parts import Parts, frames_in
from .report_figures import MOST_METRICS, MOST_NAMES, MOST_PARAMETERS, RunImage, draw_image_sheet, draw_small_multiples

REPORT_NAME = "report.html"
TEMPLATE = Path(__file__).parent / "templates" / "sweep_report.html"
MOST_DEPENDENCIES, MOST_MESSAGES, MOST_IMAGES = 15, 12, 24
PLACE_OF_PRESS = "press."
"""First word of the metrics that say where a press was."""
_NUMBER = re.compile(r"(?<![\w.])-?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)", re.IGNORECASE)


@dataclass(frozen=True)
class StudyColumns:
    """The runs of a study as columns.

    Attributes
    ----------
    values : dict of str to (n,) float or object ndarray
        Names and values of the varied parameters, in all runs.
    metrics : dict of str to (n,) float
        NaN where a run lacks it, as one that failed.
    messages : list of str
        Why runs failed; empty texts for the others.
    """

    values: dict[str, np.ndarray]
    metrics: dict[str, np.ndarray]
    messages: list[str]

    @property
    def is_done(self) -> np.ndarray:
        """(n,) bool."""
        return np.array([not message for message in self.messages], bool)

    @classmethod
    def read(cls, path: Path) -> StudyColumns:
        """Read ``runs.parquet``."""
        from pyarrow import parquet

        table = parquet.read_table(path)

        def named(start: str) -> dict[str, Any]:
            return {name.removeprefix(start): table[name] for name in table.column_names if name.startswith(start)}

        values = {name: column.to_numpy(zero_copy_only=False) for name, column in named("varied.").items()}
        metrics = {name: column.to_numpy(zero_copy_only=False).astype(float) for name, column in named("metric.").items()}
        return cls(values, metrics, table["message"].to_pylist())


def write_report(folder: Path, study: Study) -> None:
    """Write ``report.html`` into the folder of a study, from its table of runs and its parts.

    Raises
    ------
    FileError
        A part is damaged, or the page cannot be written.
    """
    runs = StudyColumns.read(folder / TABLE_NAME)
    failures = [message for message in runs.messages if message]
    found = dependencies(runs.values, runs.metrics)
    failing = dependencies(runs.values, {"failing": 1.0 - runs.is_done}) if failures else []
    drawn = _most_dependent(runs, found)
    with temporary_folder(folder, "report") as hidden:
        page = render_html(
            TEMPLATE,
            name=study.name or UNNAMED_STUDY,
            headline=_headline(runs, _seconds_of(folder / TIMINGS_NAME)),
            strongest=_strongest_sentence(found),
            dependencies=[_dependency_row(one) for one in found[:MOST_DEPENDENCIES]],
            left_off=len(found[MOST_DEPENDENCIES:]),
            ranges=[_range_row(name, values[runs.is_done].tolist()) for name, values in runs.values.items()],
            metrics=[_metric_row(name, values[np.isfinite(values)]) for name, values in runs.metrics.items()],
            messages=_message_rows(failures),
            failures=len(failures),
            failed_dependencies=[_dependency_row(one)[1:] for one in failing],
            pictures={
                path.stem: base64.b64encode(path.read_bytes()).decode() for path in _draw(hidden, folder, runs, found, *drawn)
            },
            shown=_shown_sentence(runs, *drawn),
        )
        with atomic_write(folder / REPORT_NAME) as temporary:
            temporary.write_text(page, encoding="utf-8")


def _seconds_of(timings: Path) -> float:
    from pyarrow import csv

    return float(sum(csv.read_csv(timings)["seconds"].to_pylist()))


def _draw(
    hidden: Path, folder: Path, runs: StudyColumns, found: list[Dependency], parameters: list[str], metrics: list[str]
) -> list[Path]:
    """Draw the pictures that the study has something for, and return their files."""
    drawn = []
    if parameters and metrics:
        strong = {(one.parameter, one.metric) for one in found}
        values = {name: runs.values[name].tolist() for name in parameters}
        draw_small_multiples(hidden / "multiples.png", values, {name: runs.metrics[name] for name in metrics}, strong)
        drawn.append(hidden / "multiples.png")
    images = _images(Parts(folder))
    if images:
        draw_image_sheet(hidden / "images.png", images)
        drawn.append(hidden / "images.png")
    return drawn


def _most_dependent(runs: StudyColumns, found: list[Dependency]) -> tuple[list[str], list[str]]:
    """Return the parameters and metrics that are drawn: those in the strongest dependencies first, then in their order."""
    drawable = [name for name, own in runs.values.items() if _has_few_names(own)]
    parameters = dict.fromkeys([*(one.parameter for one in found if one.parameter in drawable), *drawable])
    metrics = dict.fromkeys([*(one.metric for one in found), *runs.metrics])
    return list(parameters)[:MOST_PARAMETERS], list(metrics)[:MOST_METRICS]


def _has_few_names(values: np.ndarray) -> bool:
    """Return False for a choice of more names than a picture has room for."""
    return values.dtype != object or len(set(values)) <= MOST_NAMES


def _images(parts: Parts) -> list[RunImage]:
    """Return images of the first sensor of runs that are spread evenly over the design."""
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
        image = by_texel(columns[tactile_name(sensor)], texels)[frame].astype(float)
        images.append(RunImage(f"run {index}", texels, image[:, 0], image[:, 1:]))
    return images


def _headline(runs: StudyColumns, seconds: float) -> str:
    done = int(runs.is_done.sum())
    failed = len(runs.messages) - done
    text = f"{counted(done, 'run') if done else 'No run'} finished, {f'{failed:,}' if failed else 'none'} failed."
    if runs.values:
        text += f" {counted(len(runs.values), 'parameter')} varied."
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


def _message_rows(sentences: list[str]) -> list[tuple[str, int]]:
    """Return the most frequent sentences with their numbers of runs; those that differ in numbers alone are one, the first."""
    counts, first = Counter[str](), dict[str, str]()
    for sentence in sentences:
        kind = _NUMBER.sub("0", sentence)
        counts[kind] += 1
        first.setdefault(kind, sentence)
    return [(first[kind], count) for kind, count in counts.most_common(MOST_MESSAGES)]


def _shown_sentence(runs: StudyColumns, parameters: list[str], metrics: list[str]) -> str:
    """Say what the small multiples leave out."""
    counts = [(len(parameters), len(runs.values), "parameter"), (len(metrics), len(runs.metrics), "metric")]
    parts = [f"{drawn} of {counted(count, what)}" for drawn, count, what in counts if drawn < count]
    return f"Drawn are {' and '.join(parts)}; runs.parquet has all." if parts else ""


def _dependency_row(one: Dependency) -> list[str]:
    correlation = "–" if one.rank_correlation is None else f"{one.rank_correlation:+.2f}".replace("-", "−")
    return [one.metric, one.parameter, correlation, f"{one.strength:.2f}", f"{one.runs:,}"]


def _range_row(name: str, values: list[Any]) -> list[str]:
    """Return name, smallest, median and largest value, and how many runs have one; for names, how many there are."""
    known = [value for value in values if value is not None]
    if any(isinstance(value, str) for value in known):
        names = sorted(set(known))
        return [name, ", ".join(names[:6]) + (" …" if len(names) > 6 else ""), "", "", f"{len(known):,}"]
    ends = (min(known), float(np.median(known)), max(known)) if known else ()
    return [name, *map(_digits, ends), *[""] * (3 - len(ends)), f"{len(known):,}"]


def _metric_row(name: str, known: np.ndarray) -> list[str]:
    """Return name, mean, smallest, median and largest value, and how many runs have one."""
    return [name, _digits(float(known.mean())) if len(known) else "", *_range_row(name, known.tolist())[1:]]


def _digits(number: float) -> str:
    return f"{number:.4g}".replace("-", "−")
