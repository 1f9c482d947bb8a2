# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulation that goes on from its packed state gives, bit for bit, what it would have given without a break."""

from dataclasses import fields, replace

import numpy as np
import pytest
from solver_scenes import box, cube_on_pad, gripper

from palpate.core.effects.engine.registry import effect
from palpate.core.jobs.job_runner import run_job
from palpate.core.model.recording import SensorFrame
from palpate.core.solver import checkpoint
from palpate.core.solver.simulation import Simulation, solve


def slipping_cube():
    return cube_on_pad(mass=0.3, tilt=0.1, frames=20, sigma0=5.0)


def grasp():
    return gripper(box(0.03, 0.03, 0.04), 0.1, 3.0, np.linspace(0.02, 0.05, 16))


def with_effects():
    """All kinds of memory, chance and mixing."""
    scenario = slipping_cube()
    chosen = (
        effect("load-spreading"),
        effect("hysteresis", "play"),
        effect("creep"),
        effect("gain-mismatch", seed=1),
        effect("lag", "dead-time", time=0.07),
        effect("lag", "second-order", time=0.1),
        effect("drift", "random-walk", seed=2),
        effect("noise", seed=3),
    )
    return replace(scenario, sensors=tuple(replace(sensor, effects=chosen) for sensor in scenario.sensors))


@pytest.mark.parametrize("make", [slipping_cube, grasp, with_effects])
@pytest.mark.parametrize("at", [1, 9])
def test_a_run_goes_on_where_it_was(make, at, tmp_path):
    scenario = make()
    whole = run_job(solve(scenario))
    before = Simulation(scenario)
    frames = [before.observe()]
    frames += [before.advance() for _ in range(at)]
    np.savez(tmp_path / "state.npz", **checkpoint.pack(before))
    after = Simulation(scenario)
    with np.load(tmp_path / "state.npz", allow_pickle=False) as packed:
        checkpoint.unpack(after, packed)
    found = run_job(solve(scenario, after, frames))
    assert found.frames.tolist() == whole.frames.tolist() and found.warnings == whole.warnings
    assert found.poses.tobytes() == whole.poses.tobytes() and found.velocities.tobytes() == whole.velocities.tobytes()
    for name, felt in whole.sensors.items():
        for item in fields(SensorFrame):
            assert getattr(found.sensors[name], item.name).tobytes() == getattr(felt, item.name).tobytes(), item.name
    assert whole.sensors and np.isfinite(whole.poses).all()


def test_what_is_packed_is_no_longer_the_simulations():
    """Advancing does not change a state that was packed before."""
    simulation = Simulation(slipping_cube())
    packed = {name: np.array(value) for name, value in checkpoint.pack(simulation).items()}
    again = Simulation(slipping_cube())
    checkpoint.unpack(again, packed)
    for _ in range(3):
        simulation.advance()
    assert again.frame == 1 and again.advance().poses.tobytes() != simulation.observe().poses.tobytes()


def test_the_state_of_another_version_is_refused():
    simulation = Simulation(slipping_cube())
    packed = checkpoint.pack(simulation)
    simulation.something_new = 1.0
    with pytest.raises(ValueError, match="another version"):
        checkpoint.unpack(simulation, packed)
