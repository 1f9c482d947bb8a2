# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads given to sensors on Warp: the numbers of PressedSensors, sums that are the load, and what none balances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exported_sensors import pad
from scipy.spatial.transform import Rotation
from solver_scenes import box

from palpate.core.effects.engine.registry import effect
from palpate.core.errors import ParameterError
from palpate.core.geometry import shapes
from palpate.core.simulators.pressed_sensors import PressedSensors
from palpate.core.simulators.warp.warp_sensors import WarpSensors

warp = pytest.importorskip("warp", reason="Warp runs the kernels: pip install warp-lang")
CUDA = next((str(one) for one in warp.get_devices() if one.is_cuda), "")

DT, SIZE, WEIGHT = 0.005, 0.04, 9.81
CUBE, SHAPE = box(SIZE, SIZE, SIZE), shapes.box((SIZE, SIZE, SIZE))
LAW = {"k": 1000.0, "cn": 10.0, "sigma0": 1000.0, "sigma1": 10.0}
EXACT = 1e-6
"""Newtons (and N·m) to which texels add up to the load, as the issue asks; the search ends at a thousandth of it."""
AGREE = 2e-9
"""Newtons to which Warp and the solver agree: each ends its search within 1e-8 of the load, which 64 texels share."""


def at(count, z=0.0):
    return np.tile([0.0, 0.0, SIZE / 2 + z, 1.0, 0.0, 0.0, 0.0], (count, 1))


def level(count):
    return np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (count, 1))


def with_effects(item, *names):
    return replace(item, sensor=replace(item.sensor, effects=tuple(effect(name) for name in names)))


def assert_agree(item, meshes, targets, degrees, device="cpu"):
    """Loads that swing and lean, on sensors that are turned anywhere, one of which is reset on the way."""
    count, draw = 5, np.random.default_rng(4)
    core, ours = PressedSensors(item, meshes, DT, count), WarpSensors(item, targets, DT, count, device)
    size, phase, place = draw.uniform(0.5, 1.0, count), draw.uniform(0.0, 6.0, count), draw.standard_normal((count, 3))
    turn = Rotation.from_rotvec(draw.standard_normal((count, 3)))
    quaternion = np.roll(turn.as_quat(), 1, axis=1)
    sensor = np.column_stack([place, 1.3 * quaternion])  # of any length
    for step in range(12):
        swing, up = np.sin(0.2 * step + phase) * size, at(count, -2e-4)[:, :3]
        up[:, 0] += 1e-5 * np.sin(0.3 * step + phase)
        target = np.column_stack([place + turn.apply(up), quaternion])
        force = turn.apply(np.column_stack([0.24 * swing, np.full(count, -0.18), WEIGHT + 2.0 * swing]))
        torque = turn.apply(0.3 * np.column_stack([0.02 * swing, np.full(count, -0.03), 0.004 * swing]))
        loads = np.column_stack([force, torque])[:, :degrees] if degrees > 1 else (WEIGHT + 2.0 * swing)[:, None]
        if step == 5:
            core.reset(np.arange(count) == 1)
            ours.reset(np.arange(count) == 1)
        expected, found = core.step(sensor, target, wrench=loads), ours.step(sensor, target, wrench=loads)
        for name in ("texels", "readings"):
            assert np.abs(getattr(found, name).numpy() - getattr(expected, name)).max() < AGREE, (step, name)
        assert np.abs(found.displacement.numpy() - core.displacement).max() < 1e-9
        assert found.residual.shape == (count, degrees) and np.abs(found.residual.numpy()).max() < EXACT
        assert np.array_equal(found.poses.numpy()[:, 1], target)  # those of the other program
        wrench = found.wrench.numpy()[:, 0]
        if degrees > 1:
            assert np.abs(wrench[:, :degrees] - loads).max() < EXACT
        else:
            assert turn.inv().apply(wrench[:, :3])[:, 2] == pytest.approx(loads[:, 0], abs=EXACT)
        if degrees < 6:  # the target is not tilted, so that texels measure along their normals and axes
            normal, x = item.sensor.texels.normal, item.sensor.texels.tangent
            texels = found.texels.numpy()
            sums = (-texels[..., :1] * normal + texels[..., 1:2] * x + texels[..., 2:] * np.cross(normal, x)).sum(axis=1)
            assert np.abs(-turn.apply(sums) - wrench[:, :3]).max() < EXACT
    assert np.abs(expected.texels[..., 1:]).max() > 1e-4


@pytest.mark.slow("Warp compiles the kernels")
@pytest.mark.parametrize("degrees", [1, 3, 6])
@pytest.mark.parametrize("target", [CUBE, SHAPE], ids=["mesh", "shape"])
def test_texels_add_up_to_the_load_as_in_pressed_sensors(degrees, target):
    assert_agree(pad(8, 8, **LAW), target, target, degrees)


@pytest.mark.slow("Warp compiles the kernels")
def test_under_hunt_and_crossleys_law():
    assert_agree(pad(8, 8, **(LAW | {"normal_law": "hunt-crossley", "k": 30000.0})), SHAPE, SHAPE, 6)


@pytest.mark.long("Warp compiles kernels for these effects")
def test_with_effects_on_forces_and_readings():
    assert_agree(with_effects(pad(8, 8, **LAW), "creep", "lag"), SHAPE, SHAPE, 6)


