# SPDX-License-Identifier: GPL-3.0-or-later
"""Preview of logs: a table of text and a plot of what was read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...figures.figure_canvas import new_figure
from ...io.file_writing import atomic_write
from ..dataset.rig import Rig
from .column_behaviour import finite
from .log_table import LogFile

MOST_COLUMNS = 24
"""Columns of a table that are listed."""
MOST_TRIALS, MOST_CURVES, MOST_POINTS = 12, 8, 2000


def preview_rows(logs: Sequence[LogFile]) -> list[tuple[str, ...]]:
    """Return a table of all columns of logs: file, column, unit, number of values, least and largest; logs of one kind once."""
    rows: list[tuple[str, ...]] = [("log", "column", "unit", "samples", "from", "to")]
    seen = set()
    for log in logs:
        kind = tuple((table.name, tuple(table.columns)) for table in log.tables)
        if kind in seen:
            rows.append((log.name, "(the same columns)", "", str(max(table.sample_count for table in log.tables)), "", ""))
            continue
        seen.add(kind)
        for table in log.tables:
            for i, (name, values) in enumerate(table.columns.items()):
                if i == MOST_COLUMNS:
                    rows.append((log.name, f"{table.full_name('')}… {len(table.columns) - i} more", "", "", "", ""))
                    break
                known = finite(values)
                ends = [f"{end:.6g}" for end in (known.min(), known.max())] if len(known) else ["", ""]
                if len(known) and ends[0] == ends[1]:  # as of clocks that count from 1970
                    ends = [f"{end:.14g}" for end in (known.min(), known.max())]
                rows.append((log.name, table.full_name(name), table.units.get(name, ""), str(len(known)), *ends))
    return rows


def plot_rig(rig: Rig, path: str | Path) -> None:
    """Write a picture of the recordings of a rig: what drove the sensor, and what answered, over time.

    Parameters
    ----------
    rig : Rig
    path : path of the PNG file

    Raises
    ------
    FileError
        The file cannot be written.
    """
    trials = rig.trials[:MOST_TRIALS]
    figure = new_figure(10.0, 2.4 * len(trials))
    figure.set_layout_engine("constrained")
    axes = figure.subplots(len(trials), 2, squeeze=False)
    for row, trial in zip(axes, trials, strict=True):
        driven, answered = {}, {}
        if trial.level is not None:
            driven = {"depth (m)" if trial.stimulus == "depth" else "force (N)": trial.level}
        elif trial.position is not None:
            driven = {f"{axis} (m)": values for axis, values in zip("xyz", trial.position.T)}
        if trial.reading is not None:
            loudest = np.argsort(-np.nan_to_num(np.nanmax(trial.reading, axis=0) - np.nanmin(trial.reading, axis=0)))
            answered = {f"texel_{i} ({rig.parameters.unit})": trial.reading[:, i] for i in loudest[:MOST_CURVES]}
        elif trial.force is not None:
            answered = {f"force_{axis} (N)": values for axis, values in zip("xyz", trial.force.T)}
        step = max(1, len(trial.time) // MOST_POINTS)
        for axis, curves in zip(row, (driven, answered), strict=True):
            for name, values in curves.items():
                axis.plot(trial.time[::step], values[::step], linewidth=0.8, label=name)
            if curves:
                axis.legend(fontsize="x-small", loc="upper right")
        row[0].set_ylabel(f"{trial.name} ({trial.use})")
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    with atomic_write(path) as temporary:
        figure.savefig(temporary, format="png", dpi=100, metadata={"Software": "Palpate"})
