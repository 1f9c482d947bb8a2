# SPDX-License-Identifier: GPL-3.0-or-later
"""The experiments in the order of the paper. A new one is a function in a module of this package, and a row here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from . import calibration, geometries, grasping, weighing
from .chapter import Chapter


@dataclass(frozen=True)
class Experiment:
    """An experiment: `run` takes the folder for its figures and a function that it calls after each of its `steps`."""

    run: Callable[[Path, Callable], Chapter]
    steps: int


EXPERIMENTS = {
    "geometries": Experiment(geometries.sensors, 2),
    "stiffness": Experiment(calibration.stiffness, 1),
    "friction": Experiment(calibration.friction, 1),
    "definition": Experiment(calibration.definition, 1),
    "weighing": Experiment(weighing.weigh, 5),
    "tilt": Experiment(weighing.hold, 3),
    "grasps": Experiment(grasping.four_objects, 8),
    "heavy": Experiment(grasping.too_heavy, 2),
    "pick-and-place": Experiment(grasping.work_cycle, 7),
    "hand": Experiment(grasping.finger_and_thumb, 2),
}
