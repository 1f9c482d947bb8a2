# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sensor's effects make of its contacts while a step is solved, and what they remember of it (kernels).

Laws are written for a whole texel; one of several contact points has its share of the force at its own depth. Each point
remembers for itself, whatever presses on it; of several targets at one point the deepest counts.
"""

from __future__ import annotations

import math

from ...compiled.kernels import kernel
from ...effects.engine import compiled_program
from ...effects.engine.compiled_program import (
    DAMPING,
    FACTOR,
    FORCE,
    RATE,
    VISCOUS,
    apply_force_laws,
    apply_friction_laws,
    press,
)
from ...laws.contact import (
    CN,
    CT,
    DEPTH,
    DISSIPATION,
    EXPONENT,
    EXTRA_VISCOSITY,
    FRICTION_SCALE,
    LANES,
    LINEAR,
    MUD,
    MUS,
    NORMAL_BIAS,
    NORMAL_SLOPE,
    NX,
    NY,
    NZ,
    PX,
    PY,
    PZ,
    K,
)
from ..detection.surface_kinematics import SURFACE_VX, SURFACE_VY, SURFACE_VZ
from .relative_kinematics import motion_values, pair_law, point_law, relative_motion, velocity_at

STEP, NOW = 0, 1
"""Lengths of time that laws are made for: a step, and none at all."""


@kernel
def has_effects(sensor, program):
    """Whether anything but the base law acts on the forces of a sensor."""
    laws = program.start[sensor] < program.start[sensor + 1]
    return laws or program.friction_start[sensor] < program.friction_start[sensor + 1]


@kernel
def may_pull(sensor, program):
    """Whether the normal force of a sensor may be below zero."""
    return program.clip[sensor] < program.start[sensor + 1]


@kernel
def press_texel(work, block, stride, i, pair, depth, rate, slide, speed, p, model):
    """Write what the base law makes of a whole texel at a depth (m), rate, way and speed of sliding; see :func:`.press`.

    `p` are the parameters of one contact point. Where two sensors press on each other, each law sees its own part of the depth.
    """
    share, part = model.share[pair], model.part[pair]
    stiff = part if p[EXPONENT] == LINEAR else part ** p[EXPONENT]
    k, cn, dissipation = p[K] / (share * stiff), p[CN] / (share * part), p[DISSIPATION] / part
    press(work, block, stride, i, part * depth, part * rate, slide, speed, k, cn, p[EXPONENT], dissipation)


@kernel
def apply_effects(sensor, when, block, begin, count, offset, p, model, memory, slots, felt):
    """Let effects act on contacts of a block that :func:`press_texel` wrote, as if each pressed on a whole texel.

    `when` is STEP where depths are those at the step's end, NOW where nothing has passed since the last one; `offset` is what
    leads from a slot to its contact point.
    """
    linear = p[EXPONENT] == LINEAR
    slot = block * LANES + begin
    apply_force_laws(sensor, when, felt, block, LANES, begin, count, slots, slot, offset, linear, model.program, memory, False)
    apply_friction_laws(sensor, felt, block, LANES, begin, count, slots, model.program, memory)


@kernel
def write_tangent(pair, block, lane, dt, grip, model, felt, rows):
    """Turn what the effects made of a contact into its row: tangent of the normal law, multiplier and drag of friction.

    A slope below zero, which no implicit step can use, counts as zero.
    """
    share, rate = model.share[pair], felt[block, RATE * LANES + lane]
    force, slope = share * felt[block, FORCE * LANES + lane], 0.0
    if felt[block, compiled_program.DEPTH * LANES + lane] > 0.0:
        slope = share * max(felt[block, compiled_program.SLOPE * LANES + lane] * dt + felt[block, DAMPING * LANES + lane], 0.0)
    rows[block, NORMAL_BIAS + lane], rows[block, NORMAL_SLOPE + lane] = force - slope * rate, model.part[pair] * slope
    rows[block, FRICTION_SCALE + lane] = grip * felt[block, FACTOR * LANES + lane]
    rows[block, EXTRA_VISCOSITY + lane] = share * felt[block, VISCOUS * LANES + lane]


@kernel
def force_and_friction_law(pair, block, lane, p, model, felt):
    """Normal force of a contact point (N), and its parameters with the friction that the effects make."""
    factor, viscous = felt[block, FACTOR * LANES + lane], model.share[pair] * felt[block, VISCOUS * LANES + lane]
    law = (p[0], p[1], p[CT] + viscous, p[3], p[4], p[5], factor * p[MUS], factor * p[MUD], p[8], p[9])
    return model.share[pair] * felt[block, FORCE * LANES + lane], law


@kernel
def record_deepest(point, pair, depth, rate, slide, p, model, pressed):
    """Keep what presses on a point at the step's end, if nothing presses deeper."""
    points = pressed.shape[1] // compiled_program.COLUMNS
    if model.part[pair] * depth > pressed[0, compiled_program.DEPTH * points + point]:
        press_texel(pressed, 0, points, point, pair, depth, rate, slide, 0.0, p, model)


