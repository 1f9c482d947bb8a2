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


def assert_agree(item, target, degrees, device="cpu"):
    """Loads that swing and lean, on sensors that are turned anywhere, one of which is reset on the way."""
    count, draw = 5, np.random.default_rng(4)
    core, ours = PressedSensors(item, target, DT, count), WarpSensors(item, target, DT, count, device)
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
        assert np.abs(found.wrench.numpy() - expected.wrench.reshape(count, 1, 6)).max() < EXACT
    assert np.abs(expected.texels[..., 1:]).max() > 1e-4


@pytest.mark.slow("Warp compiles the kernels")
@pytest.mark.parametrize("degrees", [1, 3, 6])
@pytest.mark.parametrize("target", [CUBE, SHAPE], ids=["mesh", "shape"])
def test_texels_add_up_to_the_load_as_in_pressed_sensors(degrees, target):
    assert_agree(pad(8, 8, **LAW), target, degrees)


@pytest.mark.slow("Warp compiles the kernels")
@pytest.mark.parametrize(
    ("law", "effects"),
    [
        ({"normal_law": "hunt-crossley", "k": 30000.0}, ()),
        pytest.param({}, (effect("creep"), effect("lag")), marks=pytest.mark.long("Warp compiles kernels for these effects")),
    ],
)
def test_under_another_law_and_with_effects_on_forces_and_readings(law, effects):
    item = pad(8, 8, **(LAW | law))
    assert_agree(replace(item, sensor=replace(item.sensor, effects=effects)), SHAPE, 6)


@pytest.mark.skipif(not CUDA, reason="Warp finds no GPU on this machine")
def test_a_gpu_finds_the_same_displacements():
    assert_agree(pad(8, 8, **LAW), SHAPE, 6, CUDA)


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
def test_what_nothing_balances_and_what_is_no_number_is_left_as_in_pressed_sensors():
    """Each environment has a load of its own that no contact balances, one of them without a pose, and the last a weight."""
    loads = np.array([
        [0.0, 0.0, -5.0, 0.0, 0.0, 0.0],  # pull
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.3],  # torque alone
        [0.0, 50.0, WEIGHT, 0.0, 0.0, 0.0],  # beyond friction
        [0.0, 0.0, WEIGHT, 3.0, 0.0, 0.0],  # outside the support
        [0.0, 0.0, 1e5, 0.0, 0.0, 0.0],  # heavier than the pad carries
        [0.0, 0.0, np.inf, 0.0, 0.0, 0.0],
        [0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0],
        [0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0],
    ])  # fmt: skip
    count = len(loads)
    core, pressed = (kind(pad(8, 8, **LAW), SHAPE, DT, count) for kind in (PressedSensors, WarpSensors))
    for step in range(10):
        poses = at(count)
        poses[6, 2] = np.nan if step == 4 else poses[6, 2]
        expected = core.step(level(count), poses, wrench=loads)
        pressed.step(level(count), poses, wrench=warp.array(loads, dtype=warp.float64, device="cpu"))
        wrench, left = pressed.wrench.numpy()[:, 0], pressed.residual.numpy()
        assert pressed.valid.numpy().tolist() == expected.valid.tolist() == [True] * 5 + [False, step != 4, True]
        for values in (pressed.texels, pressed.readings, pressed.displacement):
            assert np.isfinite(values.numpy()).all()
        balanced = expected.valid & np.isfinite(loads).all(axis=1)
        assert np.abs(wrench + left - loads)[balanced].max() < 1e-9 * 1e5 and not wrench[[0, 1, 5]].any()
        assert (np.abs(left[:5]).max(axis=1) > 0.01).all() and np.abs(left[7]).max() < EXACT
    assert np.abs(left[6]).max() < EXACT and pressed.residual_reason == core.residual_reason != ""
    pressed.step(level(count), at(count, -1e-4))  # without a load the target is at its pose again
    core.step(level(count), at(count, -1e-4))
    assert pressed.residual is None and not pressed.displacement.numpy().any()


def test_what_is_no_load_is_one_sentence():
    pressed = WarpSensors(pad(4, 4), SHAPE, DT, 2)
    for bad in (np.zeros(6), np.zeros((2, 2)), np.full((2, 3), "much")):
        with pytest.raises(ParameterError, match=r"The loads are of shape .*: give numbers of shape \(2, 6\), .* or on cpu\.$"):
            pressed.step(level(2), at(2), wrench=bad)
    with pytest.raises(ParameterError, match="In float32 a load cannot be found"):
        WarpSensors(pad(4, 4), SHAPE, DT, 2, single=True).step(level(2), at(2), wrench=np.zeros((2, 1)))
    with pytest.raises(ParameterError, match="A wrench is given for 2 targets"):
        WarpSensors(pad(4, 4), [SHAPE, SHAPE], DT, 2).step(level(2), np.stack([at(2)] * 2, 1), wrench=np.zeros((2, 1)))
