# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenarios as files: complete, deterministic, and refused when damaged."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from solver_scenes import about, free_body, pad, shape

from palpate.core.effects.engine.registry import effect
from palpate.core.errors import FileError
from palpate.core.io.scenario_npz import load_scenario, save_scenario
from palpate.core.model.body import Body, Drive, Motion, Signal
from palpate.core.model.scenario import Scenario, Target
from palpate.core.model.sensor import Deformation, Sensor
from palpate.core.model.sensor_parameters import Painted


def full_scenario() -> Scenario:
    """A scenario in which every kind of part occurs."""
    ball, texels = shape(trimesh.creation.icosphere(1, 0.01)), pad(3, 3)
    path = Motion(
        np.array([0.0, 0.5]), np.array([[0, 0, 0.1], [0, 0, 0.2]]), np.array([about((0, 0, 1), 5), about((0, 0, 1), 9)])
    )
    grip = Drive(control="force", target=Signal(np.array([0.0, 1.0]), np.array([1.0, 2.0])), sensor=0)
    driven = replace(free_body("Finger", ball, 0.2, (0, 0, 0.3)), free=False, drive=grip)
    painted = Painted(k=np.linspace(0.5, 1.5, 9))
    effects = (effect("creep", amount=0.2), effect("noise", seed=3))
    deformed = Deformation(np.array([0.0, 1.0]), np.stack([ball.vertices, 1.1 * ball.vertices]))
    return Scenario(
        bodies=(Body("Pad", Motion.at_rest()), free_body("Ball", ball, 0.1, (0, 0, 0.02)), driven, Body("Arm", path)),
        sensors=(Sensor("Pad", 0, texels, painted=painted, effects=effects),),
        targets=(Target("Ball", 1, ball, smooth=True), Target("Arm", 3, ball, deformation=deformed)),
        dt=np.float64(1e-4),
        name="Szene ä",
    )


def test_what_is_read_has_the_digest_of_what_was_written(tmp_path):
    scenario = full_scenario()
    save_scenario(tmp_path / "a.npz", scenario)
    read = load_scenario(tmp_path / "a.npz")
    assert read.digest() == scenario.digest()
    assert read.sensors[0].effects == scenario.sensors[0].effects
    assert type(read.sensors[0].texels.layout) is type(scenario.sensors[0].texels.layout)
    assert replace(read, name="another").digest() != scenario.digest()


def test_equal_scenarios_are_equal_files(tmp_path):
    for name in "ab":
        save_scenario(tmp_path / name, full_scenario())
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.parametrize("keep", [0, 1, 100, 1000, 3000])
def test_a_file_that_was_cut_is_refused(tmp_path, keep):
    save_scenario(tmp_path / "a.npz", full_scenario())
    content = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "a.npz").write_bytes(content[:keep])
    with pytest.raises(FileError, match="damaged"):
        load_scenario(tmp_path / "a.npz")


def test_a_missing_file_is_said():
    with pytest.raises(FileError, match="does not exist: write it again"):
        load_scenario("nowhere.npz")