@kernel
def commit_memory(sensor, p, model, pressed, every, memory):
    """Bring the memory of a sensor's points to the step's end, and forget what pressed on them; `every` counts all points."""
    points, first = len(model.points), model.point_start[sensor]
    count, linear = model.point_start[sensor + 1] - first, p[EXPONENT] == LINEAR
    apply_force_laws(sensor, STEP, pressed, 0, points, first, count, every, first, 0, linear, model.program, memory, True)
    for column in range(compiled_program.COLUMNS):
        for i in range(count):
            pressed[0, column * points + first + i] = 0.0


@kernel
def commit_effect_memory(dt, model, state, workspace):
    """Let the effects remember what happened in the step, at the velocities of its end."""
    for pair in range(len(model.pairs)):
        sensor = model.pairs[pair, 0]
        if workspace.contacts[pair] > 0 and has_effects(sensor, model.program):
            a, b = model.sensor_body[sensor], model.target_body[model.pairs[pair, 1]]
            relative_motion(a, b, workspace.twist, state.position, workspace.rotation, workspace.motion[pair])
            _record_pair(pair, dt, motion_values(workspace.motion[pair]), pair_law(model.parameters, pair), model, workspace)
    for pair in range(len(model.pairs)):
        sensor = model.pairs[pair, 0]
        if (pair == 0 or model.pairs[pair - 1, 0] != sensor) and has_effects(sensor, model.program):
            commit_memory(sensor, pair_law(model.parameters, pair), model, workspace.pressed, workspace.every, state.memory)


@kernel
def _record_pair(pair, dt, motion, law, model, workspace):
    """Keep what presses on the points of a pair's sensor."""
    rows = workspace.rows
    for r in range(workspace.contacts[pair]):
        b, lane = workspace.first_block[pair] + r // LANES, r % LANES
        point = model.point_first[pair] + workspace.slots[b, lane] - model.slot_start[pair]
        vx, vy, vz = velocity_at(rows[b, PX + lane], rows[b, PY + lane], rows[b, PZ + lane], motion)
        if workspace.moving[pair]:
            vx, vy, vz = (
                vx + workspace.own[b, SURFACE_VX + lane],
                vy + workspace.own[b, SURFACE_VY + lane],
                vz + workspace.own[b, SURFACE_VZ + lane],
            )
        rate = vx * rows[b, NX + lane] + vy * rows[b, NY + lane] + vz * rows[b, NZ + lane]
        slide = dt * math.sqrt(max(vx * vx + vy * vy + vz * vz - rate * rate, 0.0))
        p, end = point_law(law, model.painted, point), rows[b, DEPTH + lane] + dt * rate
        record_deepest(point, pair, end, rate, slide, p, model, workspace.pressed)
