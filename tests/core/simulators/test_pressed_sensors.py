# SPDX-License-Identifier: GPL-3.0-or-later
"""One sensor in many environments: the bits of single ones, what is refused, and the numbers of a whole simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exported_sensors import ball, pad
from pressed_poses import DT, LEVEL, SIZE, assert_environments_are_singles, assert_equal_bits, pose, random_poses
from solver_scenes import box

from palpate.core.compiled.kernels import COMPILED
from palpate.core.effects.engine.registry import effect
from palpate.core.errors import ParameterError
from palpate.core.model.body import Body, Motion
from palpate.core.model.recording import SENSOR_FIELDS
from palpate.core.model.scenario import Scenario, Target
from palpate.core.simulators import pressed_sensors
from palpate.core.simulators.pressed_sensor import PressedSensor
from palpate.core.simulators.pressed_sensors import Contacts, PressedSensors
from palpate.core.solver.simulation import Simulation

KINDS = {
    "plain": (),
    "forces": (effect("creep", amount=0.2, time=0.02), effect("hysteresis")),
    "readings": (effect("noise", seed=3), effect("lag")),
}


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_environments_have_the_bits_of_single_sensors(kind, threads):
    """Also after one of them was reset on the way."""
    item = pad(5, 4)
    item = replace(item, sensor=replace(item.sensor, effects=KINDS[kind]))
    seeds = range(30 if COMPILED and kind == "plain" else 1)
    touched = 0
    many = PressedSensors(item, box(SIZE, SIZE, SIZE), DT, 7, threads)
    for seed in seeds:
        poses = random_poses(seed, 5, 7)
        many.reset()
        singles = [PressedSensor(item, box(SIZE, SIZE, SIZE), DT, *map(pose, one)) for one in poses[0]]
        touched += assert_environments_are_singles(many, singles, poses)
    assert touched > 50 * len(seeds)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("item", [pad(5, 4, points_per_texel=4), ball()], ids=["pad", "ball"])
def test_a_step_is_a_frame_of_a_simulation(item, kind):
    """The numbers are those of a run along the same keyframes."""
    item = replace(item, sensor=replace(item.sensor, effects=KINDS[kind]))
    path = random_poses(5, 6, 1)[:, 0]
    path[:, 1, 2] += 0.02 if item.name == "Ball" else 0.0
    path[..., 3:] /= np.linalg.norm(path[..., 3:], axis=2, keepdims=True)
    motions = [Motion(DT * np.arange(len(path)), path[:, body, :3], path[:, body, 3:]) for body in (0, 1)]
    simulation = Simulation(
        Scenario(
            bodies=(Body("sensor", motions[0]), Body("box", motions[1])),
            sensors=(item.sensor,),
            targets=(Target("box", 1, box(SIZE, SIZE, SIZE)),),
            frame_start=0,
            frame_end=len(path) - 1,
            fps=1 / DT,
            dt=DT,
        )
    )
    pressed = PressedSensor(item, box(SIZE, SIZE, SIZE), DT, *map(pose, path[0]))
    largest = 0.0
    for now in path[1:]:
        expected, found = simulation.advance().sensors[item.name], pressed.step(*map(pose, now)).texels
        largest = max(largest, np.abs(expected.shear).max())
        for name in SENSOR_FIELDS:
            scale = max(1.0, float(np.abs(getattr(expected, name)).max()))
            assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=1e-11 * scale), name
    assert largest > 0.01


def test_several_targets_share_a_sensor():
    """Two boxes side by side: the texels feel both, and each box is pushed as if it were alone."""
    item = pad(5, 8)
    left, right = LEVEL.copy(), LEVEL.copy()
    left[:3], right[:3] = [-0.012, 0.0, SIZE / 2 - 3e-4], [0.012, 0.0, SIZE / 2 - 5e-4]
    both = PressedSensor(item, [box(SIZE, SIZE, SIZE)] * 2, DT, pose(LEVEL), [pose(left), pose(right)])
    alone = [PressedSensor(item, box(SIZE, SIZE, SIZE), DT, pose(LEVEL), pose(one)) for one in (left, right)]
    many = PressedSensors(item, [box(SIZE, SIZE, SIZE)] * 2, DT, 2)
    many.step(LEVEL, [[left, right]] * 2)
    for step in range(3):
        right[0] += 1e-5 * step
        found = both.step(pose(LEVEL), [pose(left), pose(right)])
        singles = [one.step(pose(LEVEL), pose(where)) for one, where in zip(alone, (left, right), strict=True)]
        for number, single in enumerate(singles):
            assert np.array_equal(found.force_on_target[number], single.force_on_target)
            assert np.array_equal(found.torque_on_target[number], single.torque_on_target)
        assert np.array_equal(found.texels.normal_force, sum(single.texels.normal_force for single in singles))
        net = sum(single.texels.net_force for single in singles)
        assert found.texels.net_force == pytest.approx(net, abs=1e-12)
        assert found.force_on_target.sum(axis=0) == pytest.approx(-net, abs=1e-12)
        assert_equal_bits(many.step(LEVEL, [[left, right]] * 2), 1, found)
    assert (found.force_on_target[:, 2] > 0.1).all()
    with pytest.raises(ParameterError, match="There are 1 poses of targets for 2 targets"):
        both.step(pose(LEVEL), [pose(left)])


def test_environments_without_poses_are_flagged_and_the_others_go_on():
    item = pad(4, 4)
    poses = random_poses(2, 4, 3)
    many, clean = (PressedSensors(item, box(SIZE, SIZE, SIZE), DT, 3) for _ in range(2))
    for step, now in enumerate(poses):
        bad = now.copy()
        if step == 1:
            bad[1, 1, 4] = np.nan
        if step == 2:
            clean.reset(np.array([False, True, False]))  # environment 1 starts again
        found, expected = many.step(bad[:, 0], bad[:, 1]), clean.step(now[:, 0], now[:, 1])
        others = np.array([0, 2]) if step == 1 else np.arange(3)
        for name in ("texels", "readings", "contact", "wrench"):
            assert np.isfinite(getattr(found, name)).all()
            assert np.array_equal(getattr(found, name)[others], getattr(expected, name)[others])
        assert found.valid.tolist() == [True, step != 1, True]
        if step == 1:
            assert not found.texels[1].any() and not found.wrench[1].any() and not found.contact[1].any()
            assert found.fault() == (
                "1 of 3 environments have a pose that is not a position and quaternion of finite numbers (1): "
                "reset them in the simulation."
            )
        else:
            assert found.fault() == ""


def test_results_are_written_where_they_are_wanted():
    poses = random_poses(4, 2, 3)
    many = PressedSensors(pad(4, 4), box(SIZE, SIZE, SIZE), DT, 3)
    found = many.step(poses[0, :, 0], poses[0, :, 1])
    kept = Contacts(*(getattr(found, name).copy() for name in pressed_sensors.CONTACT_FIELDS))
    again = Contacts(*(np.zeros_like(getattr(found, name)) for name in pressed_sensors.CONTACT_FIELDS))
    many.reset()
    assert many.step(poses[0, :, 0], poses[0, :, 1], again) is again
    assert np.array_equal(again.wrench, kept.wrench) and again.wrench.any()


def test_points_that_are_pressed_too_deep_are_counted():
    deep = LEVEL.copy()
    item, mesh = pad(4, 4, max_penetration=0.002), box(SIZE, SIZE, SIZE)
    above = LEVEL + np.array([0.0, 0.0, 0.0115, 0.0, 0.0, 0.0, 0.0])
    single, many = PressedSensor(item, mesh, DT, pose(LEVEL), pose(above)), PressedSensors(item, mesh, DT, 2)
    for height in (SIZE / 2 - 0.001, SIZE / 2 - 0.003):
        deep[2] = height
        single.step(pose(LEVEL), pose(deep))
        found = many.step(LEVEL, np.stack([deep] * 2))
        assert found.too_deep.tolist() == [single.too_deep] * 2


def test_what_makes_no_environments_is_one_sentence(monkeypatch):
    item, mesh = pad(4, 4), box(SIZE, SIZE, SIZE)
    with pytest.raises(ParameterError, match="There are 0 environments"):
        PressedSensors(item, mesh, DT, 0)
    with pytest.raises(ParameterError, match="There is no target for 'Pad'"):
        PressedSensors(item, [], DT, 2)
    many = PressedSensors(item, mesh, DT, 2)
    with pytest.raises(ParameterError, match=r"The poses of the target are float64 of shape \(3, 7\): .* \(2, 7\)\."):
        many.step(LEVEL, np.zeros((3, 7)))
    with pytest.raises(ParameterError, match="The poses of the sensor are .* of shape"):
        many.step(["far"] * 7, np.zeros((2, 7)))
    with pytest.raises(ParameterError, match=r"The mask of environments to reset is int64 of shape \(1,\)"):
        many.reset(np.array([1]))
    found = many.step(LEVEL, np.stack([LEVEL] * 2))
    with pytest.raises(ParameterError, match=r"'readings' of out is float32 of shape \(2, 16\): give float64 of shape"):
        many.step(LEVEL, np.stack([LEVEL] * 2), replace(found, readings=found.readings.astype(np.float32)))
    monkeypatch.setattr(pressed_sensors, "available_memory", lambda: 1e6)
    with pytest.raises(ParameterError, match=r"100000 environments take .* GiB of memory, .* ask for \d+ at most\.$"):
        PressedSensors(item, mesh, DT, 100_000)
