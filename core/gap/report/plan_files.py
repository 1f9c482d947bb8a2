# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds that recordings separate and the next recording, as sentences, rows of a table, JSON and the CSV of a trajectory."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ...io.file_writing import atomic_write, write_text
from ...io.hidden_folder import FileList
from ..dataset.column_names import TURN
from ..planning.experiment_plan import ExperimentPlan, PlannedExperiment
from ..planning.paths import Trajectory
from ..planning.separation import LEAST_SHARE, Separation

FORMAT = "palpate-plan/2"
PLAN, TRAJECTORY = "plan.json", "plan.csv"
"""Files of a plan in advance."""
NEXT_TRAJECTORY = "next_experiment.csv"
"""File of the trajectory that is planned after a run."""
LEAST_GAIN = 1.2
"""Factor of the separation below which a trajectory is not worth its time. Chosen by eye."""


def table_rows(plan: ExperimentPlan) -> list[tuple[str, str]]:
    """Return for each kind with which others it may be confused, and how much of it these leave."""
    others: dict[str, list[str]] = {one.kind: [] for one in plan.separations}
    for one in sorted(plan.separations, key=lambda one: one.share):
        if not one.is_separated:
            why = f"{one.share:.0%} left" if one.share < LEAST_SHARE else "if it is small"
            others[one.kind].append(f"{one.other} ({why})")
    rows = [(kind, ", ".join(words) or "distinguishable from all others") for kind, words in others.items()]
    return [*rows, *plan.cannot_show.items()]


def planned_sentence(words: Mapping[str, Any]) -> str:
    """Return the purpose of a planned experiment, as :func:`experiment_words` gives it, as a sentence."""
    what = " from ".join(words["between"])
    before, after = words["separation_before"], words["separation_after"]
    if after < LEAST_GAIN * before:
        forces = "" if words["net_forces"] else ", or record net forces"
        return (
            f"No programme within these limits separates {what} better than your recordings ({before:.3g} standard deviations "
            f"of the noise): allow more depth, speed, duration or places{forces}. The best one is {words['file']}."
        )
    return (
        f"{words['file']} is a trajectory of {words['limits']['duration']:.3g} s ({words['programme']}) that separates {what} "
        f"by {after:.3g} standard deviations of the noise; your recordings alone by {before:.3g}."
    )


def experiment_words(experiment: PlannedExperiment, file: str) -> dict[str, Any]:
    """Return a planned experiment for JSON: its separations are those of the least separated pair."""
    return {
        "file": file,
        "programme": experiment.programme,
        "between": list(dict.fromkeys(one.kind for one in experiment.before)),
        "separation_before": round(min(one.deviations for one in experiment.before), 3),
        "separation_after": round(min(one.deviations for one in experiment.after), 3),
        "limits": asdict(experiment.limits),
        "net_forces": experiment.has_forces,
        "before": _pairs(experiment.before),
        "after": _pairs(experiment.after),
    }


def _pairs(separations: Sequence[Separation]) -> list[dict[str, Any]]:
    return [
        {
            "effect": one.kind,
            "taken_for": one.other,
            "share_left": round(one.share, 4),
            "separation": round(one.deviations, 3),
            "separated": one.is_separated,
        }
        for one in separations
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
        "pairs": _pairs(plan.separations),
        "cannot_show": plan.cannot_show,
        "experiment": None if one is None else experiment_words(one, TRAJECTORY),
    }
    with files.new_files("plan") as new:
        made = [new / PLAN]
        if one is not None:
            write_trajectory(one.trajectory, new / TRAJECTORY)
            made.append(new / TRAJECTORY)
        write_text(new / PLAN, json.dumps(words, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
        return files.replace(new, {"plan": made})


def write_trajectory(trajectory: Trajectory, path: Path) -> None:
    """Write the samples of a trajectory as the columns that a recording of a rig has: SI units, one header line."""
    trial = trajectory.trial
    columns = {"time": trial.time}
    if trial.position is not None and trial.quaternion is not None:
        columns |= dict(zip("xyz" if trial.level is None else "xy", trial.position.T, strict=False))
        columns |= dict(zip(TURN, trial.quaternion.T, strict=True))
    if trial.level is not None:
        columns[trial.stimulus] = trial.level
    rows = np.stack([*columns.values()], axis=1)
    with atomic_write(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        np.savetxt(file, rows, "%.9g", ",", header=",".join(columns), comments="")
