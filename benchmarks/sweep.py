# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies: what a core gives to runs beside the bare solver, the same presses with MuJoCo, and what a dataset costs.

A share of 1 would mean that reading values, making scenarios, metrics and files cost nothing beside the solver. Both sides are
measured in turn in one process: seconds of the processor tell what is computed, seconds of the clock also what waits for the
disk. MuJoCo presses the same ball on as many texels by `mujoco.rollout`. The two do not do the same:

* both take ten steps of 1 ms to a frame;
* MuJoCo solves for the ball on its actuator, with one contact between ball and pad, and its sensor looks up a depth and a
  sliding velocity per texel; all steps stay in memory and no file is written;
* ours has a prescribed motion. Each step finds every texel's contact and its LuGre friction, which remembers; each frame has
  forces, friction, slip, reading, wrench and centre of pressure. With ``.solving`` this stays in memory, otherwise it is
  varied, summed up in metrics, encoded and written.

MuJoCo's static error is that of the benchmark `solver`, of a cube on the pad.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from solver_scenes import shape

from palpate.core.compiled.thread_team import count_of_cores
from palpate.core.geometry.texels import texels_from_region
from palpate.core.io.scenario_npz import save_scenario
from palpate.core.model.body import Body
from palpate.core.model.motion import Motion
from palpate.core.model.scenario import Scenario
from palpate.core.model.sensor import Sensor
from palpate.core.model.sensor_parameters import SensorParameters
from palpate.core.model.target import Target
from palpate.core.solver.simulation import Simulation
from palpate.core.study import run_files
from palpate.core.study.design import points_of
from palpate.core.study.metrics import metrics_of
from palpate.core.study.run_files import SCENES, STUDY_NAME, make_folders, run_batch
from palpate.core.study.run_record import RunRecord
from palpate.core.study.study_file import Run, plan_for, read_study
from palpate.core.study.variation import varied_scenario
from palpate.sweep.child import Scenes, compute_run, pack_frames

from .solver import GRIDS, SLOPE, mujoco_weighing, pad, palpate_weighing
from .solver import cube as weighed_cube

TEXELS = 84
RADIUS = 0.006
"""Of the ball, m."""
FPS = 100.0
DEPTH = 1e-3
"""Deepest press, m."""
RUNS, ROUNDS = 40, 5
SPEED = 0.1
"""Of the approach, m/s: short runs are mostly contact then."""
LENGTHS = {"50_ms": 0.02, "500_ms": 0.47}
"""Rest after the press, s, by the length of a run."""
STUDIES = {"presses": (0.55, TEXELS, 10_000), "long": (19.9, 1024, 100)}
"""Whole studies: rest after the press, s, texels, and runs; of 60 frames, and of 2,000."""
COMPARED = {84: (0.47, 40), 1024: (4.9, 4)}
"""Presses with MuJoCo, by their texels: rest after the press, s, and runs of a round."""
DATASET_RUNS = 300
"""Enough that what a dataset has once, as its statistics, is small beside its frames."""
STIFFNESS = 1000.0
"""Of a texel, N/m."""
STEP = 1e-3
"""MuJoCo's usual step, s."""


def scene(texels_wanted: int = TEXELS) -> Scenario:
    """Return a ball over a pad."""
    sheet = pad(*GRIDS[texels_wanted])
    texels = texels_from_region(sheet, np.ones(len(sheet.vertices), bool))
    return Scenario(
        bodies=(Body("pad", Motion.at_rest()), Body("ball", Motion.at_rest((0.0, 0.0, 0.05)))),
        sensors=(Sensor("pad", 0, texels, SensorParameters(k=STIFFNESS, cn=0.01 * STIFFNESS)),),
        targets=(Target("ball", 1, shape(trimesh.creation.icosphere(3, RADIUS))),),
        frame_start=1,
        frame_end=2,
        fps=FPS,
        name="pad",
    )


def begun(folder: Path, hold: float, count: int, texels: int = TEXELS) -> list[Run]:
    """Make the folder of a study of presses and return its runs."""
    make_folders(folder)
    save_scenario(folder / SCENES / "pad.npz", scene(texels))
    (folder / STUDY_NAME).write_text(
        f'format = "palpate-sweep/1"\nscene = "pad.npz"\ndesign = "random"\nsamples = {count}\nfps = {FPS}\n'
        f"[press]\ndepth = {{ uniform = [{DEPTH / 2}, {DEPTH}] }}\nspeed = {SPEED}\nhold = {hold}\n",
        encoding="utf-8",
    )
    study = read_study(folder / STUDY_NAME)
    points = points_of(study.design, plan_for(study, scene()).varied)
    return [Run(i, "pad", values, f"{i:024x}") for i, values in enumerate(points)]


