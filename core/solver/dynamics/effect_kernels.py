# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects on the contacts of a sensor while a step is solved, and their memory at its end (kernels).

Laws are written for a whole texel; one of several contact points has its share of the force at its own depth. Each point
has a memory of its own, whatever presses on it; of several targets at one point the deepest counts.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import kernel
from ...effects.engine.compiled_program import (
    PointRange,
    TexelContacts,
    TexelMotion,
    apply_force_laws,
    apply_friction_laws,
    has_effects,
    write_base_law,
)
from ...laws.contact_law import LINEAR_EXPONENT, ContactLaw, read_law, whole_texel_law
from ..detection.detection_data import DEPTH, EXTRA_VISCOSITY, FRICTION_SCALE, LANES, NORMAL_BIAS, NORMAL_SLOPE
from ..solver_model import SolverModel, State
from ..workspace import EffectWork, Workspace
from .friction_state import motion_values, point_law, row_of, row_velocity, write_pair_motion

FULL_STEP, NO_TIME = 0, 1
"""Lengths of time that laws are made for: a step, and none at all."""


@kernel
def press_texel(
    contacts: TexelContacts, block: int, point: int, pair: int, motion: TexelMotion, law: ContactLaw, model: SolverModel
) -> None:
    """Write what the normal law of a whole texel gives (see :func:`.write_base_law`).

    Parameters
    ----------
    contacts : TexelContacts
    block, point : int
        Where to write.
    pair : int
    motion : TexelMotion
        Of both surfaces together. Where two sensors press on each other, each law gets its own share of the depth.
    law : ContactLaw
        Of one contact point.
    model : SolverModel
    """
    part = model.pairs.overlap_share[pair]
    whole = whole_texel_law(law, model.pairs.force_share[pair], part)
    own = TexelMotion(part * motion.depth, part * motion.rate, motion.slide_step, motion.speed)
    write_base_law(contacts, block, point, own, whole)


@kernel
def lane_range(pair: int, block: int, first: int, number: int, model: SolverModel, workspace: Workspace) -> PointRange:
    """Return the range of contacts of a pair that begins in a lane of a block."""
    offset = model.pairs.first_point[pair] - model.pairs.first_slot[pair]  # from a slot to its contact point
    return PointRange(block, first, number, workspace.contacts.slots, block * LANES + first, offset)


@kernel
def apply_effects(
    pair: int,
    step_length: int,
    points: PointRange,
    law: ContactLaw,
    model: SolverModel,
    memory: np.ndarray,
    workspace: Workspace,
) -> None:
    """Let effects act on contacts of a pair that :func:`press_texel` wrote, as if each pressed on a whole texel.

    Parameters
    ----------
    pair : int
    step_length : int
        FULL_STEP where depths are those at the step's end, NO_TIME where no time has passed since the last step.
    points : PointRange
        See :func:`lane_range`.
    law : ContactLaw
    model : SolverModel
    memory : (N, state_size) float
    workspace : Workspace
    """
    sensor, linear, contacts = model.pairs.sensor[pair], law.exponent == LINEAR_EXPONENT, workspace.effects.contacts
    apply_force_laws(sensor, step_length, contacts, points, linear, model.effects, memory, False)
    apply_friction_laws(sensor, contacts, points, model.effects, memory)


@kernel
def write_tangent(
    pair: int, block: int, lane: int, dt: float, model: SolverModel, contacts: TexelContacts, rows: np.ndarray
) -> None:
    """Turn what the effects made of a contact into its row: tangent of the normal law, multiplier and viscosity of friction.

    A slope below zero, which no implicit step can use, counts as zero.
    """
    share, rate = model.pairs.force_share[pair], contacts.rate[block, lane]
    force, slope = share * contacts.force[block, lane], 0.0
    if contacts.depth[block, lane] > 0.0:
        slope = share * max(contacts.by_depth[block, lane] * dt + contacts.by_rate[block, lane], 0.0)
    rows[block, NORMAL_BIAS + lane] = force - slope * rate
    rows[block, NORMAL_SLOPE + lane] = model.pairs.overlap_share[pair] * slope
    rows[block, FRICTION_SCALE + lane] = rows[block, FRICTION_SCALE + lane] * contacts.friction_factor[block, lane]
    rows[block, EXTRA_VISCOSITY + lane] = share * contacts.extra_viscosity[block, lane]


@kernel
def commit_effect_memory(dt: float, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Bring the memory of all effects to the step's end, at the velocities of its end."""
    for pair in range(len(model.pairs.sensor)):
        if workspace.contacts.number[pair] > 0 and has_effects(model.pairs.sensor[pair], model.effects):
            write_pair_motion(pair, model, state, workspace)
            _record_pair(pair, dt, model, workspace)
    for pair in range(len(model.pairs.sensor)):
        sensor = model.pairs.sensor[pair]
        if (pair == 0 or model.pairs.sensor[pair - 1] != sensor) and has_effects(sensor, model.effects):
            _commit_sensor(sensor, read_law(model.pairs.law, pair), model, workspace.effects, state.effect_memory)


@kernel
def _record_pair(pair: int, dt: float, model: SolverModel, workspace: Workspace) -> None:
    """Record the contacts of the points of a pair's sensor at the step's end."""
    contacts, law = workspace.contacts, read_law(model.pairs.law, pair)
    motion, recorded = motion_values(workspace.pairs.motion[pair]), workspace.effects.points
    for r in range(contacts.number[pair]):
        b, lane = row_of(r, pair, contacts)
        point = model.pairs.first_point[pair] + contacts.slots[b, lane] - model.pairs.first_slot[pair]
        vx, vy, vz, rate = row_velocity(b, lane, motion, contacts.deforming[pair], contacts)
        slide_step = dt * math.sqrt(max(vx * vx + vy * vy + vz * vz - rate * rate, 0.0))
        p, end = point_law(law, model.points.multipliers, point), contacts.rows[b, DEPTH + lane] + dt * rate
        # Each contact point has a memory of its own, whatever presses on it; of several targets the deepest counts.
        if model.pairs.overlap_share[pair] * end > recorded.depth[0, point]:
            press_texel(recorded, 0, point, pair, TexelMotion(end, rate, slide_step, 0.0), p, model)


@kernel
def _commit_sensor(sensor: int, law: ContactLaw, model: SolverModel, work: EffectWork, memory: np.ndarray) -> None:
    """Bring the memory of a sensor's points to the step's end, and clear what was recorded of them."""
    first, stop = model.sensors.first_point[sensor], model.sensors.first_point[sensor + 1]
    recorded, points = work.points, PointRange(0, first, stop - first, work.point_numbers, first, 0)
    apply_force_laws(sensor, FULL_STEP, recorded, points, law.exponent == LINEAR_EXPONENT, model.effects, memory, True)
    for i in range(first, stop):
        recorded.depth[0, i] = recorded.rate[0, i] = recorded.slide_step[0, i] = recorded.speed[0, i] = 0.0
        recorded.force[0, i] = recorded.by_depth[0, i] = recorded.by_rate[0, i] = 0.0
