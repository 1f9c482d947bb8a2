# SPDX-License-Identifier: GPL-3.0-or-later
"""A Dask worker: compute a batch of runs and write them into a part."""

from __future__ import annotations

import errno
import os
import shutil
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import FileError, PalpateError, os_error_reason
from ..core.geometry.rotations import rotation_matrices
from ..core.io.bake_folder import folder_names, manifest_of, write_arrays_of, write_image_of, write_manifest
from ..core.io.hidden_folder import temporary_folder
from ..core.io.scenario_npz import load_scenario
from ..core.jobs import run_job
from ..core.model.recording import Recording, SensorRecording
from ..core.model.scenario import Scenario
from ..core.model.sensor import Sensor
from ..core.model.shared_results import SharedResults
from ..core.response import net_shear, share_on, slipping
from ..core.study.presses import PLACE_PARAMETERS, Press, place_of
from ..core.study.scene_property import is_scene_property, write_overrides
from ..core.study.study_file import RUNS, SCENE, SCENES, STUDY_NAME, Run, at_rate
from ..core.study.variation import PRESS, varied_scenario
from .features import frames_of
from .parts import RunResult, write_part
from .scripts import REFUSE, frozen_program, read_blend, require_allowed
from .study_folder import OpenStudy, resume_study

# Metrics of a run of a study.
#
# ======================  ============================================================================================
# ``max_normal_force``    N, largest sum of the texels' normal forces
# ``max_texel_force``     N, largest normal force of a texel
# ``max_shear``           N, largest magnitude of the sum of shear
# ``max_depth``           m
# ``max_contact_texels``  largest number of texels that touch at once
# ``first_contact``       s, first frame with a contact; missing where nothing touches
# ``first_slip``          s, first frame in which a texel slips; missing where none does
# ``max_slip_share``      largest share of the normal force on slipping texels
# ``end_normal_force``    N, at the last frame
# ======================  ============================================================================================
#
# With several sensors each name begins with that of the sensor. ``BODY.held`` is 1 when a free body is still within reach of a
# sensor at the last frame and that sensor feels something, else 0; ``BODY.fall`` is how far its centre of mass has moved along
# gravity, m. ``press.x``, ``y``, ``z`` are the place of a press in the frame of the sensor's body, m.


def metrics_of(scenario: Scenario, recording: Recording, press: Press | None = None) -> dict[str, float]:
    """Return the metrics of a run by name.

    Parameters
    ----------
    scenario : Scenario
        Of the run.
    recording : Recording
    press : Press, optional
        That the run has made.
    """
    found: dict[str, float] = {}
    for sensor in scenario.read_out:
        start = f"{sensor.name}." if len(scenario.read_out) > 1 else ""
        own = _sensor_metrics(sensor, recording.sensors[sensor.name], recording.times)
        found |= {f"{start}{name}": value for name, value in own.items()}
    for index, body in enumerate(scenario.bodies):
        if body.free:
            poses, size = recording.poses[[0, -1], index], float(np.linalg.norm(scenario.gravity))
            first, last = poses[:, :3] + np.einsum("fij,j->fi", rotation_matrices(poses[:, 3:]), body.center_of_mass)
            found[f"{body.name}.held"] = float(_is_held(index, last, scenario, recording))
            found[f"{body.name}.fall"] = float((last - first) @ scenario.gravity / size) if size else 0.0
    if press is not None:
        found |= {f"press.{axis}": float(value) for axis, value in zip("xyz", place_of(scenario, press), strict=True)}
    return found


def _sensor_metrics(sensor: Sensor, measured: SensorRecording, times: np.ndarray) -> dict[str, float]:
    normal, touching = measured.normal_force.sum(axis=1), np.asarray(measured.contact, bool)
    slips = slipping(measured, sensor.parameters, sensor.painted)
    found = {
        "max_normal_force": float(normal.max()),
        "max_texel_force": float(measured.normal_force.max()),
        "max_shear": float(np.linalg.norm(net_shear(measured, sensor.texels), axis=1).max()),
        "max_depth": float(measured.depth.max()),
        "max_contact_texels": float(touching.sum(axis=1).max()),
        "max_slip_share": float(share_on(slips, measured).max()),
        "end_normal_force": float(normal[-1]),
    }
    for name, happens in (("first_contact", touching), ("first_slip", slips)):
        frames = np.flatnonzero(happens.any(axis=1))
        if len(frames):
            found[name] = float(times[frames[0]])
    return found


def _is_held(index: int, center: np.ndarray, scenario: Scenario, recording: Recording) -> bool:
    """Return whether a free body with its centre of mass at `center`, (3,) m, is near a sensor in contact at the last frame."""
    own = [target for target in scenario.targets if target.body == index]
    middle = scenario.bodies[index].center_of_mass
    reach = max((float(np.linalg.norm(target.mesh.vertices - middle, axis=1).max()) for target in own), default=0.0)
    for sensor in scenario.sensors:
        if sensor.body == index or not sensor.readout or not recording.sensors[sensor.name].contact[-1].any():
            continue
        pose = recording.poses[-1, sensor.body]
        texels = pose[:3] + sensor.texels.position @ rotation_matrices(pose[None, 3:])[0].T
        if np.linalg.norm(texels - center, axis=1).min() <= reach + sensor.parameters.max_penetration:
            return True
    return False


