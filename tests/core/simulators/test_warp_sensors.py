# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors on Warp: the numbers of PressedSensors, simple shapes, physics in an explicit loop, and what is refused."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from exported_sensors import ball, pad
from pressed_poses import DT, LEVEL, SIZE, random_poses
from solver_scenes import box

from palpate.core.effects.engine.registry import effect
from palpate.core.errors import ParameterError
from palpate.core.geometry import shapes
from palpate.core.simulators.pressed_sensors import PressedSensors
from palpate.core.simulators.warp.warp_sensors import WarpSensors

warp = pytest.importorskip("warp", reason="Warp runs the kernels: pip install warp-lang")
CUDA = next((str(one) for one in warp.get_devices() if one.is_cuda), "")
needs_gpu = pytest.mark.skipif(not CUDA, reason="Warp finds no GPU on this machine")

CUBE = box(SIZE, SIZE, SIZE)
SHAPE = shapes.box((SIZE, SIZE, SIZE))
AGREE = 1e-9
"""Newtons (and units of a reading, N·m) to which Warp in float64 and the solver agree: forces here are up to some newtons."""


def assert_agree(item, meshes, targets, poses, device="cpu"):
    """Take the same steps with both; an environment is reset on the way, and others have no pose. Return the largest force."""
    e, largest = poses.shape[1], 0.0
    core, ours = PressedSensors(item, meshes, DT, e), WarpSensors(item, targets, DT, e, device)
    poses[1, 0, 1, 4], poses[2, 2, 0, 3:] = np.nan, 0.0
    for step, now in enumerate(poses):
        if step == 3:
            core.reset(np.arange(e) == 1)
            ours.reset(np.arange(e) == 1)
        expected, found = core.step(now[:, 0], now[:, 1:]), ours.step(now[:, 0], now[:, 1:])
        for name in ("texels", "readings", "wrench"):
            assert np.abs(getattr(found, name).numpy() - getattr(expected, name)).max() < AGREE, (step, name)
        for name in ("contact", "valid"):
            assert np.array_equal(getattr(found, name).numpy(), getattr(expected, name)), (step, name)
        if any(one is CUBE for one in targets):  # meshes do not tell points that were inside at the beginning
            assert np.array_equal(found.too_deep.numpy(), expected.too_deep)
        else:
            assert (found.too_deep.numpy() >= expected.too_deep).all()
        largest = max(largest, float(np.abs(expected.texels[..., 1:]).max()))
    return largest


@pytest.mark.slow("Warp compiles the kernels")
@pytest.mark.parametrize("target", [CUBE, SHAPE], ids=["mesh", "shape"])
@pytest.mark.parametrize(
    "item",
    [pad(5, 4), pad(4, 3, normal_law="hunt-crossley", k=3e4), pad(3, 4, points_per_texel=4, max_penetration=1e-3), ball()],
    ids=["pad", "Hunt-Crossley", "four points, some too deep", "painted ball"],
)
def test_results_are_those_of_pressed_sensors(item, target):
    poses = random_poses(5, 6, 4, height=0.03 if item.name == "Ball" else SIZE / 2)
    assert assert_agree(item, [CUBE], [target], poses) > 1e-3


@pytest.mark.slow("Warp compiles the kernels")
@pytest.mark.parametrize(
    "shape",
    [shapes.sphere(0.01), shapes.capsule(0.01, 0.008), shapes.box((SIZE, SIZE, SIZE)), shapes.plane()],
    ids=lambda shape: shape.kind,
)
def test_shapes_of_the_core_press_alike(shape):
    poses = random_poses(11, 6, 4, height={shapes.CAPSULE: 0.014, shapes.PLANE: 0.0}.get(shape.kind, 0.01))
    if shape.kind == shapes.PLANE:
        poses[:, :, 1, 3:] = [0.0, 1.0, 0.0, 0.0]  # its top downwards
    assert assert_agree(pad(6, 6), [shape], [shape], poses) > 1e-3


@pytest.mark.slow("Warp compiles the kernels")
def test_several_targets_share_a_sensor():
    assert assert_agree(pad(5, 8), [CUBE, CUBE], [CUBE, SHAPE], random_poses(6, 5, 3, 2)) > 1e-3


EFFECTS = {
    "forces": ("creep", "hysteresis", "stribeck", "viscous-friction"),
    "memory and pull": ("softening", "wear", "stiffening", "adhesion"),
    "readings": ("lag",),
}


@pytest.mark.long("Warp compiles kernels for each set of effects")
@pytest.mark.parametrize("names", EFFECTS.values(), ids=EFFECTS)
def test_effects_are_those_of_pressed_sensors(names):
    """With two targets on four points, the deepest of which is remembered."""
    item = pad(4, 3, points_per_texel=4)
    item = replace(item, sensor=replace(item.sensor, effects=tuple(effect(name) for name in names)))
    assert assert_agree(item, [CUBE, CUBE], [SHAPE, CUBE], random_poses(7, 6, 3, 2)) > 1e-3


