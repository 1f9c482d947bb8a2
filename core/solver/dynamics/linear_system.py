# SPDX-License-Identifier: GPL-3.0-or-later
"""How the sums of each pair enter the linear system of a step, and what its solution means for them (kernels)."""

from __future__ import annotations

from ...compiled.kernels import inlined, kernel
from ...geometry.rotations import FREE, KEYFRAMED, add_triple_product, project_on_axis, write_twist_map
from ...laws.contact import LANES


@inlined
def is_last_part(pair, pairs):
    """Whether none of the parts of a large sensor follows that a target meets."""
    return pair + 1 == len(pairs) or pairs[pair, 0] != pairs[pair + 1, 0] or pairs[pair, 1] != pairs[pair + 1, 1]


@inlined
def sum_pair_parts(pair, model, workspace):
    """Add up what :mod:`.contact_assembly` left for the parts of a pair; return whether that is all and anything touches."""
    pairs, sums, block, wrench = model.pairs, workspace.sums[pair], workspace.block, workspace.wrench
    if pair == 0 or pairs[pair, 0] != pairs[pair - 1, 0] or pairs[pair, 1] != pairs[pair - 1, 1]:
        block[:], wrench[:] = 0.0, 0.0
    if workspace.contacts[pair] > 0:
        at = 0
        for i in range(6):
            for j in range(i + 1):
                block[i, j] += sums[at]
                at += LANES
        for i in range(6):
            wrench[i] += sums[at]
            at += LANES
    last = is_last_part(pair, pairs)
    share = workspace.hold[pair]
    if last and share < 1.0:
        for i in range(6):
            wrench[i] *= share
            for j in range(i + 1):
                block[i, j] *= share
    return last and block[0, 0] + block[1, 1] + block[2, 2] > 0.0  # zero where nothing touches


@inlined
def add_pair_to_system(pair, a, b, dt, model, state, workspace):
    """Bring a pair's sums into the linear system, all parts together with the last."""
    if not sum_pair_parts(pair, model, workspace):
        return
    map_a, map_b, wrench = workspace.map_a, workspace.map_b, workspace.wrench
    at_a, width_a = _write_map(a, a, -1.0, model, state, workspace, map_a)
    at_b, width_b = _write_map(b, a, 1.0, model, state, workspace, map_b)
    for j in range(6):
        for i in range(width_a):
            workspace.vector[at_a + i] += dt * map_a[j, i] * wrench[j]
        for i in range(width_b):
            workspace.vector[at_b + i] += dt * map_b[j, i] * wrench[j]
    if width_a > 0:
        _add_block(at_a, map_a, width_a, at_a, map_a, width_a, dt, workspace)
    if width_b > 0:
        _add_block(at_b, map_b, width_b, at_b, map_b, width_b, dt, workspace)
    if width_a > 0 and width_b > 0:
        if at_a >= at_b:  # only the lower triangle of the system is read
            _add_block(at_a, map_a, width_a, at_b, map_b, width_b, dt, workspace)
        if at_b >= at_a:  # coupled bodies share their unknown: both of the mixed products count there
            _add_block(at_b, map_b, width_b, at_a, map_a, width_a, dt, workspace)


@kernel
def _add_block(row, left, left_width, column, right, right_width, dt, workspace):
    if left_width == 6 and right_width == 6:  # the usual case with its widths in plain sight of the compiler
        add_triple_product(workspace.matrix, row, column, left, 6, workspace.block, right, 6, dt)
    else:
        add_triple_product(workspace.matrix, row, column, left, left_width, workspace.block, right, right_width, dt)


@kernel
def _write_map(body, sensor_body, sign, model, state, workspace, out):
    """From a body's unknowns to relative motion in the axes of the sensor's body; returns where they are and how many."""
    gx = state.position[sensor_body, 0] - state.position[body, 0]
    gy = state.position[sensor_body, 1] - state.position[body, 1]
    gz = state.position[sensor_body, 2] - state.position[body, 2]
    if model.kind[body] == KEYFRAMED:
        return -1, 0
    write_twist_map(workspace.rotation[sensor_body], gx, gy, gz, sign, out)
    if model.kind[body] == FREE:
        return model.at[body], 6
    project_on_axis(workspace.axis[body], out)
    return model.at[body], 1


@kernel
def write_pair_forces(model, state, workspace):
    """Write the force and torque of each pair on its target that belong to the system's solution, all parts with the last."""
    for pair in range(len(model.pairs)):
        if not workspace.counted[pair]:
            continue
        found = sum_pair_parts(pair, model, workspace)
        if found:
            a, b = model.sensor_body[model.pairs[pair, 0]], model.target_body[model.pairs[pair, 1]]
            _subtract_reaction(a, a, -1.0, model, state, workspace)
            _subtract_reaction(b, a, 1.0, model, state, workspace)
        for i in range(6):
            workspace.found[pair, i] = workspace.wrench[i] if found else 0.0


@kernel
def _subtract_reaction(body, sensor_body, sign, model, state, workspace):
    """Take from a pair's wrench what its contacts resist a body's motion with."""
    at, width = _write_map(body, sensor_body, sign, model, state, workspace, workspace.map_a)
    for j in range(6):
        along = 0.0
        for i in range(width):
            along += workspace.map_a[j, i] * workspace.vector[at + i]
        for i in range(6):
            workspace.wrench[i] -= (workspace.block[i, j] if j <= i else workspace.block[j, i]) * along
