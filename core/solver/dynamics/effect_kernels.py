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
    DRAG,
    EXPONENT,
    GRIP,
    LANES,
    LINEAR,
    MUD,
    MUS,
    NX,
    NY,
    NZ,
    PUSH,
    PX,
    PY,
    PZ,
    SLOPE,
    K,
)
from ..detection.surface_kinematics import OX, OY, OZ
from .relative_kinematics import law_of, painted_law, relative_motion, values, velocity_at

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
def press_texel(work, block, stride, i, pair, depth, rate, slide, speed, p, world):
    """Write what the base law makes of a whole texel at a depth (m), rate, way and speed of sliding; see :func:`.press`.

    `p` are the parameters of one contact point. Where two sensors press on each other, each law sees its own part of the depth.
    """
    share, part = world.share[pair], world.part[pair]
    stiff = part if p[EXPONENT] == LINEAR else part ** p[EXPONENT]
    k, cn, dissipation = p[K] / (share * stiff), p[CN] / (share * part), p[DISSIPATION] / part
    press(work, block, stride, i, part * depth, part * rate, slide, speed, k, cn, p[EXPONENT], dissipation)


@kernel
def let_effects_act(sensor, when, block, begin, count, offset, p, world, memory, slots, felt):
    """Let effects act on contacts of a block that :func:`press_texel` wrote, as if each pressed on a whole texel.

    `when` is STEP where depths are those at the step's end, NOW where nothing has passed since the last one; `offset` is what
    leads from a slot to its contact point.
    """
    linear = p[EXPONENT] == LINEAR
    slot = block * LANES + begin
    apply_force_laws(sensor, when, felt, block, LANES, begin, count, slots, slot, offset, linear, world.program, memory, False)
    apply_friction_laws(sensor, felt, block, LANES, begin, count, slots, world.program, memory)


@kernel
def write_tangent(pair, block, lane, dt, grip, world, felt, rows):
    """Turn what the effects made of a contact into its row: tangent of the normal law, multiplier and drag of friction.

    A slope below zero, which no implicit step can use, counts as zero.
    """
    share, rate = world.share[pair], felt[block, RATE * LANES + lane]
    force, slope = share * felt[block, FORCE * LANES + lane], 0.0
    if felt[block, compiled_program.DEPTH * LANES + lane] > 0.0:
        slope = share * max(felt[block, compiled_program.SLOPE * LANES + lane] * dt + felt[block, DAMPING * LANES + lane], 0.0)
    rows[block, PUSH + lane], rows[block, SLOPE + lane] = force - slope * rate, world.part[pair] * slope
    rows[block, GRIP + lane] = grip * felt[block, FACTOR * LANES + lane]
    rows[block, DRAG + lane] = share * felt[block, VISCOUS * LANES + lane]


@kernel
def force_and_law(pair, block, lane, p, world, felt):
    """Normal force of a contact point (N), and its parameters with the friction that the effects make."""
    factor, viscous = felt[block, FACTOR * LANES + lane], world.share[pair] * felt[block, VISCOUS * LANES + lane]
    law = (p[0], p[1], p[CT] + viscous, p[3], p[4], p[5], factor * p[MUS], factor * p[MUD], p[8], p[9])
    return world.share[pair] * felt[block, FORCE * LANES + lane], law


@kernel
def note_pressed(point, pair, depth, rate, slide, p, world, pressed):
    """Keep what presses on a point at the step's end, if nothing presses deeper."""
    points = pressed.shape[1] // compiled_program.COLUMNS
    if world.part[pair] * depth > pressed[0, compiled_program.DEPTH * points + point]:
        press_texel(pressed, 0, points, point, pair, depth, rate, slide, 0.0, p, world)


@kernel
def remember(sensor, p, world, pressed, every, memory):
    """Bring the memory of a sensor's points to the step's end, and forget what pressed on them; `every` counts all points."""
    points, first = len(world.points), world.point_start[sensor]
    count, linear = world.point_start[sensor + 1] - first, p[EXPONENT] == LINEAR
    apply_force_laws(sensor, STEP, pressed, 0, points, first, count, every, first, 0, linear, world.program, memory, True)
    for column in range(compiled_program.COLUMNS):
        for i in range(count):
            pressed[0, column * points + first + i] = 0.0


@kernel
def remember_step(dt, world, state, scratch):
    """Let the effects remember what happened in the step, at the velocities of its end."""
    for pair in range(len(world.pairs)):
        sensor = world.pairs[pair, 0]
        if scratch.contacts[pair] > 0 and has_effects(sensor, world.program):
            a, b = world.sensor_body[sensor], world.target_body[world.pairs[pair, 1]]
            relative_motion(a, b, scratch.twist, state.position, scratch.rotation, scratch.motion[pair])
            _note_pair(pair, dt, values(scratch.motion[pair]), law_of(world.parameters, pair), world, scratch)
    for pair in range(len(world.pairs)):
        sensor = world.pairs[pair, 0]
        if (pair == 0 or world.pairs[pair - 1, 0] != sensor) and has_effects(sensor, world.program):
            remember(sensor, law_of(world.parameters, pair), world, scratch.pressed, scratch.every, state.memory)


@kernel
def _note_pair(pair, dt, motion, law, world, scratch):
    """Keep what presses on the points of a pair's sensor."""
    rows = scratch.rows
    for r in range(scratch.contacts[pair]):
        b, lane = scratch.first_block[pair] + r // LANES, r % LANES
        point = world.point_first[pair] + scratch.slots[b, lane] - world.slot_start[pair]
        vx, vy, vz = velocity_at(rows[b, PX + lane], rows[b, PY + lane], rows[b, PZ + lane], motion)
        if scratch.moving[pair]:
            vx, vy, vz = vx + scratch.own[b, OX + lane], vy + scratch.own[b, OY + lane], vz + scratch.own[b, OZ + lane]
        rate = vx * rows[b, NX + lane] + vy * rows[b, NY + lane] + vz * rows[b, NZ + lane]
        slide = dt * math.sqrt(max(vx * vx + vy * vy + vz * vz - rate * rate, 0.0))
        p, end = painted_law(law, world.painted, point), rows[b, DEPTH + lane] + dt * rate
        note_pressed(point, pair, end, rate, slide, p, world, scratch.pressed)
