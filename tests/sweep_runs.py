# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of runs as a sweep leaves them: solved presses on a pad, in any number and any order of finishing."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import trimesh
from solver_scenes import pad, pressed, shape, smooth_path

from palpate.core.io.bake_folder import RECORDING_NAME, Manifest, folder_names, write_manifest
from palpate.core.io.recording_npz import save_recording
from palpate.core.io.sensor_npz import SENSOR_NAME, save_sensor
from palpate.core.model.recording import Recording
from palpate.core.model.scenario import Scenario
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.solver.simulation import run
from palpate.core.study import run_files
from palpate.core.study.study_file import Run

FPS, SECONDS = 50.0, 0.3
RADIUS = 0.008
FRICTION = {"mus": 0.2, "mud": 0.15, "sigma0": 5e3}


def press(seed: int, frames_per_second: float = FPS) -> tuple[Scenario, dict[str, float | str]]:
    """A ball that is pressed into the pad at a random place, to a random depth, and slides a little."""
    random = np.random.default_rng(seed)
    values = {
        "x": float(random.uniform(-0.006, 0.006)),
        "y": float(random.uniform(-0.018, 0.018)),
        "depth": float(random.uniform(0.0004, 0.002)),
        "pad.k": float(np.exp(random.uniform(np.log(300.0), np.log(3000.0)))),
    }
    heights = smooth_path((0.0, 0.001), (0.12, -values["depth"]), (0.3, -values["depth"]), fps=frames_per_second, end=SECONDS)
    slide = smooth_path((0.0, 0.0), (0.14, 0.0), (0.3, 0.006), fps=frames_per_second, end=SECONDS)
    path = np.stack([values["x"] + slide, np.full(len(heights), values["y"]), heights + RADIUS], axis=1)
    ball = shape(trimesh.creation.icosphere(3, RADIUS), "ball")
    return pressed(ball, path, pad(), fps=frames_per_second, k=values["pad.k"], **FRICTION), values


def metrics_of(recording: Recording) -> dict[str, float | None]:
    """Numbers that stand for the metrics of a sweep."""
    (sensor,) = recording.sensors.values()
    force = np.linalg.norm(sensor.net_force, axis=1)
    fast = np.nonzero(sensor.slip.max(axis=1) > 0.01)[0]
    return {
        "largest_force": float(force.max()),
        "touched_texels": float(sensor.contact.sum(axis=1).max()),
        "first_motion": float(recording.times[fast[0]]) if len(fast) else None,
    }


def write_sensor_folder(folder: Path, sensor: Sensor, recording: Recording) -> None:
    """Write what a bake leaves of one sensor, without images."""
    folder.mkdir(parents=True)
    save_recording(folder / RECORDING_NAME, replace(recording, sensors={sensor.name: recording.sensors[sensor.name]}), False)
    save_sensor(folder / SENSOR_NAME, sensor.texels, sensor.painted, False)
    manifest = Manifest(
        sensor=sensor.name,
        palpate="0",
        frame_start=int(recording.frames[0]),
        frame_end=int(recording.frames[-1]),
        fps=FPS,
        dt=recording.dt,
        digest=recording.digest,
        unit=sensor.parameters.unit,
        shape=tuple(sensor.texels.layout.shape),
        parameters=asdict(sensor.parameters),
        warnings=(),
        complete=True,
    )
    write_manifest(folder, manifest, False)


def write_run(study: Path, index: int, sensors: list[Sensor], recording: Recording, values: dict) -> Path:
    """Write one finished run into the folder of a study and return its folder."""
    digest = hashlib.sha256(json.dumps([index, values]).encode()).hexdigest()[:24]
    folder = study / "runs" / digest
    for name, own in folder_names(sensor.name for sensor in sensors).items():
        write_sensor_folder(folder / own, next(sensor for sensor in sensors if sensor.name == name), recording)
    content = {
        "format": "palpate-run/1",
        "digest": digest,
        "index": index,
        "values": values,
        "metrics": metrics_of(recording) if len(sensors) == 1 else {},
        "seconds": 0.01 * index,
        "frames": len(recording.frames),
        "sensors": [sensor.name for sensor in sensors],
    }
    (folder / "run.json").write_text(json.dumps(content), encoding="utf-8")
    return folder


def new_study(folder: Path, name: str = "presses") -> Path:
    """Make the folder of a study without runs."""
    (folder / "runs").mkdir(parents=True)
    text = f'format = "palpate-sweep/1"\nname = "{name}"\nscene = "pad.npz"\ndesign = "random"\nsamples = 1000\n'
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder


def write_press(study: Path, index: int, frames_per_second: float = FPS) -> Path:
    """Solve a press and write it as a finished run."""
    scenario, values = press(index, frames_per_second)
    return write_run(study, index, list(scenario.sensors), run(scenario), values)


def write_failure(study: Path, index: int, sentence: str) -> Run:
    """Write a failed run, a sentence and a traceback, and return which run it was."""
    (study / "failed").mkdir(exist_ok=True)
    run = Run(index, "pad", press(index)[1], f"f{index:023x}")
    run_files.write_failure(study, run.digest, sentence, "Traceback …")
    return run


def unit_sensor(name: str, texels) -> Sensor:
    """A sensor with default parameters, for recordings that nobody solved."""
    return Sensor(name, 0, texels, SensorParameters())