@needs_gpu
def test_a_gpu_gives_the_same_numbers():
    assert assert_agree(pad(5, 4), [CUBE], [CUBE], random_poses(5, 6, 4), CUDA) > 1e-3


@needs_gpu
def test_a_step_is_captured_as_a_graph():
    item, poses = pad(5, 4), random_poses(8, 4, 3)
    plain, graph = (WarpSensors(item, CUBE, DT, 3, CUDA) for _ in range(2))
    plain.step(poses[0, :, 0], poses[0, :, 1])
    graph.step(poses[0, :, 0], poses[0, :, 1])
    with warp.ScopedCapture(CUDA) as capture:
        graph.step()
    for now in poses[1:]:
        plain.step(now[:, 0], now[:, 1])
        warp.copy(graph.poses, warp.array(now, dtype=warp.float64, device=CUDA))
        warp.capture_launch(capture.graph)
        assert np.array_equal(graph.texels.numpy(), plain.texels.numpy())


# --- physics


def slide(pressed, tilt, steps, dt, mass=1.0, start=0.05):
    """Let a cube go on a pad that is tilted about x, coupled explicitly; return where it was, by steps."""
    pull = mass * 9.81 * np.array([0.0, -np.sin(tilt), -np.cos(tilt)])
    where, speed, path = np.array([0.0, 0.0, start]), np.zeros(3), []
    sensor, target = LEVEL[None], LEVEL[None].copy()
    target[0, :3] = where
    pressed.step(sensor, target)
    for _ in range(steps):
        speed += dt * (pressed.wrench.numpy()[0, 0, :3] + pull) / mass
        where += dt * speed
        target[0, :3] = where
        pressed.step(sensor, target)
        path.append(where.copy())
    return np.array(path)


def slope_sensor(dt):
    return WarpSensors(pad(8, 8, k=1000.0, cn=10.0, sigma0=1000.0, sigma1=10.0), shapes.box((0.1, 0.1, 0.1)), dt, 1)


@pytest.mark.slow("Warp compiles the kernels, and 2,000 steps")
@pytest.mark.parametrize(("degrees", "weight", "shear"), [(0.0, 9.81, 0.0), (10.0, 9.6610, 1.7035)])
def test_a_cube_at_rest_weighs_and_holds_what_it_should(degrees, weight, shear):
    pressed = slope_sensor(5e-4)
    slide(pressed, np.radians(degrees), 2000, 5e-4)
    texels, wrench = pressed.texels.numpy()[0], pressed.wrench.numpy()[0, 0]
    assert pressed.contact.numpy().all()
    assert texels[:, 0].sum() == pytest.approx(weight, abs=1e-4)
    assert wrench[:3] == pytest.approx([0.0, shear, weight], abs=1e-4)
    along = np.abs(texels[:, 1:].sum(axis=0))
    assert along.max() == pytest.approx(shear, abs=1e-3)
    assert along.min() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.long("120,000 steps of a minute on a slope")
def test_friction_holds_for_a_minute():
    path = slide(slope_sensor(5e-4), np.radians(10.0), 122_000, 5e-4)
    assert np.abs(path[-1] - path[2000]).max() < 1e-6


# --- use


@pytest.mark.slow("Warp compiles the kernels in float32")
def test_single_precision_errs_by_the_rounding_of_poses():
    """Positions of 0.1 m round to 7e-9 m: of depth, times k; of the rate over a step, times cn, which is the larger part."""
    item, poses = pad(5, 4), random_poses(5, 6, 4)
    poses[..., :3] += [0.1, -0.1, 0.1]
    double, single = (WarpSensors(item, CUBE, DT, 4, single=single) for single in (False, True))
    for now in poses:
        expected, found = (one.step(now[:, 0], now[:, 1]).texels.numpy() for one in (double, single))
        assert found.dtype == np.float32
        assert np.abs(found - expected).max() < 4 * 7e-9 * (1000.0 + 10.0 / DT)
    assert np.abs(expected).max() > 0.1


def test_what_makes_no_environments_is_one_sentence():
    item = pad(4, 4)
    noisy, late = (
        replace(item, sensor=replace(item.sensor, effects=(effect(*one),)))
        for one in (("noise",), ("lag", "second-order-plus-dead-time"))
    )
    for arguments, words in (
        ((item, CUBE, 0.0, 2), "The step is 0 s"),
        ((item, CUBE, DT, 0), "There are 0 environments"),
        ((item, [], DT, 2), "Nothing presses on 'Pad'"),
        ((item, ["cube"], DT, 2), r"Target 1 is a str: give a TriangleMesh or a Shape\.$"),
        ((item, CUBE, DT, 2, "cuda:77"), "Warp has no device 'cuda:77' here: take one of cpu"),
        ((noisy, CUBE, DT, 2), r"The effect 'noise' \(\w+\) of 'Pad' has no Warp kernel: .* PressedSensors\.$"),
        ((late, CUBE, DT, 2), r"The effect 'lag' \([\w-]+\) of 'Pad' has no Warp kernel"),
    ):
        with pytest.raises(ParameterError, match=words):
            WarpSensors(*arguments)


