# SPDX-License-Identifier: GPL-3.0-or-later
"""A step under a given load on Warp: one thread searches for the displacement of the target in one environment.

As in :mod:`.load_balance`, each trial of the search is a whole step from the state at its beginning. A search ends after
MOST_RUNS trials at the latest, and none asks anything of the host.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...geometry.bvh import Tree
from ...geometry.rotations import write_rotation
from ..load_search import DONE, PHASE, LoadSearch, advance_search, begin_search, forget_load, place_trial, residual
from .press_arrays import BoolArray, Results, SensorArrays, Slots, TargetArrays, Worlds
from .press_kernels import (
    are_poses,
    begin_point,
    copy_row,
    find_contact,
    move_world,
    place_next,
    press_points,
    sum_world,
    write_pose,
    write_reading,
)


class Beginning(NamedTuple):
    """Where the bodies of E environments are at the beginning of a step, and what it gives.

    Attributes
    ----------
    engine : (E, 7) float
        Pose of the target that the other program has.
    position, quaternion : (E, 2, 3), (E, 2, 4) float
    begins : (E,) bool
        The environment begins with this step.
    residual : (E, 6) float, N and N·m
        Part of the load that the contact does not exert.
    """

    engine: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    begins: BoolArray
    residual: np.ndarray

    @classmethod
    def zero(cls, e: int) -> Beginning:
        """Allocate them."""
        return cls(np.zeros((e, 7)), np.zeros((e, 2, 3)), np.zeros((e, 2, 4)), np.zeros(e, np.bool_), np.zeros((e, 6)))


def balance_world(
    world: int, degrees: int, sensor: SensorArrays, targets: TargetArrays, tree: Tree, worlds: Worlds, slots: Slots,
    out: Results, start: Slots, beginning: Beginning, search: LoadSearch,
) -> None:  # fmt: skip
    """Run a step of an environment under a load with so many components, which :attr:`.LoadSearch.given` holds."""
    whole = are_poses(worlds.poses[world])
    for i in range(degrees):
        if not abs(search.given[world, i]) < math.inf:
            whole = False
    beginning.begins[world] = worlds.begins[world]
    copy_row(worlds.poses[world, 1], beginning.engine[world])
    if worlds.begins[world] or not whole:
        forget_load(world, search)
    if whole and worlds.begins[world]:
        _begin_world(world, sensor, targets, tree, worlds, slots)
    worlds.begins[world] = not whole
    worlds.valid[world] = whole
    if whole:
        _copy_bodies(worlds.position[world], worlds.quaternion[world], beginning.position[world], beginning.quaternion[world])
        _copy_slots(world, slots, start)
        place_next(worlds.poses[world, 0], worlds.next_position[world, 0], worlds.next_quaternion[world, 0])
        write_rotation(worlds.next_quaternion[world, 0], worlds.rotation[world, 0])
        begin_search(world, degrees, worlds.rotation[world, 0], search)
    going = True
    while going:
        if whole:
            _copy_bodies(
                beginning.position[world], beginning.quaternion[world], worlds.position[world], worlds.quaternion[world]
            )
            _copy_slots(world, start, slots)
            place_trial(world, beginning.engine[world], worlds.poses[world, 1], search)
            move_world(world, sensor, worlds)
        touching = False
        for texel in range(out.texels.shape[1]):
            press_points(world, texel, sensor, targets, tree, worlds, slots, out)
            if out.texels[world, texel, 0] > 0.0:
                touching = True
        sum_world(world, worlds, slots, out)
        if whole:
            advance_search(world, out.wrench[world, 0], touching, search)
        going = whole and search.state[world, PHASE] != DONE
    copy_row(beginning.engine[world], worlds.poses[world, 1])
    worlds.fresh[world] = beginning.begins[world]
    for texel in range(out.texels.shape[1]):
        write_reading(world, texel, sensor, worlds, slots, out)
    for i in range(6):
        beginning.residual[world, i] = residual(world, i, search) if i < degrees else 0.0


def _begin_world(
    world: int, sensor: SensorArrays, targets: TargetArrays, tree: Tree, worlds: Worlds, slots: Slots
) -> None:  # fmt: skip
    """Let an environment begin at the engine's poses, at rest, and find its contacts there."""
    for body in range(worlds.poses.shape[1]):
        place_next(worlds.poses[world, body], worlds.position[world, body], worlds.quaternion[world, body])
        write_rotation(worlds.quaternion[world, body], worlds.rotation[world, body])
    for target in range(worlds.pose.shape[1]):
        write_pose(worlds.position[world], worlds.rotation[world], 1 + target, worlds.pose[world, target])
    for point in range(slots.pressed.shape[2]):
        begin_point(world, point, slots)
        for target in range(slots.pressed.shape[1]):
            find_contact(world, target, point, sensor, targets, tree, worlds, slots)


def _copy_bodies(position: np.ndarray, quaternion: np.ndarray, to_position: np.ndarray, to_quaternion: np.ndarray) -> None:
    """Copy positions (2, 3) and quaternions (2, 4) of sensor and target."""
    for body in range(2):
        for i in range(3):
            to_position[body, i] = position[body, i]
        for i in range(4):
            to_quaternion[body, i] = quaternion[body, i]


def _copy_slots(world: int, slots: Slots, to: Slots) -> None:
    """Copy what contact points remember, apart from their forces."""
    for point in range(slots.pressed.shape[2]):
        to.pressed[world, 0, point] = slots.pressed[world, 0, point]
        to.triangle[world, 0, point] = slots.triangle[world, 0, point]
        to.depth[world, 0, point] = slots.depth[world, 0, point]
        for i in range(3):
            to.normal[world, 0, point, i] = slots.normal[world, 0, point, i]
            to.point[world, 0, point, i] = slots.point[world, 0, point, i]
            to.bristle[world, 0, point, i] = slots.bristle[world, 0, point, i]
        for law in range(slots.memory.shape[2]):
            for i in range(slots.memory.shape[3]):
                to.memory[world, point, law, i] = slots.memory[world, point, law, i]