MOST_SCENES_KEPT = 4
"""Scenarios of scenes that a process keeps: the runs of a grid, whose last number changes fastest, share them."""


def _write_sensors(folder: Path, scenario: Scenario, recording: Recording, images: bool) -> None:
    """Write a folder for each sensor into the folder of a run, with a tactile image of each frame where these are wanted."""
    names = folder_names(recording.sensors)
    for sensor in scenario.read_out:
        own = folder / names[sensor.name]
        own.mkdir()
        for part in recording.blocks() if images else ():
            for number in part.frames:
                write_image_of(own, sensor, part.at(int(number)), recording.digest)
        write_manifest(own, manifest_of(scenario, sensor, recording, write_arrays_of(own, sensor, recording)))


PART_BYTES = 32 << 20
"""Numbers of frames from which on a batch writes what it has into a part and goes on with another, as they are in memory."""
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)


@dataclass
class BatchResult:
    """Result of a batch.

    Attributes
    ----------
    done : int
        Number of runs.
    seconds : float
        That all of them took.
    failures : list of (int, str)
        Indices of failed runs and their sentences.
    """

    done: int = 0
    seconds: float = 0.0
    failures: list[tuple[int, str]] = field(default_factory=list)

    @property
    def failed(self) -> int:
        """Number of runs that failed."""
        return len(self.failures)


class RunComputer:
    """Computes runs of a study one after the other, in one thread.

    Parameters
    ----------
    opened : OpenStudy
        Its `run_limit` is asked for between frames.
    """

    def __init__(self, opened: OpenStudy):
        from ..core.solver import precompile

        require_allowed(opened.study, opened.scripts)
        self.opened, self._limit = opened, opened.study.run_limit
        self._read = lru_cache(maxsize=MOST_SCENES_KEPT)(self._read_scene)
        self._program = lru_cache(lambda name: frozen_program(opened.study, opened.folder, name))
        self._shared = SharedResults()
        if not opened.study.is_job:
            precompile.compile_solver()  # loads what was compiled, so that the first run is as fast as the others

    def result(self, index: int) -> RunResult:
        """Compute a run; raise FileError where its files cannot be written, so that no run can be computed."""
        run, began, details = self.opened.runs[index], time.perf_counter(), ""
        try:
            found = self._by_program(run) if self.opened.study.is_job else self._solved(run)
            return replace(found, seconds=time.perf_counter() - began)
        except FileError:
            raise
        except PalpateError as error:
            message = str(error)
        except MemoryError:
            message = "There is not enough memory for this run: use fewer workers."
        except Exception as error:
            message, details = f"A fault of the program: {type(error).__name__}: {error}", traceback.format_exc()
        return RunResult(run, message, details, time.perf_counter() - began)

    def _solved(self, run: Run) -> RunResult:
        study, press = self.opened.study, self.opened.plans[run.scene].press
        values = {**self.opened.plans[run.scene].fixed, **{key: value for key, value in run.values.items() if key != SCENE}}
        scenario = self._scenario(run.scene, values)
        recording = self._recording(scenario, run.index)
        if press is not None:
            place: dict[str, Any] = {word: values[f"{PRESS}.{word}"] for word in PLACE_PARAMETERS}
            press = replace(press, **place)
        metrics = metrics_of(scenario, recording, press)
        sensors = {own.name: (own.texels, own.painted, own.parameters) for own in scenario.read_out}
        layout, columns = frames_of(recording, sensors, self._shared, study.points, study.half_precision)
        if study.has_folders:
            with _run_folder(self.opened.folder, run) as folder:
                _write_sensors(folder, scenario, recording, study.images)
        return RunResult(run, metrics=metrics, layout=layout, columns=columns)

    def _scenario(self, scene: str, values: Mapping[str, Any]) -> Scenario:
        """Return the scenario of a scene with the values of a run; it is read again where they have properties of the scene."""
        plan, of_scene = self.opened.plans[scene], [name for name in values if is_scene_property(name)]
        assert plan.scenario is not None  # but for a program
        scenario = self._read(scene, tuple((name, values[name]) for name in sorted(of_scene))) if of_scene else plan.scenario
        rest = {name: value for name, value in values.items() if name not in of_scene}
        return varied_scenario(scenario, rest, plan.press, plan.meshes, self._shared)

    def _read_scene(self, scene: str, values: tuple[tuple[str, Any], ...]) -> Scenario:
        """Let a Blender read a scene with other values of its properties."""
        scenes = self.opened.folder / SCENES
        with temporary_folder(scenes, "scene") as place:
            overrides, target = place / "overrides.toml", place / "scene.npz"
            write_overrides(overrides, dict(values))
            more = "--overrides", str(overrides)
            read_blend(scenes / f"{scene}.blend", target, self.opened.scripts, more, self._limit)
            return at_rate(load_scenario(target), self.opened.study.fps)

    def _recording(self, scenario: Scenario, index: int) -> Recording:
        from ..core.solver.simulation import Simulation, solve

        simulation, limit = Simulation(scenario, threads=1, shared=self._shared), self._limit
        if limit is None:
            # Many frames are computed in one call; only the files of a recording say the digest of their scenario.
            return simulation.advance_all(with_digest=self.opened.study.has_folders)
        until = time.monotonic() + limit

        def ask(_progress: object) -> None:
            if time.monotonic() > until:
                raise PalpateError(
                    f"Run {index} was ended after its limit of {limit:g} s: raise run_limit, or vary less widely."
                )

        return run_job(solve(scenario, simulation), ask)

    def _by_program(self, run: Run) -> RunResult:
        """Compute a run by the program of a study that has no scene; nothing can end it before it returns."""
        function, began = self._program(run.scene), time.monotonic()
        values = {**self.opened.plans[run.scene].fixed, **run.values}
        with _run_folder(self.opened.folder, run) as folder:
            metrics = _checked_metrics(_called(function, values, folder), run)
            if self._limit is not None and time.monotonic() - began > self._limit:
                raise PalpateError(f"Run {run.index} took longer than its limit of {self._limit:g} s: raise run_limit.")
        return RunResult(run, metrics=metrics)


