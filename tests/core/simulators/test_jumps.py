# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets that go through a sensor within a step: one sentence that names the environment, and the others go on."""

from __future__ import annotations

import numpy as np
import pytest
from exported_sensors import ball, pad
from pressed_poses import DT, LEVEL, pose
from solver_scenes import box

from palpate.core.errors import ParameterError
from palpate.core.geometry import shapes
from palpate.core.simulators.pressed_sensor import PressedSensor
from palpate.core.simulators.pressed_sensors import PressedSensors

SIZE = 0.02
TARGETS = {
    "mesh": box(SIZE, SIZE, SIZE),
    "box": shapes.box((SIZE, SIZE, SIZE)),
    "sphere": shapes.sphere(SIZE / 2),
    "capsule": shapes.capsule(SIZE / 2, 0.01),
}


def at(z, x=0.0, turn=(1.0, 0.0, 0.0, 0.0)):
    return np.array([x, 0.0, z, *(3.0 * np.array(turn))])  # quaternions of any length are taken


PATHS = {
    "through, from the front": ([at(0.03), at(-0.05)], True),
    "through, from behind": ([at(-0.05), at(0.03)], True),
    "through, out of contact": ([at(0.008), at(-0.05)], True),
    "beside it": ([at(0.03, 0.2), at(-0.05, 0.2)], False),
    "along it": ([at(0.03, -0.2), at(0.03, 0.2)], False),
    "off it": ([at(0.008), at(0.05)], False),
    "onto it": ([at(0.05), at(0.008)], False),
    "into it, too deep": ([at(0.05), at(-0.008)], False),
    "at rest": ([at(0.03), at(0.03)], False),
}


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("path", PATHS)
def test_a_target_that_goes_through_is_said(path, target):
    """The other environment, in which the target rests on the pad, goes on as alone."""
    (before, after), jumps = PATHS[path]
    jumps |= path.startswith("into it") and target == "mesh"  # which does not tell texels in it: nothing is measured
    if target == "capsule" and path == "off it":
        before = at(0.013)
    item, rest = pad(12, 12), at(0.008 if target != "capsule" else 0.013)
    many, alone = PressedSensors(item, TARGETS[target], DT, 2), PressedSensors(item, TARGETS[target], DT, 1)
    for now in (before, after):
        found, expected = many.step(LEVEL, np.stack([rest, now])), alone.step(LEVEL, rest[None])
    assert found.jumped.tolist() == [False, jumps] and found.valid.all()
    assert np.array_equal(found.texels[0], expected.texels[0]) and expected.contact.any()
    said = "In 1 of 2 environments a target went through the sensor within one step (1): take shorter steps, or reset where"
    assert found.fault().startswith(said) if jumps else found.fault() == ""
    assert not many.step(LEVEL, np.stack([rest, after])).jumped.any(), "only the step in which it went through"


@pytest.mark.parametrize("path", PATHS)
def test_a_single_sensor_says_it_and_goes_on(path):
    (before, after), jumps = PATHS[path]
    single = PressedSensor(pad(12, 12), TARGETS["sphere"], DT, pose(LEVEL), pose(before))
    single.step(pose(LEVEL), pose(before))  # a first step as fast as the jump is refused
    if jumps:
        with pytest.raises(ParameterError, match="^A target went through the sensor within one step: take shorter steps, or"):
            single.step(pose(LEVEL), pose(after))
    else:
        single.step(pose(LEVEL), pose(after))
    single.step(pose(LEVEL), pose(after))
    single.reset(pose(LEVEL), pose(before))
    single.step(pose(LEVEL), pose(before))


def test_the_sensor_may_be_what_moves():
    """It turns about a far point, and its ball of texels passes the target."""
    item, target = ball(), shapes.sphere(0.01)
    radius = np.linalg.norm(item.sensor.texels.position, axis=1).max()
    sensor = [np.array([x, 0.0, 0.0, np.cos(a / 2), 0.0, 0.0, np.sin(a / 2)]) for x, a in ((-0.2, 0.3), (0.2, 0.3))]
    many = PressedSensors(item, target, DT, 1)
    for number, jumps in ((0, False), (1, True)):
        found = many.step(sensor[number][None], LEVEL[None] * [1, 1, 1, 1, 1, 1, 1])
        assert found.jumped.tolist() == [jumps]
    assert radius < 0.1


def test_environments_that_begin_or_have_no_pose_do_not_jump():
    many = PressedSensors(pad(8, 8), TARGETS["sphere"], DT, 3)
    front, behind, none = at(0.03), at(-0.05), np.full(7, np.nan)
    many.step(LEVEL, np.stack([front] * 3))
    many.reset(np.array([True, False, False]))
    found = many.step(LEVEL, np.stack([behind, none, behind]))
    assert found.jumped.tolist() == [False, False, True] and found.valid.tolist() == [True, False, True]
    assert found.fault().startswith("1 of 3 environments have a pose") and "one step (2): " in found.fault()
    assert not many.step(LEVEL, np.stack([behind] * 3)).jumped.any()


def test_of_open_meshes_and_planes_no_inside_is_known():
    sheet = TARGETS["mesh"]
    sheet = type(sheet)(sheet.vertices, sheet.triangles[:-1])
    for target in (sheet, shapes.plane()):
        many = PressedSensors(pad(8, 8), [target, TARGETS["sphere"]], DT, 1)
        for z in (0.03, -0.05):
            found = many.step(LEVEL, np.stack([[at(z, 0.0, (0.0, 1.0, 0.0, 0.0)), at(0.3)]]))
        assert not found.jumped.any()


@pytest.mark.slow("Warp compiles the kernels")
@pytest.mark.parametrize("target", TARGETS)
def test_warp_finds_the_same_jumps(target):
    """Of all paths at once, also of one that begins and one that has no pose."""
    pytest.importorskip("warp", reason="Warp runs the kernels: pip install warp-lang")
    from palpate.core.simulators.warp.warp_sensors import WarpSensors

    steps = np.stack([np.stack(poses) for poses, _ in PATHS.values()], axis=1)
    steps = np.concatenate([steps, steps[:, :2]], axis=1)
    steps[1, -1] = np.nan
    core, ours = (kind(pad(12, 12), TARGETS[target], DT, steps.shape[1]) for kind in (PressedSensors, WarpSensors))
    for now in (*steps, steps[1], steps[0]):
        found = core.step(LEVEL, now)
        ours.step(np.tile(LEVEL, (len(now), 1)), now)
        assert ours.jumped.numpy().tolist() == found.jumped.tolist() and ours.fault() == found.fault()
        mask = np.arange(len(now)) == len(now) - 2
        core.reset(mask)
        ours.reset(mask)
        if now is steps[1]:
            assert found.jumped[:2].all()
