# SPDX-License-Identifier: GPL-3.0-or-later
"""The same source without numba: run in a process of its own, its numbers compared with the compiled ones."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from solver_scenes import about, cube_on_pad, pad, pressed, shape

from oracles.balance import STIFF, collision, tumbling
from palpate.core.model.scenario import Scenario
from palpate.core.solver.simulation import Simulation, run

KEYS = ("normal_force", "shear", "depth", "slip", "net_force", "net_torque", "centre_of_pressure")


def scenes() -> dict[str, Scenario]:
    """Small scenes that pass through all of the solver: sticking, sliding, tumbling, two free bodies, many faces."""
    ball = shape(trimesh.creation.icosphere(2, 0.012))
    path = [[0.0008 * i - 0.003, 0.0004 * i, 0.0112 - 0.0001 * i] for i in range(4)]
    turns = [about((1, 2, 0), 7.0 * i) for i in range(4)]
    thrown = tumbling(3)
    return {
        "slope": cube_on_pad(1.0, tilt=5.0, texels=pad(5, 4, 0.01), frames=4, dt=1e-3, sigma0=500.0),
        "ball": pressed(ball, path, texels=pad(6, 6), turns=turns, dt=4e-3, **STIFF),
        "thrown": replace(thrown, sensors=(replace(thrown.sensors[0], texels=pad(5, 5, 0.012)),)),
        "collision": replace(collision(0, dt=1e-3), frame_end=20),
    }


def numbers(scenario: Scenario) -> np.ndarray:
    """All that a run says, behind one another."""
    recording = run(scenario)
    felt = [getattr(sensor, key).ravel() for sensor in recording.sensors.values() for key in KEYS]
    return np.concatenate([recording.poses.ravel(), recording.velocities.ravel(), *felt])


def step_time(steps: int = 40) -> float:
    """Seconds that a step takes with 84 texels in contact."""
    simulation = Simulation(replace(cube_on_pad(1.0, dt=1e-3, gap=-1e-4), fps=1e3))
    simulation.advance()
    start = time.perf_counter()
    for _ in range(steps):
        simulation.advance()
    return (time.perf_counter() - start) / steps


def without_numba(missing: str = "") -> tuple[dict[str, np.ndarray], float]:
    """Numbers of all scenes, and seconds per step on a small pad, in plain Python.

    Compilation is switched off, or, if it is given, a module of numba is `missing`.
    """
    folder = Path(__file__).resolve().parents[1]
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "plain.npz"
        hide = f"sys.modules[{missing!r}] = None; " if missing else ""
        code = f"import sys; {hide}sys.path.insert(0, {str(folder)!r}); from oracles import plain; plain.write({str(path)!r})"
        environment = {**os.environ, "PALPATE_NUMBA": "1" if missing else "0"}
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
        if done.returncode != 0:
            raise RuntimeError(done.stderr)
        with np.load(path) as file:
            found = dict(file)
    return found, float(found.pop("step_time"))


def write(path: str) -> None:
    """What the other process does."""
    from palpate.core.compiled import kernels

    if kernels.COMPILED:
        raise RuntimeError("this was to run without numba")
    np.savez(path, step_time=step_time(), **{name: numbers(scene) for name, scene in scenes().items()})


def differences() -> tuple[dict[str, float], float]:
    """Largest difference of any number by scene, and seconds per step in plain Python."""
    plain, seconds = without_numba()
    return {name: float(np.abs(plain[name] - numbers(scene)).max()) for name, scene in scenes().items()}, seconds
