# SPDX-License-Identifier: GPL-3.0-or-later
"""Bring the memory of the sensors' effects to the end of a step (kernels).

Each contact point has a memory of its own, whatever presses on it; of several targets at one point the deepest counts.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import kernel
from ...effects.engine.compiled_program import PointRange, TexelContacts, TexelMotion, apply_force_laws, has_effects
from ...laws.contact_law import LINEAR_EXPONENT, ContactLaw, read_law
from ..contact_rows import DEPTH
from ..solver_model import SolverModel, State
from ..workspace import EffectWork, Workspace
from .effect_kernels import STEP, press_texel
from .relative_kinematics import motion_values, point_law, row_of, row_velocity, write_pair_motion


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
    motion = motion_values(workspace.pairs.motion[pair])
    for r in range(contacts.number[pair]):
        b, lane = row_of(r, pair, contacts)
        point = model.pairs.first_point[pair] + contacts.slots[b, lane] - model.pairs.first_slot[pair]
        vx, vy, vz, rate = row_velocity(b, lane, motion, contacts.deforming[pair], contacts)
        slide = dt * math.sqrt(max(vx * vx + vy * vy + vz * vz - rate * rate, 0.0))
        p, end = point_law(law, model.points.multipliers, point), contacts.rows[b, DEPTH + lane] + dt * rate
        _record_deepest(point, pair, TexelMotion(end, rate, slide, 0.0), p, model, workspace.effects.points)


@kernel
def _record_deepest(
    point: int, pair: int, motion: TexelMotion, law: ContactLaw, model: SolverModel, recorded: TexelContacts
) -> None:
    """Record the contact of a point, if no other contact is deeper."""
    if model.pairs.overlap_share[pair] * motion.depth > recorded.depth[0, point]:
        press_texel(recorded, 0, point, pair, motion, law, model)


@kernel
def _commit_sensor(sensor: int, law: ContactLaw, model: SolverModel, work: EffectWork, memory: np.ndarray) -> None:
    """Bring the memory of a sensor's points to the step's end, and clear what was recorded of them."""
    first, stop = model.sensors.first_point[sensor], model.sensors.first_point[sensor + 1]
    recorded, points = work.points, PointRange(0, first, stop - first, work.point_numbers, first, 0)
    apply_force_laws(sensor, STEP, recorded, points, law.exponent == LINEAR_EXPONENT, model.effects, memory, True)
    for i in range(first, stop):
        recorded.depth[0, i] = recorded.rate[0, i] = recorded.slide[0, i] = recorded.speed[0, i] = 0.0
        recorded.force[0, i] = recorded.by_depth[0, i] = recorded.by_rate[0, i] = 0.0
