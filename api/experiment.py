# SPDX-License-Identifier: GPL-3.0-or-later
"""The next experiment on a sensor."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..core.gap.planning.experiment_plan import ExperimentPlan
from ..core.gap.planning.experiment_plan import plan_experiment as plan
from ..core.gap.planning.paths import Wishes
from ..core.gap.report import plan_files
from . import arguments
from .arguments import ArgumentError
from .gap import RigOrFile, rig_of
from .running import ShowProgress, finished

LIMITS = ("depth", "speed", "duration", "area")
"""Limits of a plan."""


class Plan:
    """Effects that recordings distinguish, and the next experiment: the result of :func:`plan_experiment`.

    Attributes
    ----------
    outlook : ExperimentPlan
        Every pair of effects.
    """

    def __init__(self, outlook: ExperimentPlan):
        self.outlook = outlook

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Each effect, and the effects that it may be confused with."""
        return plan_files.table_rows(self.outlook)

    @property
    def sentence(self) -> str:
        """Purpose of the planned experiment."""
        if self.outlook.experiment is None:
            return "These recordings distinguish all of these effects: no further one is planned."
        return plan_files.planned_sentence(plan_files.experiment_words(self.outlook.experiment, plan_files.TRAJECTORY))

    @property
    def is_complete(self) -> bool:
        """True when the recordings distinguish all effects, so that nothing is planned."""
        return self.outlook.experiment is None

    @property
    def path_of_motion(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Times (m,), s, and positions (m, 3), m, of the probe in the sensor's frame; None where no poses are planned."""
        trial = None if self.outlook.experiment is None else self.outlook.experiment.trajectory.trial
        return None if trial is None or trial.position is None else (trial.time, trial.position)

    def report(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write plan.json, and the trajectory as plan.csv where there is one; return the files."""
        from ..core.io.file_writing import writable_folder

        return plan_files.write_plan(self.outlook, writable_folder(folder, create=True))

    def __repr__(self) -> str:
        return f"<Plan: {self.sentence}>"


def plan_experiment(
    rig: RigOrFile, limits: Mapping[str, Any] | None = None, between: Sequence[str] = (), progress: ShowProgress = False
) -> Plan:
    """Return which effects the recordings of a rig distinguish, and plan the recording that separates most of the others.

    Parameters
    ----------
    rig : Rig or path of a rig.toml
    limits : mapping, optional
        Any of depth (m), speed (m/s), duration (s) and area (least and largest x, least and largest y in the sensor's frame,
        m); N and N/s where the rig knows forces. Default: as far as the recordings went.
    between : sequence of str, optional
        Effects that the recording is to tell apart.
    progress : bool or callable
        True for a progress bar.

    Raises
    ------
    PalpateError
        The rig cannot be used, or a limit or an effect is unknown or has no meaning.
    """
    if limits is not None and not isinstance(limits, Mapping):
        raise ArgumentError(f"limits is {arguments.brief(limits)}: give a mapping, as {{'depth': 0.002}}.")
    words = dict(limits or {})
    arguments.known(words, LIMITS, "limit of an experiment called")
    area = words.pop("area", None)
    for name, value in words.items():
        if value is not None and not isinstance(value, float | int | np.floating):
            raise ArgumentError(f"{name} of limits is {arguments.brief(value)}: give a number.")
    if area is not None:
        x0, x1, y0, y1 = arguments.numbers(area, (4,), "area of limits").tolist()
        area = (x0, x1, y0, y1)
    found = rig_of(rig)
    return Plan(finished(plan(found, Wishes(tuple(between), area=area, **words)), progress, "plan"))