@pytest.mark.skipif(not CUDA, reason="Warp finds no GPU on this machine")
def test_a_gpu_finds_the_same_displacements():
    assert_agree(pad(8, 8, **LAW), SHAPE, SHAPE, 6, CUDA)


@pytest.mark.skipif(not CUDA, reason="Warp finds no GPU on this machine")
def test_a_step_under_loads_is_captured_as_a_graph():
    pressed = WarpSensors(pad(8, 8, **LAW), SHAPE, DT, 2, CUDA)
    loads = warp.array(np.tile([0.0, 0.0, WEIGHT], (2, 1)), dtype=warp.float64, device=CUDA)
    pressed.step(level(2), at(2), wrench=loads)
    with warp.ScopedCapture(CUDA) as capture:
        pressed.step(wrench=loads)
    loads.fill_(0.0)
    loads[:, 2].fill_(5.0)
    warp.capture_launch(capture.graph)
    assert pressed.wrench.numpy()[:, 0, 2] == pytest.approx(5.0, abs=EXACT)


@pytest.mark.slow("Warp compiles the kernels")
def test_what_nothing_balances_is_a_residual_and_never_nan():
    """Each environment has a load of its own that no contact balances, the last one a weight that it carries."""
    loads = np.array([
        [0.0, 0.0, -5.0, 0.0, 0.0, 0.0],  # pull
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.3],  # torque alone
        [0.0, 50.0, WEIGHT, 0.0, 0.0, 0.0],  # beyond friction
        [0.0, 0.0, WEIGHT, 3.0, 0.0, 0.0],  # outside the support
        [0.0, 0.0, 1e5, 0.0, 0.0, 0.0],  # heavier than the pad carries
        [0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0],
    ])  # fmt: skip
    count = len(loads)
    pressed = WarpSensors(pad(8, 8, **LAW), SHAPE, DT, count)
    for _ in range(10):
        pressed.step(level(count), at(count), wrench=loads)
        wrench, left = pressed.wrench.numpy()[:, 0], pressed.residual.numpy()
        for values in (pressed.texels, pressed.readings, pressed.displacement):
            assert np.isfinite(values.numpy()).all()
        assert np.abs(wrench + left - loads).max() < 1e-9 * 1e5
        assert left[:2] == pytest.approx(loads[:2], abs=1e-12) and not wrench[:2].any()
        assert (np.abs(left[:5]).max(axis=1) > 0.01).all() and np.abs(left[5]).max() < EXACT
        assert np.abs(pressed.displacement.numpy()[:, :3]).max() < 0.03
    assert pressed.residual_reason.startswith("In 1 of 6 environments (0) the load pulls the target off the sensor")


@pytest.mark.slow("Warp compiles the kernels")
def test_a_bad_pose_or_load_is_one_environment_and_the_next_step_goes_on():
    pressed = WarpSensors(pad(8, 8, **LAW), SHAPE, DT, 4)
    loads, poses = np.tile([0.0, 0.0, WEIGHT], (4, 1)), at(4)
    poses[1, 2], loads[2, 0] = np.nan, np.inf
    pressed.step(level(4), poses, wrench=loads)
    assert pressed.valid.numpy().tolist() == [True, False, False, True]
    assert not pressed.wrench.numpy()[1:3].any() and not pressed.residual.numpy()[1:3].any()
    assert pressed.wrench.numpy()[[0, 3], 0, 2] == pytest.approx(WEIGHT, abs=EXACT)
    loads[2, 0] = 0.0
    pressed.step(level(4), at(4), wrench=warp.array(loads, dtype=warp.float64, device="cpu"))
    assert pressed.valid.numpy().all() and pressed.wrench.numpy()[:, 0, 2] == pytest.approx(WEIGHT, abs=EXACT)
    core = PressedSensors(pad(8, 8, **LAW), SHAPE, DT, 4)
    for _ in range(2):
        expected = core.step(level(4), at(4), wrench=loads)
    expected = core.step(level(4), at(4, -1e-4))
    pressed.step(level(4), at(4, -1e-4))  # without a load the target is at its pose again
    assert pressed.residual is None and not pressed.displacement.numpy().any()
    assert np.abs(pressed.texels.numpy() - expected.texels)[[0, 3]].max() < 1e-6


def test_what_is_no_load_is_one_sentence():
    pressed = WarpSensors(pad(4, 4), SHAPE, DT, 2)
    for bad in (np.zeros(6), np.zeros((2, 2)), np.full((2, 3), "much")):
        with pytest.raises(ParameterError, match=r"The loads are of shape .*: give numbers of shape \(2, 6\), .* or on cpu\.$"):
            pressed.step(level(2), at(2), wrench=bad)
    with pytest.raises(ParameterError, match="In float32 a load cannot be found"):
        WarpSensors(pad(4, 4), SHAPE, DT, 2, single=True).step(level(2), at(2), wrench=np.zeros((2, 1)))
    with pytest.raises(ParameterError, match="A wrench is given for 2 targets"):
        WarpSensors(pad(4, 4), [SHAPE, SHAPE], DT, 2).step(level(2), np.stack([at(2)] * 2, 1), wrench=np.zeros((2, 1)))
