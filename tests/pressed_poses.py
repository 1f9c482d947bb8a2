# SPDX-License-Identifier: GPL-3.0-or-later
"""Random poses of a pad and of an indenter, for sensors in a loop, and the comparison of many with one."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

DT = 0.002
LEVEL = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
SIZE = 0.02


def pose(row):
    return row[:3], row[3:]


def random_poses(seed, steps, environments, targets=1, height=SIZE / 2):
    """(steps, E, 1 + T, 7): boxes that slide, sink in and turn on a pad that moves along."""
    draw = np.random.default_rng(seed)
    shape = (steps, environments, 1 + targets)
    poses = np.zeros((*shape, 7))
    depth = -1e-3 * draw.random(shape[1:]) - 1e-4 * draw.standard_normal(shape)
    poses[..., 0] = 2e-4 * draw.standard_normal(shape) + 0.01 * draw.standard_normal(shape[1:])
    poses[..., 1] = 2e-4 * draw.standard_normal(shape)
    poses[..., 2] = height + depth
    turns = Rotation.from_rotvec(0.01 * draw.standard_normal((np.prod(shape), 3))).as_quat()
    poses[..., 3:] = np.roll(turns, 1, axis=1).reshape(*shape, 4)
    poses[:, :, 0, :3] = 1e-4 * draw.standard_normal((steps, environments, 3))
    return poses * np.array([1.0] * 3 + [1.5] * 4)  # quaternions of any length are taken


def assert_environments_are_singles(many, singles, poses):
    """Take the same steps with both; one of them is reset on the way. Return how many texels touch, over all steps."""
    touched, mask = 0, np.arange(len(singles)) == 1
    for step, now in enumerate(poses):
        if step == len(poses) - 2:
            many.reset(mask)
            singles[1].reset(*map(pose, now[1]))
        found = many.step(now[:, 0], now[:, 1])
        touched += found.contact.sum()
        for number, single in enumerate(singles):
            assert_equal_bits(found, number, single.step(*map(pose, now[number])))
    return touched


def assert_equal_bits(contacts, number, single):
    texels = single.texels
    assert np.array_equal(contacts.texels[number], np.column_stack([texels.normal_force, texels.shear]))
    assert np.array_equal(contacts.readings[number], texels.reading)
    assert np.array_equal(contacts.contact[number], texels.contact)
    wrench = np.concatenate([single.force_on_target, single.torque_on_target], axis=-1)
    assert np.array_equal(contacts.wrench[number], wrench)