def computed(scenes: Scenes, runs: Sequence[Run]) -> None:
    """Compute runs as a batch."""
    with run_batch(scenes.folder) as batch:
        for run in runs:
            compute_run(scenes, run, batch.place)
            batch.add(run.digest)


def in_turn(*works: Callable[[int], float]) -> list[tuple[float, float]]:
    """Return the medians of the seconds of the processor and of the clock for each simulated second; works are done in turn.

    A work gets the number of the round and returns how much it has simulated, s.
    """
    taken: list[list[tuple[float, float]]] = [[] for _ in works]
    for number in range(ROUNDS):
        for own, work in zip(taken, works, strict=True):
            processor, clock = time.process_time(), time.perf_counter()
            simulated = work(number)
            own.append(((time.process_time() - processor) / simulated, (time.perf_counter() - clock) / simulated))
    return [(statistics.median(p for p, _ in own), statistics.median(c for _, c in own)) for own in taken]


def shares(name: str, hold: float) -> Iterator[dict]:
    """Simulated seconds of runs per second and core, against those of the bare solver."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        runs = begun(folder, hold, RUNS * ROUNDS)
        scenes = Scenes(folder)
        plan = scenes.plan("pad")
        scenarios = [varied_scenario(plan.scenario, {**plan.fixed, **run.values}, plan.press) for run in runs]
        lengths = [(one.frame_end - one.frame_start) / one.fps for one in scenarios]
        computed(scenes, [replace(runs[0], digest="f" * 24)])  # loads what was compiled

        def bare(number: int) -> float:
            part = slice(number * RUNS, (number + 1) * RUNS)
            for scenario in scenarios[part]:
                Simulation(scenario, threads=1).advance_all()
            return sum(lengths[part])

        def whole(number: int) -> float:
            part = slice(number * RUNS, (number + 1) * RUNS)
            computed(scenes, runs[part])
            return sum(lengths[part])

        solver, sweep = in_turn(bare, whole)
    for kind, theirs, ours in zip(("processor", "clock"), solver, sweep, strict=True):
        yield {
            "name": f"sweep.share.{name}.{kind}", "value": 1.0 / ours, "unit": "simulated s/s",
            "peer": "the bare solver", "peer_value": 1.0 / theirs, "ratio": theirs / ours, "goal": 0.9,
        }  # fmt: skip


def solve_bare(folder: Path, runs: Sequence[Run]) -> tuple[float, float, float]:
    """Solve runs without a study; return seconds of the clock and of the processor, and simulated seconds."""
    scenes = Scenes(folder)
    plan = scenes.plan("pad")
    scenarios = [varied_scenario(plan.scenario, {**plan.fixed, **run.values}, plan.press) for run in runs]
    clock, processor = time.perf_counter(), time.process_time()
    for scenario in scenarios:
        Simulation(scenario, threads=1).advance_all()
    taken = time.perf_counter() - clock, time.process_time() - processor
    return *taken, sum((one.frame_end - one.frame_start) / one.fps for one in scenarios)


def processor_seconds() -> float:
    """Return the seconds of the processor that this process and those that it has started have taken."""
    import psutil

    own = psutil.Process()
    times = [one.cpu_times() for one in (own, *own.children(recursive=True))]
    return sum(time.user + time.system for time in times)


def whole_study(name: str, hold: float, texels: int, count: int) -> Iterator[dict]:
    """A study on two cores, from the first task to the last, against two processes that solve the same runs; in turn."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    from palpate.sweep.dataset import publish
    from palpate.sweep.driver import dask_client, run_study
    from palpate.sweep.worker import Limits

    clocks, processors, each = [], [], count // ROUNDS
    with (
        tempfile.TemporaryDirectory() as place,
        ProcessPoolExecutor(2, get_context("spawn")) as pool,
        dask_client(None, 2) as client,
    ):
        folder = Path(place)
        runs = begun(folder, hold, count, texels)
        first = [replace(runs[0], index=count + i, digest=f"{i:x}" * 24) for i in range(12, 16)]
        list(pool.map(solve_bare, [folder] * 2, [runs[:1]] * 2))  # both load what was compiled
        run_study(client, folder, first, Limits(), lambda tally: None)
        for number in range(ROUNDS):
            part = runs[number * each : (number + 1) * each]
            clock, processor, _ = zip(*pool.map(solve_bare, [folder] * 2, [part[::2], part[1::2]]), strict=True)
            began, before = time.perf_counter(), processor_seconds()
            run_study(client, folder, part, Limits(), lambda tally: None)
            clocks.append((max(clock), time.perf_counter() - began))
            processors.append((sum(processor), processor_seconds() - before))
        began = time.perf_counter()
        publish(folder, runs)
        closing = time.perf_counter() - began
        lengths = solve_bare(folder, runs[:1])[2] * each  # they differ by a hundredth
    for kind, found, goal in (("clock", clocks, 0.85), ("processor", processors, 0.9)):
        bare, ours = (statistics.median(one) for one in zip(*found, strict=True))
        yield {
            "name": f"sweep.two_cores.{name}.{kind}", "value": lengths / ours, "unit": "simulated s/s",
            "peer": "the bare solver in two processes", "peer_value": lengths / bare,
            "ratio": statistics.median(theirs / mine for theirs, mine in found), "goal": goal,
        }  # fmt: skip
    share = closing / (closing + sum(mine for _, mine in clocks))
    yield {
        "name": f"sweep.two_cores.{name}.dataset", "value": share, "unit": "of the clock",
        "peer": "a tenth", "peer_value": 0.1, "ratio": share / 0.1, "goal": 1.0,
    }  # fmt: skip


