# SPDX-License-Identifier: GPL-3.0-or-later
"""Thousands of sensors on a GPU: milliseconds of a step of all environments, beside MuJoCo Warp in the same process.

The objects and their motion are those of the group ``loop``. A graph of some steps is replayed; each step begins by copying the
poses of all environments on the device, as a plug-in does. MuJoCo Warp steps a body of 1 kg at rest on the pad, with its
`tactile` sensor and without; it computes the body's dynamics too, and it works in float32. Times are the medians of rounds.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from palpate.core.simulators.warp.warp_sensors import WarpSensors

from . import loop, solver

ENVIRONMENTS, STEPS, ROUNDS = 4096, 10, 21
MANY = (1, 256, 1024, 16384, 65536)
"""Other numbers of environments, for the box."""
FINE = {"box": 4096, "cube": 1024}
"""Environments of a sensor with 1,024 texels."""
WEIGHT = 9.81
"""Newtons, of the steps under a load."""
GOALS = {"box.4096": 0.10, "box.65536": 1.2, "ball.4096": 0.25, "load": 1.5}
"""Milliseconds of a step in float64."""


def pressed(name: str, environments: int, device: str, texels: int = 84, single: bool = False) -> WarpSensors:
    """Return sensors that are pressed by an object of the group ``loop``."""
    return WarpSensors(loop.item(texels), loop.objects()[name][0], loop.DT, environments, device, single)


def stepping(name: str, sensors: WarpSensors, loads: Any = None) -> Callable[[], None]:
    """Return a function that takes some steps, with all poses on the device beforehand."""
    import warp

    (_, height, turn), e = loop.objects()[name], len(sensors)
    phases, poses = np.random.default_rng(1).random(e) * 2 * np.pi, np.zeros((e, 2, 7))
    poses[:, 0, 3:], poses[:, 1, 3:], path = loop.LEVEL, turn, []
    for step in range(STEPS):
        poses[:, 1, :3] = loop.positions(height, phases + step * 2 * np.pi / loop.STEPS)
        path.append(warp.array(poses, dtype=sensors.poses.dtype, device=sensors.device))

    def steps() -> None:
        for now in path:
            warp.copy(sensors.poses, now)
            sensors.step(wrench=loads)

    return steps


def milliseconds(device: str, steps: Callable[[], None]) -> float:
    """Return the time of one of the steps of a function, which are captured as a graph."""
    import warp

    steps()
    with warp.ScopedCapture(device) as capture:
        steps()
    begin, end = (warp.Event(device, enable_timing=True) for _ in range(2))
    times = []
    for _ in range(ROUNDS):
        warp.record_event(begin)
        warp.capture_launch(capture.graph)
        warp.record_event(end)
        times.append(warp.get_event_elapsed_time(begin, end) / STEPS)
    return statistics.median(times)


def kernel_times(device: str, steps: Callable[[], None]) -> dict[str, float]:
    """Return the microseconds of each kernel of a step, by name."""
    import warp

    warp.timing_begin(cuda_filter=warp.TIMING_KERNEL)
    steps()
    found: dict[str, list[float]] = {}
    for one in warp.timing_end():
        found.setdefault(one.name.split()[-1].rpartition("_")[0], []).append(1e3 * one.elapsed)
    return {name: statistics.median(times) for name, times in found.items()}


def under_load(device: str) -> float:
    """Return the time of a step under a load that swings by a tenth; the residual is asserted."""
    import warp

    sensors, loads = pressed("box", ENVIRONMENTS, device), np.zeros((STEPS, ENVIRONMENTS, 6))
    loads[:, :, 2] = WEIGHT + np.sin(np.linspace(0.0, 2 * np.pi, STEPS, endpoint=False))[:, None]
    given = [warp.array(one, dtype=warp.float64, device=device) for one in loads]
    at = np.tile([0.0, 0.0, loop.objects()["box"][1], *loop.LEVEL], (ENVIRONMENTS, 1))
    sensors.step(np.tile([0.0, 0.0, 0.0, *loop.LEVEL], (ENVIRONMENTS, 1)), at)

    def steps() -> None:
        for load in given:
            sensors.step(wrench=load)

    found = milliseconds(device, steps)
    assert np.abs(sensors.residual.numpy()).max() < 1e-6 * WEIGHT
    return found


def mujoco_warp_step(shape: str, tactile: bool) -> Callable[[], None]:
    """Return a function that takes some steps of MuJoCo Warp: a body of 1 kg on the pad of 84 texels."""
    import mujoco
    import mujoco_warp

    half = solver.CUBE / 2
    geom, height = (f'type="box" size="{half} {half} {half}"', half)
    if shape == "sphere":
        geom, height = f'type="sphere" size="{solver.BALL}"', solver.BALL
    body = f'<body pos="0 0 {height}"><freejoint/><geom {geom} mass="1"/></body>'
    model = solver.mujoco_pad(84, body, tactile=tactile)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    on_device = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data, nworld=ENVIRONMENTS)

    def steps() -> None:
        for _ in range(STEPS):
            mujoco_warp.step(*on_device)

    return steps


def largest(device: str) -> tuple[float, int]:
    """Return the bytes of an environment of the box, and how many fit into the free memory, in which they take steps."""
    import warp

    few = pressed("box", 1, device).bytes_per_environment
    count = int(0.9 * warp.get_device(device).free_memory / few)
    many = pressed("box", count, device)
    many.step()
    warp.synchronize_device(device)
    return few, count


def run() -> Iterator[dict]:
    """Steps of all objects, in both precisions; of other numbers of environments; under loads; and of MuJoCo Warp."""
    import warp

    warp.config.quiet = True  # its messages would stand between the figures
    gpu = next((one for one in warp.get_devices() if one.is_cuda), None)
    if gpu is None:
        print("Warp finds no GPU on this machine, so that the group 'gpu' measures nothing.", file=sys.stderr)
        return
    device = str(gpu)
    print(f"{gpu.name}, Warp {warp.__version__}", file=sys.stderr)
    peers = {}
    try:
        from mujoco_warp import __version__ as version
    except ImportError:
        print("MuJoCo Warp is not installed: its steps are not measured.", file=sys.stderr)
    else:
        peers = {
            (shape, tactile): milliseconds(device, mujoco_warp_step(shape, tactile))
            for shape in ("box", "sphere") for tactile in (True, False)
        }  # fmt: skip
        for (shape, tactile), value in peers.items():
            yield {"name": f"gpu.mujoco_warp.{shape}.{'tactile' if tactile else 'alone'}", "value": value, "unit": "ms"}

    def figure(key: str, value: float) -> dict:
        found: dict[str, Any] = {"name": f"gpu.{key}", "value": value, "unit": "ms"}
        peer = peers.get((key.split(".")[1], True)) if key.endswith(f"{ENVIRONMENTS}.float64") else None
        if peer:
            found |= {"peer": f"mujoco-warp-{version} whole step", "peer_value": peer, "ratio": value / peer}
        goal = GOALS.get(key.removeprefix("step.").removesuffix(".float64"))
        return found | ({"goal": goal / peer if peer else goal} if goal else {})

    for single in (False, True):
        kind = "float32" if single else "float64"
        for name in loop.objects():
            steps = stepping(name, pressed(name, ENVIRONMENTS, device, single=single))
            yield figure(f"step.{name}.{ENVIRONMENTS}.{kind}", milliseconds(device, steps))
            if name in ("box", "ball"):
                for kernel, value in kernel_times(device, steps).items():
                    yield {"name": f"gpu.kernel.{kernel}.{name}.{kind}", "value": value, "unit": "us"}
    for count in MANY:
        yield figure(f"step.box.{count}.float64", milliseconds(device, stepping("box", pressed("box", count, device))))
    for name, count in FINE.items():
        steps = stepping(name, pressed(name, count, device, 1024))
        yield figure(f"texels.{name}.{count}.float64", milliseconds(device, steps))
    yield figure("load", under_load(device))
    per_environment, count = largest(device)
    yield {"name": "gpu.memory", "value": per_environment, "unit": "bytes per environment"}
    yield {"name": "gpu.largest", "value": count, "unit": "environments"}
