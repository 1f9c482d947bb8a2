# SPDX-License-Identifier: GPL-3.0-or-later
"""``report.html``: a study at a glance, one page with its pictures inside."""

from __future__ import annotations

import base64
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from ..core.errors import counted
from ..core.figures.html_templates import render_html
from ..core.io.file_writing import atomic_write
from ..core.io.hidden_folder import temporary_folder
from ..core.study.study_file import Study
from .dataset import TABLE_NAME, TIMINGS_NAME, UNNAMED_STUDY
from .dependencies import LEAST_RUNS, RUNS_PER_GROUP, Dependency, dependencies, is_known
from .features import by_texel, net_force_name, tactile_name
from .parts import FINISHED, READING, Parts, frames_in
from .report_figures import MOST_METRICS, MOST_NAMES, MOST_PARAMETERS, RunImage, draw_image_sheet, draw_small_multiples

REPORT_NAME = "report.html"
TEMPLATE = Path(__file__).parent / "templates" / "sweep_report.html"
MOST_DEPENDENCIES, MOST_MESSAGES, MOST_IMAGES = 15, 12, 24
PLACE_OF_PRESS = "press."
"""First word of the metrics that say where a press was."""
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
            draw_small_multiples(hidden / "multiples.png", values, metrics, *drawn, strong)
        if images:
            draw_image_sheet(hidden / "images.png", images)
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
    with atomic_write(folder / REPORT_NAME) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _seconds_of(timings: Path) -> float:
    from pyarrow import csv

    return float(np.sum(csv.read_csv(timings, convert_options=csv.ConvertOptions(include_columns=["seconds"]))["seconds"]))


def _most_dependent(values: Columns, metrics: Columns, found: list[Dependency]) -> tuple[list[str], list[str]]:
    """Return the parameters and metrics that are drawn: those in the strongest dependencies first, then in their order."""
    drawable = [name for name, own in values.items() if own.dtype != object or len(set(own)) <= MOST_NAMES]
    parameters = dict.fromkeys([*(one.parameter for one in found if one.parameter in drawable), *drawable])
    measured = dict.fromkeys([*(one.metric for one in found), *metrics])
    return list(parameters)[:MOST_PARAMETERS], list(measured)[:MOST_METRICS]


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