def parts() -> Iterator[dict]:
    """What a short run takes of the processor, by item; its files are in memory, where there is a folder for that."""
    memory = Path("/dev/shm")
    taken: dict[str, list[float]] = {name: [] for name in ("values", "arrays", "steps", "metrics", "frames")}
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as place:
        folder = Path(place)
        runs = begun(folder, LENGTHS["50_ms"], RUNS * ROUNDS)
        scenes = Scenes(folder)
        plan = scenes.plan("pad")
        computed(scenes, [replace(runs[0], digest="f" * 24)])  # loads what was compiled
        for run in runs:
            moments = [time.process_time()]
            scenario = scenes.scenario("pad", {**plan.fixed, **run.values})
            moments.append(time.process_time())
            simulation = Simulation(scenario, threads=1, shared=scenes.shared)
            moments.append(time.process_time())
            recording = simulation.advance_all(with_digest=False)
            del simulation  # the next one takes its arrays over
            moments.append(time.process_time())
            metrics = metrics_of(scenario, recording, plan.press)
            moments.append(time.process_time())
            numbers = RunRecord(folder, run.digest, run.index, dict(run.values), metrics, 0.0, tuple(recording.sensors))
            pack_frames(scenes, folder / run_files.RUNS, run, scenario, recording, numbers)
            moments.append(time.process_time())
            for own, seconds in zip(taken.values(), np.diff(moments), strict=True):
                own.append(float(seconds))
    for name, own in taken.items():
        yield {"name": f"sweep.part.{name}", "value": statistics.median(own) * 1e3, "unit": "CPU ms per run of 50 ms"}


def mujoco_press(seconds: float, texels: int):
    """Return MuJoCo's model of the press: a ball on an actuator over the pad, and its controls, (1, steps, 1)."""
    import mujoco

    rows, columns = GRIDS[texels]
    pitch = 0.047 / (max(rows, columns) - 1)
    half_x, half_y = (columns - 1) * pitch / 2, (rows - 1) * pitch / 2
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{STEP}" gravity="0 0 0"/>
        <asset><mesh name="pad" builtin="plate" params="{columns} {rows}" scale="{half_x} {half_y} 0.001"/>
        <mesh name="ball" builtin="sphere" params="3" scale="{RADIUS} {RADIUS} {RADIUS}"/></asset>
        <worldbody><body><geom name="pad" type="mesh" mesh="pad" quat="0 1 0 0" contype="0" conaffinity="0"/>
        <geom type="box" size="{half_x} {half_y} 0.005" pos="0 0 -0.005"/></body>
        <body pos="0 0 {RADIUS + 5e-4}"><joint name="down" type="slide" axis="0 0 -1" damping="5"/>
        <geom type="sphere" size="{RADIUS}" mass="0.1"/>
        <geom type="sdf" mesh="ball" contype="0" conaffinity="0" mass="0"/></body></worldbody>
        <actuator><position joint="down" kp="2000"/></actuator>
        <sensor><tactile geom="pad" mesh="pad"/></sensor></mujoco>"""
    )
    if model.nsensordata != 3 * texels:
        raise RuntimeError(f"MuJoCo has {model.nsensordata // 3} texels instead of {texels}")
    times = np.arange(1, round(seconds / STEP) + 1) * STEP
    way = DEPTH + 5e-4
    approach = way / SPEED
    target = np.interp(times, [0.0, approach, seconds - approach, seconds], [0.0, way, way, 0.0])
    return model, target.reshape(1, -1, 1)


def against_mujoco(texels: int, hold: float, count: int) -> Iterator[dict]:
    """Taxel-frames per second and core, by as many threads as there are cores: runs of a study, and solving them alone."""
    import mujoco
    import mujoco.rollout

    cores = count_of_cores()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        runs = begun(folder, hold, count * ROUNDS, texels)
        scenes = Scenes(folder)
        plan = scenes.plan("pad")
        computed(scenes, [replace(runs[0], digest="f" * 24)])
        scenarios = [varied_scenario(plan.scenario, {**plan.fixed, **run.values}, plan.press) for run in runs]
        last = [scenario.frame_end for scenario in scenarios]
        model, controls = mujoco_press((float(np.mean(last)) - 1) / FPS, texels)
        data = [mujoco.MjData(model) for _ in range(cores)]
        state = np.zeros((1, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
        mujoco.mj_getState(model, data[0], state[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
        felt = 0.0

        def ours(number: int) -> float:
            computed(scenes, runs[number * count : (number + 1) * count])
            return float(sum(last[number * count : (number + 1) * count])) * texels

        def solving(number: int) -> float:
            for scenario in scenarios[number * count : (number + 1) * count]:
                Simulation(scenario, threads=1, shared=scenes.shared).advance_all()
            return float(sum(last[number * count : (number + 1) * count])) * texels

        def theirs(_number: int) -> float:
            nonlocal felt
            _, sensed = mujoco.rollout.rollout(model, data, np.tile(state, (count, 1)), np.tile(controls, (count, 1, 1)))
            felt = max(felt, float(np.abs(sensed).max()))
            return count * controls.shape[1] * STEP * FPS * texels  # of its steps, those at frames

        (own, _), (alone, _), (other, _) = in_turn(ours, solving, theirs)  # seconds of the processor, of all threads
    if felt <= 0.0:
        raise RuntimeError("MuJoCo's ball does not touch its pad: this would not be the same work")
    for name, mine in (("", own), (".solving", alone)):
        yield {
            "name": f"sweep.taxel_frames.{texels}{name}", "value": 1.0 / mine, "unit": "taxel-frames/(s·core)",
            "peer": f"mujoco-{mujoco.__version__} tactile by rollout, {cores} threads", "peer_value": 1.0 / other,
            "ratio": mine / other, "goal": 0.5,
        }  # fmt: skip


def static_errors() -> Iterator[dict]:
    """The static error of ours and of MuJoCo's."""
    import mujoco

    solid = weighed_cube(2)
    error = max(palpate_weighing(TEXELS, solid, slope, STEP)[1] for slope in (0.0, SLOPE))
    their_error = max(mujoco_weighing(TEXELS, solid, slope)[1] for slope in (0.0, SLOPE))
    peer = f"mujoco-{mujoco.__version__} tactile"
    yield {"name": f"sweep.static_error.{TEXELS}", "value": error, "unit": "1", "peer": peer, "peer_value": their_error}


