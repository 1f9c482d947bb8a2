# SPDX-License-Identifier: GPL-3.0-or-later
"""How the sums of each pair enter the linear system of a step, and which forces follow from its solution (kernels)."""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.rotations import add_triple_product
from ..detection.detection_data import LANES
from ..solver_model import Pairs, SolverModel, State
from ..workspace import LinearSystem, Workspace
from .modes import write_map


@inlined
def is_first_part(pair: int, pairs: Pairs) -> bool:
    """True for the first contact part of this sensor–target pair."""
    return pair == 0 or pairs.sensor[pair] != pairs.sensor[pair - 1] or pairs.target[pair] != pairs.target[pair - 1]


@inlined
def is_last_part(pair: int, pairs: Pairs) -> bool:
    """True for the last contact part of this sensor–target pair."""
    return (
        pair + 1 == len(pairs.sensor)
        or pairs.sensor[pair] != pairs.sensor[pair + 1]
        or pairs.target[pair] != pairs.target[pair + 1]
    )


@inlined
def sum_pair_parts(pair: int, model: SolverModel, workspace: Workspace) -> bool:
    """Add the sums of :mod:`.contact_assembly` over the parts of a pair; True when the last part is in and anything touches."""
    sums, block, wrench = workspace.pairs.sums[pair], workspace.system.block, workspace.system.wrench
    if is_first_part(pair, model.pairs):
        block[:], wrench[:] = 0.0, 0.0
    if workspace.contacts.number[pair] > 0:
        at = 0
        for i in range(6):
            for j in range(i + 1):
                block[i, j] += sums[at]
                at += LANES
        for i in range(6):
            wrench[i] += sums[at]
            at += LANES
    last = is_last_part(pair, model.pairs)
    scale = workspace.energy.scale[pair]
    if last and scale < 1.0:
        for i in range(6):
            wrench[i] *= scale
            for j in range(i + 1):
                block[i, j] *= scale
    return last and block[0, 0] + block[1, 1] + block[2, 2] > 0.0  # zero where nothing touches


@inlined
def add_pair_to_system(pair: int, dt: float, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Add a pair's sums to the linear system, all parts together with the last."""
    if not sum_pair_parts(pair, model, workspace):
        return
    a, b, system = model.pairs.sensor_body[pair], model.pairs.target_body[pair], workspace.system
    map_a, map_b, wrench, vector = system.map_a, system.map_b, system.wrench, system.vector
    at_a, width_a = write_map(a, a, -1.0, model, state, workspace, map_a)
    at_b, width_b = write_map(b, a, 1.0, model, state, workspace, map_b)
    for j in range(6):
        for i in range(width_a):
            vector[at_a + i] += dt * map_a[j, i] * wrench[j]
        for i in range(width_b):
            vector[at_b + i] += dt * map_b[j, i] * wrench[j]
    if width_a > 0:
        _add_block((at_a, width_a), map_a, (at_a, width_a), map_a, dt, system)
    if width_b > 0:
        _add_block((at_b, width_b), map_b, (at_b, width_b), map_b, dt, system)
    if width_a > 0 and width_b > 0:
        if at_a >= at_b:  # only the lower triangle of the system is read
            _add_block((at_a, width_a), map_a, (at_b, width_b), map_b, dt, system)
        if at_b >= at_a:  # coupled bodies share their unknown: both of the mixed products count there
            _add_block((at_b, width_b), map_b, (at_a, width_a), map_a, dt, system)


@kernel
def _add_block(
    rows: tuple[int, int], left: np.ndarray, columns: tuple[int, int], right: np.ndarray, dt: float, system: LinearSystem
) -> None:
    """Add ``dt · leftᵀ block right`` to the matrix; `rows` and `columns` are where it begins and how wide it is."""
    row, left_width = rows
    column, right_width = columns
    if left_width == 6 and right_width == 6:  # the usual case with constant widths, which the compiler unrolls
        add_triple_product(system.matrix, row, column, left, 6, system.block, right, 6, dt)
    else:
        add_triple_product(system.matrix, row, column, left, left_width, system.block, right, right_width, dt)


@kernel
def write_pair_forces(model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write the force and torque of each pair on its target that belong to the system's solution, all parts with the last."""
    system, energy = workspace.system, workspace.energy
    for pair in range(len(model.pairs.sensor)):
        if not energy.tracked[pair]:
            continue
        found = sum_pair_parts(pair, model, workspace)
        if found:
            a, b = model.pairs.sensor_body[pair], model.pairs.target_body[pair]
            _subtract_resistance(a, a, -1.0, model, state, workspace)
            _subtract_resistance(b, a, 1.0, model, state, workspace)
        for i in range(6):
            energy.new_force[pair, i] = system.wrench[i] if found else 0.0


@kernel
def _subtract_resistance(
    body: int, sensor_body: int, sign: float, model: SolverModel, state: State, workspace: Workspace
) -> None:
    """Subtract from a pair's wrench the force with which its contacts resist a body's motion."""
    system = workspace.system
    at, width = write_map(body, sensor_body, sign, model, state, workspace, system.map_a)
    for j in range(6):
        along = 0.0
        for i in range(width):
            along += system.map_a[j, i] * system.vector[at + i]
        for i in range(6):
            system.wrench[i] -= (system.block[i, j] if j <= i else system.block[j, i]) * along
