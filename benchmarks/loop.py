# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor in another program's loop: microseconds of a step, calls included, and milliseconds of a step of 4,096 environments.

The object moves to and fro on the pad, a millimetre deep, so that texels slide and neighbour lists are rebuilt. The peer
is a step of MuJoCo with its `tactile` sensor of as many texels, under a cube of 3,072 faces that rests on it; it computes the
cube's dynamics too. Times are those of the threads that compute, the least of several rounds, as other work on the machine
only adds to them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from palpate.core.geometry import shapes
from palpate.core.geometry.mesh import TriangleMesh
from palpate.core.geometry.shapes import Shape
from palpate.core.simulators.pressed_sensor import PressedSensor
from palpate.core.simulators.pressed_sensors import PressedSensors
from palpate.core.simulators.sensor_on_mesh import SensorOnMesh

from . import beside, solver

DT = 1e-3
ENVIRONMENTS, THREADS = 4096, 2
ROUNDS, STEPS = 9, 300
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
GOALS = {84: 25.0, 1024: 150.0}
"""Microseconds of a step."""
BATCH_GOALS = {"cube": 20.0, "ball": 20.0, "box": 4.0, "sphere": 4.0, "capsule": 4.0, "plane": 4.0}
"""Milliseconds of a step of all environments: with meshes, and with shapes in closed form."""


def item(texels: int) -> SensorOnMesh:
    """Return the pad of the solver's benchmark."""
    return SensorOnMesh(*solver.sensor_of(texels))


def objects() -> dict[str, tuple[TriangleMesh | Shape, float, np.ndarray]]:
    """Return the indenter, the height of its origin at first contact, and its orientation.

    A cube that covers all texels and a ball of 5k faces as meshes, and such a box, sphere, capsule and plane in closed form.
    """
    cube, edge, radius = solver.cube(4), solver.CUBE, solver.BALL
    flat = TriangleMesh(np.array(cube.vertices), np.array(cube.faces))
    return {
        "cube": (flat, edge / 2, LEVEL),
        "ball": (solver.ball(20), radius, LEVEL),
        "box": (shapes.box((edge, edge, edge)), edge / 2, LEVEL),
        "sphere": (shapes.sphere(radius), radius, LEVEL),
        "capsule": (shapes.capsule(radius, 2 * radius), radius, np.sqrt([0.5, 0.5, 0.0, 0.0])),
        "plane": (shapes.plane(), 0.0, np.array([0.0, 1.0, 0.0, 0.0])),
    }


def positions(height: float, phases: np.ndarray) -> np.ndarray:
    """Return where the object is (p, 3), pressed in by about a millimetre, at some phases of its motion (p,) rad."""
    return np.stack([5e-4 * np.sin(phases), 3e-4 * np.cos(phases), height - 1e-3 - 2e-4 * np.sin(2 * phases)], axis=1)


def least(measure: Callable[[], float]) -> float:
    """Return the least of several rounds."""
    return min(measure() for _ in range(ROUNDS))


def single_step(texels: int, mesh: TriangleMesh | Shape, height: float, turn: np.ndarray) -> Callable[[], float]:
    """Return a function that gives the microseconds of a step of one sensor."""
    path = positions(height, np.linspace(0.0, 2 * np.pi, STEPS))
    still = np.zeros(3), LEVEL
    pressed = PressedSensor(item(texels), mesh, DT, still, (path[0], turn), 1)
    out = pressed.step(still, (path[0], turn))

    def measure() -> float:
        start = time.thread_time()
        for where in path:
            pressed.step(still, (where, turn), out)
        return (time.thread_time() - start) / STEPS * 1e6

    return measure


def loaded_step(texels: int, mesh: TriangleMesh | Shape, height: float, turn: np.ndarray) -> Callable[[], float]:
    """Return a function that gives the microseconds of a step under a given load, which swings by a tenth."""
    still = np.zeros(3), LEVEL
    top = np.array([0.0, 0.0, height]), turn
    pressed = PressedSensor(item(texels), mesh, DT, still, top, 1)
    loads = np.zeros((STEPS, 6))
    loads[:, 2] = 9.81 + np.sin(np.linspace(0.0, 2 * np.pi, STEPS))
    out = pressed.step(still, top, wrench=loads[0])

    def measure() -> float:
        start = time.thread_time()
        for load in loads:
            pressed.step(still, top, out, load)
        used = (time.thread_time() - start) / STEPS * 1e6
        assert np.abs(pressed.residual).max() < 1e-6 * loads[-1, 2]
        return used

    return measure


def batch_step(mesh: TriangleMesh | Shape, height: float, turn: np.ndarray) -> Callable[[], tuple[float, float]]:
    """Return a function that gives milliseconds of a step of all environments: by the wall, and of processors over threads."""
    many = PressedSensors(item(84), mesh, DT, ENVIRONMENTS, THREADS)
    phases = np.random.default_rng(1).random(ENVIRONMENTS) * 2 * np.pi
    still, poses = np.array([0.0, 0.0, 0.0, *LEVEL]), np.tile([0.0, 0.0, 0.0, *turn], (ENVIRONMENTS, 1))

    def measure() -> tuple[float, float]:
        phases[:] += 2 * np.pi / STEPS
        poses[:, :3] = positions(height, phases)
        wall, used = time.perf_counter(), time.process_time()
        many.step(still, poses)
        return (time.perf_counter() - wall) * 1e3, (time.process_time() - used) / THREADS * 1e3

    return measure


def run() -> Iterator[dict]:
    """Steps of one sensor and of many."""
    import mujoco

    peer = f"mujoco-{mujoco.__version__} tactile"
    for texels, goal in GOALS.items():
        theirs = least(solver.mujoco_step(texels, solver.cube(4)))
        for name, pressing in objects().items():
            ours = least(single_step(texels, *pressing))
            yield beside(f"loop.step.{name}.{texels}", ours, "us", peer, theirs, goal / theirs)
    theirs = least(solver.mujoco_step(84, solver.cube(4)))
    loaded = least(loaded_step(84, *objects()["cube"]))
    yield beside("loop.load.cube.84", loaded, "us", peer, theirs)
    theirs *= ENVIRONMENTS / THREADS / 1e3
    for name, pressing in objects().items():
        measure = batch_step(*pressing)
        measured = np.array([measure() for _ in range(3 * ROUNDS)])
        wall, used = measured.min(axis=0)
        what, goal = f"loop.batch.{name}.{ENVIRONMENTS}x84", BATCH_GOALS[name] / theirs
        yield beside(what, float(used), "ms on two processors", f"{peer}, as many steps", theirs, goal)
        yield {"name": f"{what}.wall", "value": float(wall), "unit": "ms"}
