# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sensor's effects make of its contacts while a step is solved, and what they remember of it (kernels).

Laws are written for a whole texel; one of several contact points has its share of the force at its own depth. Each point
has a memory of its own, whatever presses on it; of several targets at one point the deepest counts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled.kernels import kernel
from ...effects.engine import compiled_program
from ...effects.engine.compiled_program import (
    DAMPING,
    FACTOR,
    FORCE,
    RATE,
    SLOPE,
    VISCOUS,
    EffectProgram,
    apply_force_laws,
    apply_friction_laws,
    press,
)
from ...laws.contact_law import LINEAR_EXPONENT, ContactLaw, whole_texel_law, with_friction
from ..contact_rows import EXTRA_VISCOSITY, FRICTION_SCALE, LANES, NORMAL_BIAS, NORMAL_SLOPE
from ..solver_model import SolverModel
from ..workspace import Workspace

STEP, NOW = 0, 1
"""Lengths of time that laws are made for: a step, and none at all."""


class ColumnPlace(NamedTuple):
    """Place of a point in the columns of :mod:`.compiled_program`: column c is at ``[block, c · stride + point]``.

    Attributes
    ----------
    block, stride, point : int
    """

    block: int
    stride: int
    point: int


class PointMotion(NamedTuple):
    """How a contact point is pressed.

    Attributes
    ----------
    depth, rate : float, m and m/s
    slide, speed : float, m and m/s
        Distance slid in the step, and speed of sliding.
    """

    depth: float
    rate: float
    slide: float
    speed: float


@kernel
def has_effects(sensor: int, program: EffectProgram) -> bool:
    """Whether any effect acts on the forces of a sensor."""
    laws = program.start[sensor] < program.start[sensor + 1]
    return laws or program.friction_start[sensor] < program.friction_start[sensor + 1]


@kernel
def may_pull(sensor: int, program: EffectProgram) -> bool:
    """Whether the normal force of a sensor may be below zero."""
    return program.clip[sensor] < program.start[sensor + 1]


@kernel
def press_texel(
    columns: np.ndarray, place: ColumnPlace, pair: int, motion: PointMotion, law: ContactLaw, model: SolverModel
) -> None:
    """Write what the normal law of a whole texel gives (see :func:`.press`).

    Parameters
    ----------
    columns : (blocks, COLUMNS · stride) float
        Written at `place`.
    place : ColumnPlace
    pair : int
    motion : PointMotion
        Of both surfaces together. Where two sensors press on each other, each law gets its own share of the depth.
    law : ContactLaw
        Of one contact point.
    model : SolverModel
    """
    part = model.pairs.overlap_share[pair]
    whole = whole_texel_law(law, model.pairs.force_share[pair], part)
    depth, rate = part * motion.depth, part * motion.rate
    press(columns, place.block, place.stride, place.point, depth, rate, motion.slide, motion.speed, whole)


@kernel
def apply_effects(
    pair: int,
    when: int,
    place: ColumnPlace,
    count: int,
    law: ContactLaw,
    model: SolverModel,
    memory: np.ndarray,
    workspace: Workspace,
) -> None:
    """Let effects act on contacts of a pair that :func:`press_texel` wrote, as if each pressed on a whole texel.

    Parameters
    ----------
    pair : int
    when : int
        STEP where depths are those at the step's end, NOW where no time has passed since the last step.
    place : ColumnPlace
        Row of the first of the contacts.
    count : int
        How many contacts, all of one block.
    law : ContactLaw
    model : SolverModel
    memory : (N, columns) float
    workspace : Workspace
    """
    sensor, linear = model.pairs.sensor[pair], law.exponent == LINEAR_EXPONENT
    offset = model.pairs.first_point[pair] - model.pairs.first_slot[pair]  # from a slot to its contact point
    columns, slots, slot = workspace.effects.contacts, workspace.contacts.slots, place.block * LANES + place.point
    apply_force_laws(
        sensor, when, columns, place.block, LANES, place.point, count, slots, slot, offset, linear, model.effects, memory, False
    )
    apply_friction_laws(sensor, columns, place.block, LANES, place.point, count, slots, model.effects, memory)


@kernel
def write_tangent(
    pair: int, block: int, lane: int, dt: float, model: SolverModel, columns: np.ndarray, rows: np.ndarray
) -> None:
    """Turn what the effects made of a contact into its row: tangent of the normal law, multiplier and viscosity of friction.

    A slope below zero, which no implicit step can use, counts as zero.
    """
    share, rate = model.pairs.force_share[pair], columns[block, RATE * LANES + lane]
    force, slope = share * columns[block, FORCE * LANES + lane], 0.0
    if columns[block, compiled_program.DEPTH * LANES + lane] > 0.0:
        by_depth, by_rate = columns[block, SLOPE * LANES + lane], columns[block, DAMPING * LANES + lane]
        slope = share * max(by_depth * dt + by_rate, 0.0)
    rows[block, NORMAL_BIAS + lane] = force - slope * rate
    rows[block, NORMAL_SLOPE + lane] = model.pairs.overlap_share[pair] * slope
    rows[block, FRICTION_SCALE + lane] = rows[block, FRICTION_SCALE + lane] * columns[block, FACTOR * LANES + lane]
    rows[block, EXTRA_VISCOSITY + lane] = share * columns[block, VISCOUS * LANES + lane]


@kernel
def force_and_friction_law(
    pair: int, block: int, lane: int, law: ContactLaw, model: SolverModel, columns: np.ndarray
) -> tuple[float, ContactLaw]:
    """Normal force of a contact point (N), and its law with the friction that the effects make."""
    share = model.pairs.force_share[pair]
    factor, viscous = columns[block, FACTOR * LANES + lane], share * columns[block, VISCOUS * LANES + lane]
    return share * columns[block, FORCE * LANES + lane], with_friction(law, factor, viscous)