@contextmanager
def _run_folder(folder: Path, run: Run) -> Iterator[Path]:
    """Yield a hidden folder for the files of a run, which gets its name when the body ends, or goes when it raises."""
    target = folder / RUNS / run.digest
    hidden = target.with_name(f".{run.digest}")
    try:
        shutil.rmtree(hidden, ignore_errors=True)
        hidden.mkdir(parents=True)
        yield hidden
        shutil.rmtree(target, ignore_errors=True)  # of a run that was computed, and whose part was not yet written
        os.replace(hidden, target)
    except OSError as error:
        raise FileError(
            f"Run {run.index} could not be written to '{target.parent}' ({os_error_reason(error)}): free some space or check "
            "the permissions, and give the same command again."
        ) from error
    finally:
        shutil.rmtree(hidden, ignore_errors=True)


def _called(function: Callable[..., Any], values: dict[str, Any], folder: Path) -> Any:
    try:
        return function(values, folder)
    except OSError as error:
        if error.errno in _NO_ROOM:
            raise
        raise RuntimeError(f"{type(error).__name__}: {error}") from error  # its own fault: the study's folder is well


def _checked_metrics(metrics: Any, run: Run) -> dict[str, float]:
    """Return metrics as numbers; those that are None are left out."""
    if not isinstance(metrics, Mapping):
        raise PalpateError(f"The job gave {metrics!r:.60} for run {run.index}: let its run() return metrics by name.")
    found = {}
    for name, value in metrics.items():
        if value is None:
            continue
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            number = float("nan")
        if not isinstance(name, str) or not isfinite(number):
            raise PalpateError(f"Metric {name!r:.60} of run {run.index} is {value!r:.60}: give finite numbers, or None.")
        found[name] = number
    return found


_kept = threading.local()
"""The computer of runs of each thread of a worker, and the study that it is for."""


def _computer_for(folder: Path, scripts: str, limit: float | None) -> RunComputer:
    written = (folder / STUDY_NAME).stat()
    key = folder, scripts, limit, written.st_ino, written.st_mtime_ns
    if getattr(_kept, "key", None) != key:
        opened = resume_study(folder, scripts)
        _kept.computer, _kept.key = RunComputer(replace(opened, study=replace(opened.study, run_limit=limit))), key
    found: RunComputer = _kept.computer
    return found


def compute_batch(
    indices: Sequence[int] | np.ndarray, folder: str, scripts: str = REFUSE, limit: float | None = None
) -> BatchResult:
    """Compute runs of a study and write them into a part; called by Dask.

    Parameters
    ----------
    indices : sequence or array of int
    folder : str
        Of the study, as this machine sees it.
    scripts : str
        What is done about the Python in a .blend and a job.
    limit : float, optional
        Seconds that a run may take.

    Raises
    ------
    FileError
        Files cannot be written or read.
    PalpateError
        The study cannot be opened.
    """
    place, batch = Path(folder), BatchResult()
    waiting, size, layout = list[RunResult](), 0, ""  # what becomes one part: its runs, their bytes and their layout
    computer = _computer_for(place, scripts, limit)
    for index in np.asarray(indices).tolist():
        result = computer.result(index)
        batch.seconds += result.seconds
        batch.done += not result.message
        if result.message:
            batch.failures.append((index, result.message))
        digest = "" if result.layout is None else result.layout.digest
        if size > PART_BYTES or (layout and digest and digest != layout):
            write_part(place, waiting)
            waiting, size, layout = [], 0, ""
        waiting.append(result)
        size, layout = size + sum(column.nbytes for column in result.columns.values()), layout or digest
    write_part(place, waiting)
    return batch
