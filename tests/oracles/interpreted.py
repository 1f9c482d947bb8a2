# SPDX-License-Identifier: GPL-3.0-or-later
"""Random scenes computed by compiled kernels, by interpreted ones, and by both in turn: all bits have to be the same.

`python -m oracles.interpreted 200` in the folder tests compares so many scenes and prints those that differ.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from solver_scenes import pad, pressed

from oracles.sweep import random_case, random_turn
from palpate.core.compiled import kernels
from palpate.core.effects.engine.registry import effect, library
from palpate.core.model.recording import SENSOR_FIELDS, Frame
from palpate.core.model.scenario import Scenario
from palpate.core.model.sensor import Deformation
from palpate.core.solver.simulation import Simulation

FRAMES = 4


@contextmanager
def interpreted() -> Iterator[None]:
    """Interpret all kernels meanwhile."""
    kernels.interpret_kernels()
    try:
        yield
    finally:
        kernels.compile_kernels()


def random_scene(seed: int) -> Scenario:
    """One of three kinds: thrown solids, a solid that is pressed, and a solid that deforms; each second one with effects."""
    rng = np.random.default_rng([627, seed])
    scenario = random_case(seed)[0]
    mesh = scenario.targets[0].mesh
    if seed % 3 == 0:
        scenario = replace(scenario, frame_end=1 + 8 * FRAMES)
    else:
        lowest = mesh.vertices[:, 2].min()
        path = np.array([0.0, 0.0, -lowest]) - np.linspace([0.0, 0.0, -1e-4], rng.uniform(0.0, 0.002, 3), FRAMES)
        turns = [random_turn(rng, 0.05) for _ in range(FRAMES)]
        scenario = pressed(mesh, path, texels=pad(8, 7), dt=4e-3, turns=turns, points_per_texel=int(rng.choice([1, 4])))
    if seed % 3 == 2:
        frames = np.stack([mesh.vertices * (1.0 + 0.02 * i) for i in range(FRAMES)])
        moving = replace(scenario.targets[0], deformation=Deformation(np.arange(FRAMES) / scenario.fps, frames))
        scenario = replace(scenario, targets=(moving, *scenario.targets[1:]))
    if seed % 2:
        forms = [(name, form.name) for name, kind in sorted(library().items()) for form in kind.forms]
        chosen = {forms[i][0]: effect(*forms[i]) for i in rng.choice(len(forms), 3, replace=False)}
        scenario = replace(scenario, sensors=(replace(scenario.sensors[0], effects=tuple(chosen.values())),))
    return scenario


def bits(frame: Frame) -> bytes:
    """All that a frame says."""
    felt = [getattr(sensor, name) for sensor in frame.sensors.values() for name in SENSOR_FIELDS]
    return b"".join(np.ascontiguousarray(array).tobytes() for array in (frame.poses, frame.velocities, *felt))


def difference(scenario: Scenario) -> str:
    """Return in words where the ways of computing differ; empty where all bits are the same."""
    count = min(scenario.frame_end - scenario.frame_start, 8 * FRAMES)
    compiled = Simulation(scenario)
    expected = [bits(compiled.observe()), *(bits(compiled.advance()) for _ in range(count))]
    with interpreted():
        alone, in_turn = Simulation(scenario), Simulation(scenario)
        found = [bits(alone.observe()), *(bits(alone.advance()) for _ in range(count))]
        changing = [bits(in_turn.observe()), *(bits(in_turn.advance()) for _ in range(count // 2))]
    changing += [bits(in_turn.advance()) for _ in range(count - count // 2)]
    for what, frames in (("interpreted", found), ("changed over", changing)):
        differing = [i for i, pair in enumerate(zip(frames, expected, strict=True)) if pair[0] != pair[1]]
        if differing:
            return f"{what} from frame {scenario.frame_start + differing[0]}"
    return ""


def main(number: int) -> int:
    """Compare so many scenes; return how many differ."""
    differing = 0
    for seed in range(number):
        if words := difference(random_scene(seed)):
            differing += 1
            print(
                seed,
                words,
                random_case(seed)[2],
                [(one.name, one.form) for one in random_scene(seed).sensors[0].effects],
                flush=True,
            )
    print(f"{differing} of {number} scenes differ")
    return differing


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])) > 0)
