# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies: what a core gives to runs beside the bare solver, the same presses with MuJoCo, and what large studies take.

A share of 1 would mean that reading values, making scenarios, metrics and files cost nothing beside the solver. Both sides are
measured in turn in one process, by seconds of the processor. MuJoCo presses the same ball on as many texels by
`mujoco.rollout`. The two do not do the same:

* both take ten steps of 1 ms to a frame;
* MuJoCo solves for the ball on its actuator, with one contact between ball and pad, and its sensor looks up a depth and a
  sliding velocity per texel; all steps stay in memory and no file is written;
* ours has a prescribed motion. Each step finds every texel's contact and its LuGre friction, which remembers; each frame has
  forces, friction, slip, reading, wrench and centre of pressure. It is varied, summed up in metrics, and written.
"""

from __future__ import annotations

import gc
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from solver_scenes import shape

from palpate.core.compiled.thread_team import count_of_cores
from palpate.core.io.scenario_npz import save_scenario
from palpate.core.model.body import Body, Motion
from palpate.core.model.scenario import Scenario, Target
from palpate.core.solver.simulation import Simulation
from palpate.core.study.variation import varied_scenario
from palpate.sweep.dataset import publish
from palpate.sweep.report import write_report
from palpate.sweep.study_folder import OpenStudy, open_study
from palpate.sweep.worker import compute_batch

from . import beside
from .solver import mujoco_pad, sensor_of

RADIUS = 0.006
"""Of the ball, m."""
FPS = 100.0
DEPTH = 1e-3
"""Deepest press, m."""
SPEED = 0.1
"""Of the approach, m/s: short runs are mostly contact then."""
STUDIES = {"presses": (0.55, 84, 200), "long": (19.9, 1024, 5)}
"""Rest after the press, s, texels, and runs of a round; of 60 frames, and of 2,000."""
ROUNDS = 5
STIFFNESS = 1000.0
"""Of a texel, N/m."""
FEW, MANY = 1_000, int(os.environ.get("PALPATE_BENCH_RUNS", "20000"))
"""Runs of the studies whose memory is compared."""


def scene(texels: int) -> Scenario:
    """Return a ball over a pad."""
    return Scenario(
        bodies=(Body("pad", Motion.at_rest()), Body("ball", Motion.at_rest((0.0, 0.0, 0.05)))),
        sensors=(sensor_of(texels, STIFFNESS)[0],),
        targets=(Target("ball", 1, shape(trimesh.creation.icosphere(3, RADIUS))),),
        frame_start=1,
        frame_end=2,
        fps=FPS,
        name="pad",
    )


def begun(folder: Path, hold: float, texels: int, count: int) -> OpenStudy:
    """Begin a study of presses."""
    save_scenario(folder / "pad.npz", scene(texels))
    (folder / "study.toml").write_text(
        f'format = "palpate-sweep/1"\nscene = "pad.npz"\ndesign = "random"\nsamples = {count}\nfps = {FPS}\n'
        f"[press]\ndepth = {{ uniform = [{DEPTH / 2}, {DEPTH}] }}\nspeed = {SPEED}\nhold = {hold}\n",
        encoding="utf-8",
    )
    return open_study(folder / "study.toml", folder / "out")


def in_turn(*works: Callable[[range], object], count: int) -> list[float]:
    """Return the medians of the processor's seconds for each run; works are done in turn and get the indices of runs."""
    taken: list[list[float]] = [[] for _ in works]
    for number in range(ROUNDS):
        for own, work in zip(taken, works, strict=True):
            began = time.process_time()
            work(range(number * count, (number + 1) * count))
            own.append((time.process_time() - began) / count)
    return [statistics.median(own) for own in taken]


def shares(name: str, hold: float, texels: int, count: int) -> Iterator[dict]:
    """Runs per second of a core: the bare solver, the whole of a batch, and its dataset; and MuJoCo's."""
    with tempfile.TemporaryDirectory() as place:
        opened = begun(Path(place), hold, texels, count * ROUNDS)
        plan, folder = opened.plans["pad"], str(opened.folder)
        scenarios = [varied_scenario(plan.scenario, {**plan.fixed, **run.values}, plan.press) for run in opened.runs]
        compute_batch([0], folder)  # loads what was compiled

        def bare(runs: range) -> None:
            for index in runs:
                Simulation(scenarios[index], threads=1).advance_all()

        works: list[Callable[[range], object]] = [bare, lambda runs: compute_batch(runs, folder)]
        if texels == 84:  # of 1,024 it takes minutes
            rollout, version = mujoco_rollout((scenarios[0].frame_end - 1) / FPS, texels)
            works.append(rollout)
        solver, ours, *theirs = in_turn(*works, count=count)
        publish(opened.folder, opened.study)  # loads pyarrow, a second that a study of 10,000 runs does not notice
        began = time.process_time()
        publish(opened.folder, opened.study)
        closing = (time.process_time() - began) / (count * ROUNDS)
        size = sum(path.stat().st_size for path in (opened.folder / "dataset").rglob("*") if path.is_file())
    yield beside(f"sweep.{name}", 1.0 / ours, "runs/(s·core)", "the bare solver", 1.0 / solver, 0.5)
    for other in theirs:
        peer = f"mujoco-{version} tactile by rollout"
        yield beside(f"sweep.{name}.mujoco", 1.0 / ours, "runs/(s·core)", peer, 1.0 / other)
    yield {"name": f"sweep.{name}.dataset", "value": closing * 1e3, "unit": "CPU ms per run"}
    yield {"name": f"sweep.{name}.size", "value": size / (count * ROUNDS), "unit": "bytes per run"}


