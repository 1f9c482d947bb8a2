# SPDX-License-Identifier: GPL-3.0-or-later
"""A step under a given load on Warp: a block of threads searches for the displacement of the target in one environment.

As in :mod:`.load_balance`, each trial of the search is a whole step from the state at its beginning. A search ends after
MOST_RUNS trials at the latest, and none asks anything of the host.
"""

from __future__ import annotations

import math

import numpy as np

from ...geometry.bvh import Tree
from ...geometry.rotations import write_rotation
from ...solver.detection.shape_contacts import write_pose
from ...solver.pressing import are_poses
from ..load_search import DONE, PHASE, LoadSearch, advance_search, begin_search, forget_load, place_trial
from .block import block_sum, wait_for_block
from .press_arrays import Jumps, Results, SensorArrays, Slots, TargetArrays, Worlds
from .press_kernels import (
    begin_point,
    end_step,
    find_contact,
    mark_jumps,
    move_world,
    place_next,
    press_points,
    sum_world,
    write_reading,
)


def balance_world(
    world: int, lane: int, lanes: int, degrees: int, sensor: SensorArrays, targets: TargetArrays, tree: Tree, worlds: Worlds,
    slots: Slots, jumps: Jumps, out: Results, start: Slots, search: LoadSearch,
) -> None:  # fmt: skip
    """Run a step of an environment under a load with so many components, which :attr:`.LoadSearch.given` holds.

    The threads of a block share contact points and texels (see :func:`.finish_world`); the first one searches.
    """
    whole, begins, first = are_poses(worlds.poses[world]), worlds.begins[world], lane == 0
    for i in range(degrees):
        if not abs(search.given[world, i]) < math.inf:
            whole = False
    wait_for_block()
    if first:
        for i in range(7):
            search.engine[world, i] = worlds.poses[world, 1, i]
        if begins or not whole:
            forget_load(world, search)
        worlds.valid[world] = whole
        worlds.begins[world] = False
        if whole:
            _begin_search(world, degrees, begins, worlds, search)
    wait_for_block()
    if whole:
        for point in range(lane, slots.pressed.shape[2], lanes):
            if begins:
                begin_point(world, point, slots)
                find_contact(world, 0, point, sensor, targets, tree, worlds, slots)
            _copy_slot(world, point, slots, start)
    going = True
    while going:
        if whole:
            for point in range(lane, slots.pressed.shape[2], lanes):
                _copy_slot(world, point, start, slots)
            if first:
                place_trial(world, worlds.poses[world, 1], search)
        wait_for_block()
        if whole:
            move_world(world, lane, lanes, sensor, worlds)
        wait_for_block()
        touching = 0.0
        for texel in range(lane, out.texels.shape[1], lanes):
            if press_points(world, texel, sensor, targets, tree, worlds, slots, out) > 0.0:
                touching = 1.0
        wait_for_block()
        sum_world(world, lane, lanes, sensor, worlds, slots, out)
        touching = block_sum(touching)
        if whole and first:
            advance_search(world, out.wrench[world, 0], touching > 0.0, search)
        wait_for_block()
        going = whole and search.state[world, PHASE] != DONE
    if first:
        worlds.fresh[world] = begins
        for i in range(6):
            unit = search.extent[1] if i >= 3 else 1.0
            search.residual[world, i] = -search.excess[world, i] * unit if i < degrees else 0.0
    wait_for_block()
    for texel in range(lane, out.texels.shape[1], lanes):
        write_reading(world, texel, out.texels[world, texel, 0], sensor, worlds, slots, out)
    mark_jumps(world, lane, lanes, worlds, jumps, out)
    end_step(world, lane, lanes, worlds)
    if first:
        for i in range(7):
            worlds.poses[world, 1, i] = search.engine[world, i]


def _begin_search(world: int, degrees: int, begins: bool, worlds: Worlds, search: LoadSearch) -> None:
    """Begin to search; a new environment is at rest at the engine's poses before."""
    at, quaternion, rotation = np.zeros((2, 3)), np.zeros((2, 4)), np.zeros((2, 3, 3))
    for body in range(2):
        place_next(worlds.poses[world, body], at[body], quaternion[body])
        write_rotation(quaternion[body], rotation[body])
    begin_search(world, degrees, rotation[0], search)
    if begins:
        write_pose(0, 1, at, rotation, worlds.pose[world, 0])
        for body in range(2):
            place_next(worlds.poses[world, body], worlds.position[world, body], worlds.quaternion[world, body])


def _copy_slot(world: int, point: int, slots: Slots, to: Slots) -> None:
    """Copy what a contact point remembers, apart from its force."""
    to.pressed[world, 0, point] = slots.pressed[world, 0, point]
    to.triangle[world, 0, point] = slots.triangle[world, 0, point]
    to.depth[world, 0, point] = slots.depth[world, 0, point]
    for i in range(3):
        to.normal[world, 0, i, point] = slots.normal[world, 0, i, point]
        to.bristle[world, 0, i, point] = slots.bristle[world, 0, i, point]
    for law in range(slots.memory.shape[2]):
        for i in range(slots.memory.shape[3]):
            to.memory[world, point, law, i] = slots.memory[world, point, law, i]
