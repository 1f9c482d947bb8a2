# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors on Warp's processor backend, which has one thread: texel-steps per second, beside the compiled core in the same run.

The contact law alone is the entry into a sphere, the normal law and a step of friction for each texel, translated for Warp and
compiled by numba from one source. The whole step is that of :class:`.WarpSensors`, with a mesh and with a simple shape, beside
one of :class:`.PressedSensors` in one thread. Times are those of the threads that compute, the least of several rounds.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from palpate.core.compiled.kernels import inlined, kernel
from palpate.core.geometry.shapes import box, sphere, sphere_entry
from palpate.core.laws.contact_law import contact_law, read_law
from palpate.core.laws.friction import (
    bristle_step,
    deflection_scale,
    friction_force,
    max_bristle_deflection,
    next_deflection,
)
from palpate.core.laws.normal_force import normal_force
from palpate.core.simulators.pressed_sensors import PressedSensors
from palpate.core.simulators.warp.translation import Translation
from palpate.core.simulators.warp.warp_sensors import WarpSensors

from . import loop, solver

WORLDS, TEXELS, ROUNDS = 1024, 84, 9
LAW_GOAL, MESH_GOAL = 15.0, 3.5
"""Millions of texel-steps per second, of the contact law alone and of steps with mesh queries."""


def law_alone(world: int, texel: int, motion: np.ndarray, law: np.ndarray, bristle: np.ndarray, force: np.ndarray) -> None:
    """Press a texel with a sphere: `motion` has height, rate and sliding velocity of each world, and the step."""
    p, dt, vx, vy = read_law(law, 0), motion[world, 4], motion[world, 2], motion[world, 3]
    depth = 0.006 - sphere_entry((1e-4 * texel, 0.0, -motion[world, 0]), (0.0, 0.0, 1.0), 0.04)
    fn = normal_force(depth, motion[world, 1], p)
    keep, gain = bristle_step(vx * vx + vy * vy, fn, dt, p)
    zx = next_deflection(keep, bristle[world, texel, 0], gain, vx)
    zy = next_deflection(keep, bristle[world, texel, 1], gain, vy)
    scale = deflection_scale(zx * zx + zy * zy, max_bristle_deflection(fn, p))
    rate_x, rate_y = (scale * zx - bristle[world, texel, 0]) / dt, (scale * zy - bristle[world, texel, 1]) / dt
    bristle[world, texel, 0], bristle[world, texel, 1] = scale * zx, scale * zy
    force[world, texel, 0] = fn
    force[world, texel, 1] = friction_force(scale * zx, rate_x, vx, p)
    force[world, texel, 2] = friction_force(scale * zy, rate_y, vy, p)


compiled_law = inlined(law_alone)


@kernel
def all_laws(motion: np.ndarray, law: np.ndarray, bristle: np.ndarray, force: np.ndarray) -> None:
    """Press all texels of all worlds."""
    for world in range(force.shape[0]):
        for texel in range(force.shape[1]):
            compiled_law(world, texel, motion, law, bristle, force)


def rate(step: Callable[[], Any]) -> float:
    """Return millions of texel-steps per second."""
    step()
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()
        step()
        times.append(time.process_time() - start)
    return WORLDS * TEXELS / min(times) / 1e6


def law_rates() -> tuple[float, float]:
    """Return the rates of the contact law alone, on Warp and by numba; their forces are compared to the last bit."""
    import warp

    parameters = loop.item(TEXELS).sensor.parameters
    motion = np.random.default_rng(1).random((WORLDS, 5)) * [1e-3, 1e-2, 0.05, 0.05, 0.0] + [0.0435, 0.0, 0.0, 0.0, 1e-3]
    law, bristle, force = np.array([contact_law(parameters)]), np.zeros((WORLDS, TEXELS, 2)), np.zeros((WORLDS, TEXELS, 3))
    translation = Translation(warp, warp.float64, "benchmark")
    arrays = [translation.array(values, "cpu") for values in (motion, law, bristle, force)]
    press = translation.kernel(law_alone, 2)
    ours = rate(lambda: warp.launch(press, dim=(WORLDS, TEXELS), inputs=arrays, device="cpu"))
    theirs = rate(lambda: all_laws(motion, law, bristle, force))
    assert np.array_equal(arrays[3].numpy(), force) and force[..., 0].max() > 0.1
    return ours, theirs


def step_rates(name: str, shape: Any) -> tuple[float, float, float]:
    """Return the rates of whole steps: on Warp with a mesh and with a shape, and of the compiled core with the mesh."""
    mesh, height, _ = loop.objects()[name]
    phases = np.random.default_rng(1).random(WORLDS) * 2 * np.pi
    still = np.tile([0.0, 0.0, 0.0, *loop.LEVEL], (WORLDS, 1))
    poses = still.copy()

    def moved() -> np.ndarray:
        phases[:] += 2 * np.pi / loop.STEPS
        poses[:, :3] = loop.positions(height, phases)
        return poses

    found = []
    for target in (mesh, shape):
        sensors = WarpSensors(loop.item(TEXELS), target, loop.DT, WORLDS)
        found.append(rate(lambda sensors=sensors: sensors.step(still, moved())))
    core = PressedSensors(loop.item(TEXELS), mesh, loop.DT, WORLDS, 1)
    return found[0], found[1], rate(lambda: core.step(still, moved()))


def run() -> Iterator[dict]:
    """The contact law alone, and whole steps."""
    unit, peer = "M texel-steps/s", "compiled core, one thread"
    ours, theirs = law_rates()
    yield {
        "name": "warp.law", "value": ours, "unit": unit, "peer": peer, "peer_value": theirs,
        "ratio": ours / theirs, "goal": LAW_GOAL / theirs,
    }  # fmt: skip
    for name, shape in (("cube", box((solver.CUBE,) * 3)), ("ball", sphere(solver.BALL))):
        with_mesh, with_shape, core = step_rates(name, shape)
        yield {
            "name": f"warp.step.{name}.mesh", "value": with_mesh, "unit": unit, "peer": peer, "peer_value": core,
            "ratio": with_mesh / core, "goal": MESH_GOAL / core,
        }  # fmt: skip
        yield {
            "name": f"warp.step.{name}.shape", "value": with_shape, "unit": unit, "peer": peer, "peer_value": core,
            "ratio": with_shape / core,
        }  # fmt: skip
