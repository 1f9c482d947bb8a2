# SPDX-License-Identifier: GPL-3.0-or-later
"""The load given instead of the depth: texels that add up to it, friction along the engine's motion, and what none balances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exported_sensors import ball, pad
from pressed_poses import LEVEL, pose
from scipy.spatial.transform import Rotation
from solver_scenes import box

from palpate.core.compiled.kernels import COMPILED
from palpate.core.effects.engine.registry import effect
from palpate.core.errors import ParameterError
from palpate.core.simulators.pressed_sensor import PressedSensor
from palpate.core.simulators.pressed_sensors import PressedSensors

pytestmark = pytest.mark.skipif(not COMPILED, reason="a search of hundreds of steps takes minutes without numba")

SIZE = 0.04
WEIGHT = 9.81
EXACT = 1e-6  # of the load, as the issue asks; the search ends at a thousandth of it
LAW = {"k": 1000.0, "cn": 10.0, "sigma0": 1000.0, "sigma1": 10.0}


def at(x=0.0, y=0.0, z=0.0):
    return np.array([x, y, SIZE / 2 + z, 1.0, 0.0, 0.0, 0.0])


def pressed_by_box(dt=0.01, item=None):
    return PressedSensor(item or pad(8, 8, **LAW), box(SIZE, SIZE, SIZE), dt, pose(LEVEL), pose(at()))


def resultant(contact, target):
    """The wrench on the target by the own sums of a level sensor's texels: force, and torque about the target's origin."""
    force = -contact.texels.net_force
    return np.concatenate([force, -contact.texels.net_torque - np.cross(target, force)])


@pytest.mark.slow("compiles the step of a loop when it runs first")
@pytest.mark.parametrize("dt", [0.002, 0.005, 0.02])
@pytest.mark.parametrize("kind", ["plain", "hunt-crossley", "effects"])
def test_texels_add_up_to_the_load(dt, kind):
    """A weight that grows, leans and tilts within what friction and the pad carry, at the steps of engines.

    Under Hunt and Crossley's law, which has no jump where texels touch, some are released and touch again.
    """
    law = LAW | ({"normal_law": "hunt-crossley", "k": 30000.0} if kind == "hunt-crossley" else {})
    item = pad(8, 8, **law)
    tilt = 1.0 if kind == "hunt-crossley" else 0.3
    if kind == "effects":
        item = replace(item, sensor=replace(item.sensor, effects=(effect("creep", amount=0.2, time=1.5),)))
    pressed = pressed_by_box(dt, item)
    for step in range(60):
        swing = np.sin(0.2 * step)
        load = np.array([0.8 * swing, -0.6, 0.0, 0.02 * swing, -0.03, 0.004 * swing]) * tilt + [0, 0, WEIGHT, 0, 0, 0]
        load[2] += 2.0 * swing
        contact = pressed.step(pose(LEVEL), pose(at(z=1e-4)), wrench=load)  # the engine leaves a gap
        wrench = np.concatenate([contact.force_on_target, contact.torque_on_target])
        assert wrench == pytest.approx(load, abs=EXACT)
        assert resultant(contact, at()[:3] + [0, 0, 1e-4] + pressed.displacement[:3]) == pytest.approx(load, abs=EXACT)
        assert np.abs(pressed.residual).max() < EXACT


def test_where_damping_jumps_at_most_the_jump_is_left():
    """Linear law, texels that touch again in motion: what is left is less than the damping of those that begin or end."""
    dt = 0.002
    pressed = pressed_by_box(dt)
    where, left, jumps = np.zeros(6), [], []
    for step in range(120):
        swing = np.sin(0.2 * step)
        load = np.array([0.8 * swing, -0.6, WEIGHT + 2.0 * swing, 0.02 * swing, -0.03, 0.004 * swing])
        pressed.step(pose(LEVEL), pose(at(z=1e-4)), wrench=load)
        moved = pressed.displacement - where
        rate = (np.abs(moved[2]) + 0.02 * np.abs(moved[3:]).sum()) / dt  # metres from the target's axis to a texel: below 0.02
        left.append(np.linalg.norm(pressed.residual[:3]))
        jumps.append(8 * LAW["cn"] * rate * (1.0 + 0.435))  # a row of texels, and its friction
        where = pressed.displacement
    left, jumps = np.array(left), np.array(jumps)
    assert (left < np.maximum(jumps, EXACT)).all()
    assert np.mean(left > EXACT) < 0.05


def test_a_load_that_comes_back_is_left_for_one_step_at_most():
    """Linear law: the target is let go and loaded again, across a gap of the engine.

    As it touches, all texels' damping jumps to ``64 cn gap / dt``, and no displacement exerts less. The next step begins where
    it touches, at rest, and the texels add up to the load again.
    """
    dt, gap = 0.02, 1e-4
    pressed, before, left = pressed_by_box(dt), 1.0, 0
    for step in range(300):
        load = max(2.0 + 4.0 * np.sin(0.2 * step), 0.0)
        pressed.step(pose(LEVEL), pose(at(z=gap)), wrench=[0.0, 0.0, load])
        if np.linalg.norm(pressed.residual) > EXACT:
            assert before == 0.0
            assert 0.0 < load < 64 * LAW["cn"] * gap / dt
            assert pressed.residual == pytest.approx([0.0, 0.0, load], abs=EXACT)
            assert pressed.displacement[2] == pytest.approx(-gap, abs=1e-9)
            left += 1
        before = load
    assert left > 5


def test_the_displacement_is_that_of_springs():
    """64 springs of 1,000 N/m under 9.81 N, seen from an engine pose that penetrates by half a millimetre."""
    pressed = pressed_by_box()
    for load in ([WEIGHT], [0.0, 0.0, WEIGHT], [0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0]):
        pressed.reset(pose(LEVEL), pose(at()))
        for _ in range(100):
            contact = pressed.step(pose(LEVEL), pose(at(z=-5e-4)), wrench=load)
        assert contact.texels.normal_force == pytest.approx(WEIGHT / 64, abs=1e-7)
        assert pressed.displacement[2] == pytest.approx(5e-4 - WEIGHT / 64e3, abs=1e-9)
        assert pressed.residual.shape == (len(load),)


def test_a_cube_holds_on_a_slope_for_a_minute():
    """Tilted by 10°: signed shear 1.7035 N, and no creep from the second second to the sixtieth."""
    pressed = pressed_by_box(0.02)
    load = WEIGHT * np.array([0.0, np.sin(np.radians(10.0)), np.cos(np.radians(10.0)), 0.0, 0.0, 0.0])
    for step in range(3000):
        contact = pressed.step(pose(LEVEL), pose(at()), wrench=load)
        if step == 100:
            early = pressed.displacement
    assert contact.texels.net_force == pytest.approx([0.0, -1.7035, -9.6610], abs=1e-4)
    assert np.abs(pressed.displacement - early).max() < 1e-6


def test_a_turned_sensor_carries_the_same_load():
    turn = Rotation.from_rotvec([0.4, -1.1, 2.0])
    place = np.array([1.0, 2.0, -3.0])
    quaternion = np.roll(turn.as_quat(), 1)
    sensor = (place, quaternion)
    target = (place + turn.apply(at()[:3]), quaternion)
    pressed = PressedSensor(pad(8, 8, **LAW), box(SIZE, SIZE, SIZE), 0.01, sensor, target)
    force = turn.apply([0.5, 0.2, WEIGHT])
    for _ in range(5):
        contact = pressed.step(sensor, target, wrench=force)
    assert contact.force_on_target == pytest.approx(force, abs=EXACT)
    for _ in range(5):
        contact = pressed.step(sensor, target, wrench=[WEIGHT])
    assert turn.apply([0.0, 0.0, 1.0]) @ contact.force_on_target == pytest.approx(WEIGHT, abs=EXACT)


@pytest.mark.parametrize(
    ("load", "left"),
    [
        ([0.0, 0.0, -5.0, 0.0, 0.0, 0.0], [0.0, 0.0, -5.0, 0.0, 0.0, 0.0]),
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.3], [0.0, 0.0, 0.0, 0.0, 0.0, 0.3]),
        ([0.0, 0.0, -5.0], [0.0, 0.0, -5.0]),
        ([-5.0], [-5.0]),
    ],
    ids=["pull", "torque alone", "pull of three", "pull of one"],
)
def test_what_nothing_balances_is_a_residual(load, left):
    pressed = pressed_by_box()
    contact = pressed.step(pose(LEVEL), pose(at(z=2e-4)), wrench=load)
    assert pressed.residual == pytest.approx(left, abs=1e-12)
    assert not contact.texels.contact.any() and np.abs(pressed.displacement).max() == 0.0
    is_pull = load[-1] < 0.0 or load[2:3] == [-5.0]
    assert ("give the force that the contact exerts on the target" in pressed.residual_reason) == is_pull


@pytest.mark.parametrize("degrees", [6, 3, 1])
def test_a_weight_in_place_of_the_force_that_carries_it_is_named(degrees):
    """The sensor faces down and is turned: the load that its texels exert points down."""
    many = PressedSensors(pad(6, 6, **LAW), box(SIZE, SIZE, SIZE), 0.005, 4, 1)
    upside_down = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    below = at() * [1, 1, -1, 1, 1, 1, 1]
    loads = np.zeros((4, degrees))
    loads[:, 0 if degrees == 1 else 2] = np.array([WEIGHT, -WEIGHT, 0.0, np.nan]) * (-1.0 if degrees == 1 else 1.0)
    many.step(upside_down, np.tile(below, (4, 1)), wrench=loads)
    assert many.residual_reason.startswith("In 1 of 4 environments (0) the load pulls the target off the sensor")
    many.step(upside_down, np.tile(below, (4, 1)), wrench=-loads[[0, 0, 0, 0]])
    assert many.residual_reason == "" and np.abs(many.residual).max() < EXACT
    many.step(upside_down, np.tile(below, (4, 1)))
    assert many.residual_reason == ""


@pytest.mark.parametrize(
    "load",
    [[0.0, 50.0, WEIGHT, 0.0, 0.0, 0.0], [0.0, 0.0, WEIGHT, 3.0, 0.0, 0.0], [0.0, 0.0, 1e5, 0.0, 0.0, 0.0]],
    ids=["beyond friction", "outside the support", "heavier than the pad carries"],
)
def test_a_load_beyond_the_contact_leaves_a_part_and_is_forgotten(load):
    """Found and left add up to the load; everything is finite and near, and the next load that can be carried is."""
    pressed = pressed_by_box()
    for _ in range(20):
        contact = pressed.step(pose(LEVEL), pose(at()), wrench=load)
        found = np.concatenate([contact.force_on_target, contact.torque_on_target])
        assert found + pressed.residual == pytest.approx(load, abs=1e-9 * max(map(abs, load)))
        assert np.abs(pressed.residual).max() > 0.01
        assert np.isfinite(contact.texels.shear).all() and np.abs(pressed.displacement[:3]).max() <= 0.03
    pressed.step(pose(LEVEL), pose(at(z=0.005)), wrench=np.zeros(6))  # points that were pressed too deep come free
    for _ in range(3):  # the first comes down at half a metre per second, whose damping jumps above the weight
        contact = pressed.step(pose(LEVEL), pose(at()), wrench=[0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0])
    assert contact.force_on_target == pytest.approx([0.0, 0.0, WEIGHT], abs=EXACT)


def test_friction_goes_along_with_the_engines_motion():
    """The engine drags the cube at 1 cm/s under its weight: the shear is that of sliding, and points against the motion."""
    dt = 0.005
    item = pad(8, 8, **LAW)
    pressed, p = pressed_by_box(dt, item), item.sensor.parameters
    for step in range(100):
        contact = pressed.step(pose(LEVEL), pose(at(x=0.01 * dt * step)), wrench=[WEIGHT])
    assert contact.force_on_target[2] == pytest.approx(WEIGHT, abs=EXACT)
    sliding = WEIGHT * (p.mud + (p.mus - p.mud) * np.exp(-((0.01 / p.x0) ** 2))) + 64 * p.ct * 0.01
    assert contact.force_on_target[0] == pytest.approx(-sliding, rel=1e-3)


@pytest.mark.slow("searches for the load in twelve environments twice, together and one by one")
def test_environments_have_the_bits_of_single_sensors_under_loads():
    item, dt, count = pad(6, 6, **LAW), 0.005, 12
    draw = np.random.default_rng(4)
    many = PressedSensors(item, box(SIZE, SIZE, SIZE), dt, count, 2)
    ones = [pressed_by_box(dt, item) for _ in range(count)]
    for step in range(6):
        poses = np.tile(at(), (count, 1))
        poses[:, :3] += 1e-4 * draw.standard_normal((count, 3))
        loads = np.array([1.0, 1.0, 4.0, 0.05, 0.05, 0.01]) * draw.standard_normal((count, 6)) + [0, 0, 8, 0, 0, 0]
        contacts = many.step(LEVEL, poses, wrench=loads)
        for number, one in enumerate(ones):
            if step == 0:
                one.reset(pose(LEVEL), pose(poses[number]))
            single = one.step(pose(LEVEL), pose(poses[number]), wrench=loads[number])
            texels = np.column_stack([single.texels.normal_force, single.texels.shear])
            assert np.array_equal(contacts.texels[number], texels)
            assert np.array_equal(many.residual[number], one.residual)
            assert np.array_equal(many.displacement[number], one.displacement)


def test_a_bad_pose_or_load_is_one_environment_that_measures_nothing():
    many = PressedSensors(pad(6, 6, **LAW), box(SIZE, SIZE, SIZE), 0.005, 4, 1)
    assert repr(many) == "<PressedSensors: 4 environments, 36 texels, step 5 ms>"
    poses, loads = np.tile(at(), (4, 1)), np.tile([0.0, 0.0, WEIGHT], (4, 1))
    poses[1, 2], loads[2, 0] = np.nan, np.inf
    contacts = many.step(LEVEL, poses, wrench=loads)
    assert list(contacts.valid) == [True, False, False, True]
    assert (contacts.wrench[1:3] == 0.0).all() and (many.residual[1:3] == 0.0).all()
    assert contacts.wrench[[0, 3], 2] == pytest.approx(WEIGHT, abs=EXACT)
    contacts = many.step(LEVEL, np.tile(at(), (4, 1)), wrench=np.tile([0.0, 0.0, WEIGHT], (4, 1)))
    assert contacts.valid.all() and contacts.wrench[:, 2] == pytest.approx(WEIGHT, abs=EXACT)


def test_a_ball_on_a_fingertip_carries_three_forces():
    item = ball()
    parameters = replace(item.sensor.parameters, k=1000.0, cn=10.0, sigma0=1000.0, sigma1=10.0)
    item = replace(item, sensor=replace(item.sensor, parameters=parameters))
    top = item.sensor.texels.position[np.argmax(item.sensor.texels.position[:, 2])]
    target = np.array([*top, 1.0, 0.0, 0.0, 0.0]) + [0.0, 0.0, SIZE / 2, 0.0, 0.0, 0.0, 0.0]
    pressed = PressedSensor(item, box(SIZE, SIZE, SIZE), 0.01, pose(LEVEL), pose(target))
    for _ in range(10):
        contact = pressed.step(pose(LEVEL), pose(target), wrench=[0.02, 0.0, 0.5])
    assert contact.force_on_target == pytest.approx([0.02, 0.0, 0.5], abs=EXACT)


def test_what_is_no_load_is_one_sentence():
    pressed = pressed_by_box()
    for bad in ([1.0, 2.0], [np.nan], "much", np.zeros((1, 6))):
        with pytest.raises(ParameterError, match="The wrench is not 1, 3 or 6 finite numbers"):
            pressed.step(pose(LEVEL), pose(at()), wrench=bad)
    many = PressedSensors(pad(4, 4), box(SIZE, SIZE, SIZE), 0.01, 2)
    with pytest.raises(ParameterError, match=r"The loads are float64 of shape \(6,\): give numbers of shape \(2, 6\)"):
        many.step(LEVEL, np.tile(at(), (2, 1)), wrench=np.zeros(6))
    twice = PressedSensor(pad(4, 4), [box(SIZE, SIZE, SIZE)] * 2, 0.01, pose(LEVEL), [pose(at())] * 2)
    with pytest.raises(ParameterError, match="A wrench is given for 2 targets"):
        twice.step(pose(LEVEL), [pose(at())] * 2, wrench=[WEIGHT])