def compressed_size(folder: Path, runs: list[Run]) -> int:
    """Return the bytes of all frames of a study, an array for each quantity, in one compressed .npz file."""
    import io

    from palpate.sweep.finished_runs import StoredRuns

    stored = StoredRuns(folder)
    frames = [stored.run(run.digest)[1] for run in runs]
    columns = {item.name: np.concatenate([one.decoded(item) for one in frames]) for item in frames[0].layout.frame_features}
    with io.BytesIO() as packed:
        np.savez_compressed(packed, **columns)
        return len(packed.getvalue())


def dataset_share() -> Iterator[dict]:
    """What writing the dataset and the table costs of the whole time, and its size by that of the numbers, compressed."""
    from palpate.sweep.dataset import publish

    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        runs = begun(folder, 0.97, DATASET_RUNS)
        scenes = Scenes(folder)
        computed(scenes, [replace(runs[0], index=DATASET_RUNS, digest="f" * 24)])
        start = time.process_time()
        computed(scenes, runs)
        computing = time.process_time() - start
        publish(folder, runs)  # loads pyarrow, a second that a study of 10,000 runs does not notice
        start = time.process_time()
        publish(folder, runs)
        writing = time.process_time() - start
        size = sum(file.stat().st_size for file in (folder / "dataset").rglob("*") if file.is_file())
        raw = compressed_size(folder, runs)
    yield {
        "name": "sweep.dataset.share", "value": writing / (writing + computing), "unit": "1",
        "peer": "a tenth", "peer_value": 0.1, "ratio": writing / (writing + computing) / 0.1, "goal": 1.0,
    }  # fmt: skip
    yield {
        "name": "sweep.dataset.size", "value": size / DATASET_RUNS, "unit": "bytes per run",
        "peer": "the same numbers in 32 bits, in one compressed archive", "peer_value": raw / DATASET_RUNS,
        "ratio": size / raw, "goal": 1.2,
    }  # fmt: skip


def run() -> Iterator[dict]:
    """Shares of short and of longer runs, whole studies, parts of a run, the same presses with MuJoCo, and the dataset."""
    for name, hold in LENGTHS.items():
        yield from shares(name, hold)
    for name, (hold, texels, count) in STUDIES.items():
        yield from whole_study(name, hold, texels, count)
    yield from parts()
    for texels, (hold, count) in COMPARED.items():
        yield from against_mujoco(texels, hold, count)
    yield from static_errors()
    yield from dataset_share()