def mujoco_rollout(seconds: float, texels: int) -> tuple[Callable[[range], None], str]:
    """Return MuJoCo's presses of so many seconds, a ball on an actuator over the pad, by all cores; and its version."""
    import mujoco
    import mujoco.rollout

    body = f"""<body pos="0 0 {RADIUS + 5e-4}"><joint name="down" type="slide" axis="0 0 -1" damping="5"/>
        <geom type="sphere" size="{RADIUS}" mass="0.1"/>
        <geom type="sdf" mesh="ball" contype="0" conaffinity="0" mass="0"/></body>"""
    ball = f'<mesh name="ball" builtin="sphere" params="3" scale="{RADIUS} {RADIUS} {RADIUS}"/>'
    motor = '<actuator><position joint="down" kp="2000"/></actuator>'
    model = mujoco_pad(texels, body, ball, 'gravity="0 0 0"', motor)
    step = model.opt.timestep
    times = np.arange(1, round(seconds / step) + 1) * step
    way = DEPTH + 5e-4
    target = np.interp(times, [0.0, way / SPEED, seconds - way / SPEED, seconds], [0.0, way, way, 0.0]).reshape(1, -1, 1)
    data = [mujoco.MjData(model) for _ in range(count_of_cores())]
    state = np.zeros((1, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    mujoco.mj_getState(model, data[0], state[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)

    def press(runs: range) -> None:
        states, controls = np.tile(state, (len(runs), 1)), np.tile(target, (len(runs), 1, 1))
        _, sensed = mujoco.rollout.rollout(model, data, states, controls)
        if not np.abs(sensed).max() > 0.0:
            raise RuntimeError("MuJoCo's ball does not touch its pad: this would not be the same work")

    return press, mujoco.__version__


MEASURED = """
import sys
from pathlib import Path
from palpate.benchmarks import sweep
sweep.print_memory(Path(sys.argv[1]), int(sys.argv[2]))
"""


def print_memory(folder: Path, count: int) -> None:
    """Compute a study of short presses in this process and publish it; print the largest memory and the seconds of each."""
    opened = begun(folder, 0.0, 84, count)
    began = time.process_time()
    for at in range(0, count, 500):
        compute_batch(range(at, min(at + 500, count)), str(opened.folder))
    computed, computing = peak(), time.process_time() - began
    gc.collect()
    began = time.process_time()
    publish(opened.folder, opened.study)
    published, publishing = peak(), time.process_time() - began
    began = time.process_time()
    write_report(opened.folder, opened.study)
    print(computed, computing, published, publishing, peak(), time.process_time() - began)


def peak() -> int:
    """Return the largest memory that this process has held, bytes; Linux."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


def memory() -> Iterator[dict]:
    """The largest memory of a process that computes and publishes few runs and many, and the files that many leave."""
    found: dict[int, list[float]] = {}
    for count in (FEW, MANY):
        with tempfile.TemporaryDirectory() as place:
            done = subprocess.run(
                [sys.executable, "-c", MEASURED, place, str(count)], capture_output=True, text=True, check=True
            )
            found[count] = [float(word) for word in done.stdout.split()]
            files = sum(path.is_file() for path in (Path(place) / "out").rglob("*"))
    for number, name in ((0, "computing"), (2, "publishing"), (4, "report")):
        few, many = (found[count][number] / 1e6 for count in (FEW, MANY))
        yield beside(f"sweep.memory.{name}", many, "MB", f"{FEW} runs", few, 1.05)
        yield {"name": f"sweep.time.{name}", "value": found[MANY][number + 1] / MANY * 1e3, "unit": "CPU ms per run"}
    yield {"name": f"sweep.files.{MANY}_runs", "value": files, "unit": "files", "goal": 0.01 * MANY}


def run() -> Iterator[dict[str, Any]]:
    """Presses and long runs against the bare solver and MuJoCo, and the memory of large studies."""
    for name, (hold, texels, count) in STUDIES.items():
        yield from shares(name, hold, texels, count)
    yield from memory()
