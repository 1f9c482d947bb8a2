# SPDX-License-Identifier: GPL-3.0-or-later
"""What recordings can tell apart and what to record next, as sentences, rows of a table, JSON and the CSV of a trajectory."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...io.file_list import FileList
from ...io.file_writing import atomic_write
from ..kinds.decision_numbers import LEAST_SHARE_TOLD
from ..planning.experiment_plan import ExperimentPlan, PlannedExperiment
from ..planning.outlook import Outlook
from ..planning.paths import Trajectory

FORMAT = "palpate-plan/1"
PLAN, TRAJECTORY = "plan.json", "plan.csv"
"""Files of a plan in advance."""
NEXT_TRAJECTORY = "next_experiment.csv"
"""File of the trajectory that is planned after a run."""
LEAST_GAIN = 0.05
"""Gain in sureness below which a trajectory is not worth its time. Chosen by eye."""


def table_rows(plan: ExperimentPlan) -> list[tuple[str, str]]:
    """Return for each signal with which kinds it may be confused, and how much of it these leave."""
    rows = []
    for signal in plan.signals:
        if signal.split("/")[0] not in plan.cannot_show:
            words = ", ".join(f"{one.other} ({_left(one)})" for one in plan.taken_for(signal))
            rows.append((signal.replace("/", ", "), words or "distinguishable from all others"))
    return rows + [(kind, why) for kind, why in plan.cannot_show.items()]


def _left(one: Outlook) -> str:
    """Why a signal may be taken for another kind."""
    if not one.is_shown:
        return "not shown"
    return f"{one.distinction.share:.0%} left" if one.distinction.share < LEAST_SHARE_TOLD else "if it is small"


def planned_sentence(words: Mapping[str, Any]) -> str:
    """Return what a planned experiment, as :func:`experiment_words` gives it, is good for, and how sure one will be."""
    what = " from ".join(words["between"])
    if words["sure_after"] - words["sure_before"] < LEAST_GAIN:
        return (
            f"No trajectory within these limits separates {what} better than your recordings (confidence "
            f"{words['sure_before']:.0%}): allow more depth, speed, duration or places. The best one found is {words['file']}."
        )
    return (
        f"{words['file']} is a trajectory of {words['limits']['duration']:.3g} s that separates {what}: "
        f"confidence {words['sure_after']:.0%} with it, {words['sure_before']:.0%} without."
    )


def experiment_words(experiment: PlannedExperiment, file: str) -> dict[str, Any]:
    """Return a planned experiment for JSON."""
    limits = experiment.limits
    return {
        "file": file,
        "between": list(experiment.kinds),
        "sure_before": round(experiment.sure_before, 3),
        "sure_after": round(experiment.sure_after, 3),
        "limits": {
            "depth": limits.depth,
            "speed": limits.speed,
            "duration": limits.duration,
            "area": None if limits.area is None else list(limits.area),
        },
        "before": _pairs(experiment.design.before),
        "after": _pairs(experiment.design.after),
    }


def _pairs(outlooks: Sequence[Outlook]) -> list[dict[str, Any]]:
    return [
        {
            "signal": one.distinction.signal,
            "taken_for": one.other,
            "share_left": round(one.distinction.share, 4),
            "smallest": round(one.distinction.smallest, 6) if math.isfinite(one.distinction.smallest) else None,
            "shown": one.is_shown,
            "told": one.is_told,
        }
        for one in outlooks
    ]


def write_plan(plan: ExperimentPlan, folder: Path) -> list[Path]:
    """Write what recordings tell into `plan.json`, and the next experiment into `plan.csv` if there is one.

    Files of an earlier plan in the folder are replaced.

    Returns
    -------
    list of Path

    Raises
    ------
    FileError
        The folder cannot be written to.
    """
    files, one = FileList(folder), plan.experiment
    words = {
        "format": FORMAT,
        "pairs": _pairs(plan.outlooks),
        "cannot_show": plan.cannot_show,
        "experiment": None if one is None else experiment_words(one, TRAJECTORY),
    }
    with files.new_files("plan") as new:
        made = [new / PLAN]
        if one is not None:
            write_trajectory(one.design.trajectory, new / TRAJECTORY)
            made.append(new / TRAJECTORY)
        with atomic_write(new / PLAN) as temporary:
            temporary.write_text(json.dumps(words, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
        files.replace(new, {"plan": made})
    return [folder / path.name for path in made]


def write_trajectory(trajectory: Trajectory, path: Path) -> None:
    """Write the samples of a trajectory as the columns that a recording of a rig has: SI units, one header line."""
    columns = {"time": trajectory.time}
    positions, levels = trajectory.positions(), trajectory.levels()
    if positions is not None:
        axes = ("x", "y", "z") if levels is None else ("x", "y")
        columns |= dict(zip(axes, positions.T, strict=False))
    if trajectory.quaternion is not None:
        turns = zip(("qw", "qx", "qy", "qz"), trajectory.quaternion, strict=True)
        columns |= {name: value + 0.0 * trajectory.time for name, value in turns}
    if levels is not None:
        columns[trajectory.level_name] = levels
    rows = zip(*columns.values(), strict=True)
    with atomic_write(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        file.writelines(",".join(f"{value:.9g}" for value in row) + "\n" for row in rows)
