# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of studies with runs that were computed without a study: solved presses on a pad, and made-up recordings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from sample_bake import grid_texels, recording_of
from solver_scenes import pad, pressed, shape, smooth_path

from palpate.core.geometry.texels import Texels
from palpate.core.model.recording import Recording
from palpate.core.model.scenario import Scenario
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.simulation import run
from palpate.core.study.study_file import Run, read_study
from palpate.sweep.dataset import publish
from palpate.sweep.features import Layout, frames_of
from palpate.sweep.parts import RunResult, write_part

FPS, SECONDS = 50.0, 0.3
RADIUS = 0.008
FRICTION = {"mus": 0.2, "mud": 0.15, "sigma0": 5e3}


def new_study(folder: Path, more: str = "") -> Path:
    """Make the folder of a study without runs."""
    (folder / "parts").mkdir(parents=True)
    text = f'format = "palpate-sweep/1"\nname = "presses"\nscene = "pad.npz"\ndesign = "random"\nsamples = 1000\n{more}'
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder


def published(study: Path, results: Iterable[RunResult], at_once: int = 1000) -> Path:
    """Write runs into parts of so many, and publish them."""
    found = list(results)
    for at in range(0, len(found), at_once):
        write_part(study, found[at : at + at_once])
    publish(study, read_study(study / "study.toml"))
    return study


def press(seed: int) -> tuple[Scenario, dict[str, Any]]:
    """A ball that is pressed into the pad at a random place, to a random depth, and slides a little."""
    random = np.random.default_rng(seed)
    values = {
        "x": float(random.uniform(-0.006, 0.006)),
        "y": float(random.uniform(-0.018, 0.018)),
        "depth": float(random.uniform(0.0004, 0.002)),
        "pad.k": float(np.exp(random.uniform(np.log(300.0), np.log(3000.0)))),
    }
    heights = smooth_path((0.0, 0.001), (0.12, -values["depth"]), (0.3, -values["depth"]), fps=FPS, end=SECONDS)
    slide = smooth_path((0.0, 0.0), (0.14, 0.0), (0.3, 0.006), fps=FPS, end=SECONDS)
    path = np.stack([values["x"] + slide, np.full(len(heights), values["y"]), heights + RADIUS], axis=1)
    ball = shape(trimesh.creation.icosphere(3, RADIUS), "ball")
    return pressed(ball, path, pad(), fps=FPS, k=values["pad.k"], **FRICTION), values


def solved_press(index: int) -> tuple[RunResult, Recording]:
    """A press that is solved, and its recording."""
    scenario, values = press(index)
    recording = run(scenario)
    force = np.linalg.norm(recording.sensors["pad"].net_force, axis=1)
    layout, columns = frames_by(scenario, recording)
    metrics = {"largest_force": float(force.max())}
    return RunResult(run_of(index, values), metrics=metrics, seconds=0.01, layout=layout, columns=columns), recording


def frames_by(scenario: Scenario, recording: Recording, **style: bool) -> tuple[Layout, dict[str, np.ndarray]]:
    """The frames of a recording of a scenario."""
    sensors = {own.name: (own.texels, own.painted, own.parameters) for own in scenario.sensors}
    return frames_of(recording, sensors, **style)


def made_up(index: int, values: dict[str, Any], texels: dict[str, Texels] | None = None, load: float = 1.0,
            **style: bool) -> RunResult:  # fmt: skip
    """A run whose recording nobody has solved; its metric follows the load."""
    texels = texels or {"pad": grid_texels()}
    arrays = {}
    for name, own in texels.items():
        (arrays[name],) = recording_of(own, 5 + index % 10).sensors.values()
        arrays[name].normal_force = arrays[name].normal_force * load
        arrays[name].net_force = arrays[name].net_force * load
    first = next(iter(texels.values()))
    recording = replace(recording_of(first, 5 + index % 10), sensors=arrays)
    sensors = tuple(Sensor(name, 0, own, SensorParameters()) for name, own in texels.items())
    scenario = replace(press(0)[0], sensors=sensors)
    layout, columns = frames_by(scenario, recording, **style)
    return RunResult(run_of(index, values), metrics={"load": load}, seconds=0.01, layout=layout, columns=columns)


def failed(index: int, sentence: str, values: dict[str, Any] | None = None) -> RunResult:
    """A run that has failed."""
    return RunResult(run_of(index, values or {}), sentence, "Traceback …")


def run_of(index: int, values: dict[str, Any]) -> Run:
    """The run of an index."""
    return Run(index, "pad", values, f"{index:024x}")