def test_poses_and_masks_of_another_shape_are_one_sentence():
    many = WarpSensors(pad(4, 4), CUBE, DT, 2)
    assert len(many) == 2 and "2 environments, 16 texels" in repr(many)
    with pytest.raises(ParameterError, match=r"The poses of the target are float64 of shape \(3, 7\): .* \(2, 7\)\."):
        many.step(np.zeros((2, 7)), np.zeros((3, 7)))
    with pytest.raises(ParameterError, match=r"The poses of the sensor are .* of shape \(7,\)"):
        many.step(["far"] * 7, np.zeros((2, 7)))
    with pytest.raises(ParameterError, match=r"The mask of environments to reset is int64 of shape \(1,\)"):
        many.reset(np.array([1]))
    with pytest.raises(ParameterError, match=r"The mask of environments to reset is int32 of shape \(2,\) on cpu"):
        many.reset(warp.zeros(2, dtype=warp.int32, device="cpu"))


def test_warp_is_imported_only_on_demand():
    code = "import sys, palpate; from palpate.core.simulators.warp import warp_sensors; print('warp' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "False"


@pytest.mark.slow("Warp compiles the kernels")
@pytest.mark.parametrize("normal_law", ["linear", "hunt-crossley"])
def test_environments_have_parameters_of_their_own(normal_law):
    """As in PressedSensors; those of which there is no column stay the sensor's."""
    draw = np.random.default_rng(3)
    columns = {name: draw.uniform(low, high, 4) for name, low, high in (
        ("k", 500.0, 2000.0), ("cn", 0.0, 5.0), ("mus", 0.3, 1.2), ("mud", 0.1, 0.3), ("gain", 0.5, 2.0), ("zero", -1.0, 1.0),
        ("exponent", 1.2, 2.0),
    )}  # fmt: skip
    item, poses = pad(5, 4, normal_law=normal_law), random_poses(8, 5, 4)
    core = PressedSensors(item, SHAPE, DT, 4, parameters=columns)
    ours, same = WarpSensors(item, SHAPE, DT, 4, parameters=columns), WarpSensors(item, SHAPE, DT, 4)
    for now in poses:
        expected = core.step(now[:, 0], now[:, 1])
        found = ours.step(now[:, 0], now[:, 1])
        same.step(now[:, 0], now[:, 1])
        for name in ("texels", "readings", "wrench"):
            assert np.abs(getattr(found, name).numpy().reshape(-1) - getattr(expected, name).reshape(-1)).max() < AGREE
    assert np.abs(ours.texels.numpy() - same.texels.numpy()).max() > 1e-3


@pytest.mark.long("Warp compiles kernels for these effects")
def test_environments_have_effects_of_their_own():
    """On forces, on friction and on readings, beside stiffness and gain."""
    item = pad(4, 3, points_per_texel=4)
    names = ("creep", "viscous-friction", "lag")
    item = replace(item, sensor=replace(item.sensor, effects=tuple(effect(name) for name in names)))
    columns = {
        "k": np.linspace(500.0, 2000.0, 4),
        "gain": np.linspace(0.5, 2.0, 4),
        "effect.creep.amount": np.linspace(0.0, 0.5, 4),
        "effect.creep.time": np.linspace(0.02, 0.1, 4),
        "effect.viscous-friction.viscosity": np.linspace(0.0, 5.0, 4),
        "effect.lag.time": np.linspace(0.01, 0.1, 4),
    }
    core = PressedSensors(item, SHAPE, DT, 4, parameters=columns)
    ours, same = WarpSensors(item, SHAPE, DT, 4, parameters=columns), WarpSensors(item, SHAPE, DT, 4)
    for now in random_poses(8, 6, 4):
        expected, found = core.step(now[:, 0], now[:, 1]), ours.step(now[:, 0], now[:, 1])
        same.step(now[:, 0], now[:, 1])
        for name in ("texels", "readings", "wrench"):
            assert np.abs(getattr(found, name).numpy().reshape(-1) - getattr(expected, name).reshape(-1)).max() < AGREE
    for one in (0, 3):
        assert np.abs(ours.readings.numpy()[one] - same.readings.numpy()[one]).max() > 1e-3


def test_more_environments_than_memory_are_one_sentence(monkeypatch):
    from palpate.core.simulators.warp import warp_sensors

    monkeypatch.setattr(warp_sensors, "available_memory", lambda: 1e6)
    with pytest.raises(ParameterError, match=r"100000 environments take .* GiB of memory, .* ask for \d+ at most\.$"):
        WarpSensors(pad(4, 4), SHAPE, DT, 100_000)
