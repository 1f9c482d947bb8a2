# SPDX-License-Identifier: GPL-3.0-or-later
"""The linear system of a step: how the sums of each pair enter it, the forces that follow from its solution, and the energy
account that keeps them passive (kernels).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.rotations import add_triple_product
from ...laws.contact_law import ContactLaw
from ...laws.normal_force import elastic_energy
from ..detection.detection_data import DEPTH, LANES, NORMAL, POINT, ROW
from ..solver_model import Pairs, SolverModel, State
from ..workspace import LinearSystem, Workspace
from .modes import add_integration_loss, is_moved_by_path, write_end, write_map


@inlined
def is_first_part(pair: int, pairs: Pairs) -> bool:
    """True for the first contact part of this sensor–target pair."""
    return pair == 0 or pairs.sensor[pair] != pairs.sensor[pair - 1] or pairs.target[pair] != pairs.target[pair - 1]


@inlined
def is_last_part(pair: int, pairs: Pairs) -> bool:
    """True for the last contact part of this sensor–target pair."""
    return pair + 1 == len(pairs.sensor) or is_first_part(pair + 1, pairs)


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


# Passivity of contacts: they store and dissipate energy, and never generate any (kernels).
#
# Each pair of sensor and target has an energy account: all the work that was done on its contacts, less all the work that they
# have done. Springs whose depth jumps, where an edge passes from face to face or a fast body has come too deep within one step,
# would give back more than was put in. Where that would leave less than nothing in the account, the pair's forces on both
# bodies are scaled down in that step. This is the passivity controller of Hannaford and Ryu (IEEE Trans. Robot. Autom. 18,
# 2002) for haptic displays. Resting contacts do no work, and contacts that have lost energy before have some in their account,
# so neither is scaled. Where animation moves one of the bodies it may bring any energy: from then on the pair's forces are
# never scaled.


class Contacts(NamedTuple):
    """The n contacts of one pair.

    Attributes
    ----------
    slots : (n,) int
        Slot of each in :class:`.State`.
    normal : (n, 3) float
        The target's outward normal, in the frame of the sensor's body like the point.
    point : (n, 3) float, metres
        From the body's reference point.
    depth : (n,) float, metres
    """

    slots: np.ndarray
    normal: np.ndarray
    point: np.ndarray
    depth: np.ndarray


def contacts_of(pair: int, workspace: Workspace) -> Contacts:
    """Return the contacts of one pair, as they were found last."""
    number, first = workspace.contacts.number[pair], workspace.contacts.first_block[pair]
    blocks = slice(first, first - (-number // LANES))
    rows = workspace.contacts.rows[blocks].reshape(-1, ROW // LANES, LANES).swapaxes(1, 2).reshape(-1, ROW // LANES)[:number]
    n, p = NORMAL // LANES, POINT // LANES
    slots = workspace.contacts.slots[blocks].ravel()[:number]
    return Contacts(slots, rows[:, n : n + 3], rows[:, p : p + 3], rows[:, DEPTH // LANES])


MAX_BISECTIONS = 24
"""Bisections for the factor on its forces that a pair can pay for."""


def credit_initial_contacts(model: SolverModel, state: State, workspace: Workspace) -> None:
    """Credit contacts that exist at the very start, and were just found, with the energy of their springs."""
    if not workspace.contacts.number.any():
        return
    multipliers, energy = model.points.multipliers, 0.0
    for pair, row in enumerate(model.pairs.law):
        law, contacts = ContactLaw(*row), contacts_of(pair, workspace)
        points = model.pairs.first_point[pair] + contacts.slots - model.pairs.first_slot[pair]
        stiffness = law.k * (multipliers[points, 0] if len(multipliers) else np.ones(len(points)))
        energy += elastic_energy(stiffness, contacts.depth, law.exponent)
        if is_last_part(pair, model.pairs):
            state.stored_energy[pair], energy = energy, 0.0


@kernel
def reset_force_scales(model: SolverModel, state: State, workspace: Workspace) -> None:
    """Let all forces act in full at first; a pair that animation has moved may draw any energy."""
    energy = workspace.energy
    for pair in range(len(energy.scale)):
        energy.scale[pair] = energy.scale_high[pair] = 1.0
        energy.scale_low[pair] = 0.0
        for body in (model.pairs.sensor_body[pair], model.pairs.target_body[pair]):
            if is_moved_by_path(body, model, state):
                state.stored_energy[pair] = math.inf


@kernel
def check_energy(bisection: int, dt: float, model: SolverModel, state: State, workspace: Workspace) -> bool:
    """True when no pair gives more energy than its account holds; then the accounts are brought to the step's end.

    Otherwise the bisection for the factors on the forces of those pairs goes on. A factor of zero costs nothing.
    """
    energy, within_account = workspace.energy, True
    scale = energy.scale
    for body in range(len(model.bodies.mode)):
        write_end(body, dt, model, state, workspace)
    _sum_contact_forces(model, workspace)
    for pair in range(len(model.pairs.sensor)):
        energy.work[pair] = _contact_work(pair, dt, model, state, workspace)
        lost = 0.0
        for body in (model.pairs.sensor_body[pair], model.pairs.target_body[pair]):
            lost = add_integration_loss(lost, body, dt, model, state)
        energy.available[pair] = max(state.stored_energy[pair] + lost, 0.0)
        if energy.work[pair] > energy.available[pair]:
            energy.scale_high[pair], within_account = scale[pair], False
        elif scale[pair] < 1.0:
            energy.scale_low[pair] = scale[pair]
    if (within_account and bisection == 0) or bisection == MAX_BISECTIONS - 1:
        for pair in range(len(model.pairs.sensor)):
            state.stored_energy[pair] -= energy.work[pair]
        return True
    for pair in range(len(model.pairs.sensor)):
        if energy.scale_high[pair] < 1.0 or energy.work[pair] > energy.available[pair]:
            middle = 0.5 * (energy.scale_low[pair] + energy.scale_high[pair])
            scale[pair] = middle if bisection < MAX_BISECTIONS - 2 else energy.scale_low[pair]
    return False


@kernel
def _sum_contact_forces(model: SolverModel, workspace: Workspace) -> None:
    """Add up the sizes of the forces that act on each body, by which its pairs share its :attr:`.BodyWork.unbooked_energy`."""
    total = workspace.bodies.contact_force
    for body in range(len(total)):
        total[body] = 0.0
    for pair in range(len(model.pairs.sensor)):
        size = _force_size(pair, workspace)
        total[model.pairs.sensor_body[pair]] += size
        total[model.pairs.target_body[pair]] += size


@inlined
def _force_size(pair: int, workspace: Workspace) -> float:
    """Size of the force of a pair, N; zero where its energy is not accounted for."""
    force = workspace.energy.force[pair]
    return math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])


@kernel
def _contact_work(pair: int, dt: float, model: SolverModel, state: State, workspace: Workspace) -> float:
    """Work that a pair's forces do in a step on both bodies together, joules.

    Work that is put in is reckoned with the mean of the velocities at both ends, so that all that a body loses is found; work
    that comes out with the velocity at the end if that is more. What a turning body gains besides counts as work of the pairs
    that touch it, by the sizes of their forces.
    """
    force, touches = workspace.energy.force[pair], False
    for i in range(6):
        touches = touches or force[i] != 0.0
    if not touches:
        return 0.0
    a, b, rotation = model.pairs.sensor_body[pair], model.pairs.target_body[pair], workspace.bodies.rotation
    before = _relative_velocity(a, b, workspace.bodies.velocity_before, state.position, rotation)
    after = _relative_velocity(a, b, state.velocity, state.position, rotation)
    mean, end = 0.0, 0.0
    for i in range(6):
        mean += 0.5 * dt * force[i] * (before[i] + after[i])
        end += dt * force[i] * after[i]
    size, besides = _force_size(pair, workspace), 0.0
    for body in (a, b):
        if size > 0.0:
            besides += workspace.bodies.unbooked_energy[body] * (size / workspace.bodies.contact_force[body])
    mean, end = mean + besides, end + besides
    return mean if mean < 0.0 else max(mean, end)


@inlined
def _relative_velocity(a: int, b: int, velocity: np.ndarray, position: np.ndarray, rotation: np.ndarray) -> tuple[float, ...]:
    """Velocity of body `b` relative to body `a`, at the reference point of `a` and in its axes, and angular velocity."""
    gx, gy, gz = position[a, 0] - position[b, 0], position[a, 1] - position[b, 1], position[a, 2] - position[b, 2]
    wx, wy, wz = velocity[b, 3], velocity[b, 4], velocity[b, 5]
    vx = velocity[b, 0] + wy * gz - wz * gy - velocity[a, 0]
    vy = velocity[b, 1] + wz * gx - wx * gz - velocity[a, 1]
    vz = velocity[b, 2] + wx * gy - wy * gx - velocity[a, 2]
    wx, wy, wz = wx - velocity[a, 3], wy - velocity[a, 4], wz - velocity[a, 5]
    return (
        rotation[a, 0, 0] * vx + rotation[a, 1, 0] * vy + rotation[a, 2, 0] * vz,
        rotation[a, 0, 1] * vx + rotation[a, 1, 1] * vy + rotation[a, 2, 1] * vz,
        rotation[a, 0, 2] * vx + rotation[a, 1, 2] * vy + rotation[a, 2, 2] * vz,
        rotation[a, 0, 0] * wx + rotation[a, 1, 0] * wy + rotation[a, 2, 0] * wz,
        rotation[a, 0, 1] * wx + rotation[a, 1, 1] * wy + rotation[a, 2, 1] * wz,
        rotation[a, 0, 2] * wx + rotation[a, 1, 2] * wy + rotation[a, 2, 2] * wz,
    )
