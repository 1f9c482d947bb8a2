# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts store and dissipate energy, and never make any (kernels).

Each pair of sensor and target has a tank: all the work that was done on its contacts, less all that they have done. Springs
whose depth jumps, where an edge passes from face to face or a fast body has come too deep within one step, would give more than
they were given. Where that would leave less than nothing in the tank, only a share of the pair's forces acts in that step, on
both bodies. Hannaford and Ryu (IEEE Trans. Robot. Autom. 18, 2002) make hands that feel forces passive in the same way. Nothing
at rest is concerned, which asks for no work, nor what has lost energy before. Where animation moves one of the bodies it may
bring any energy: from then on nothing is held.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.rotations import FREE, KEYFRAMED
from ...laws.contact import EXPONENT, LINEAR, K, SolverModel, State
from ..workspace import Workspace, contacts_of
from .linear_system import is_last_part

MAX_BISECTIONS = 24
"""How often the share of its forces that a pair can pay for is looked for, by halves."""


def credit_initial_contacts(model: SolverModel, state: State, workspace: Workspace) -> None:
    """Credit contacts that are there at the very start, freshly gathered, with what their springs hold."""
    held = 0.0
    for pair, p in enumerate(model.parameters):
        slots, _, _, depth = contacts_of(pair, workspace)
        points = model.point_first[pair] + slots - model.slot_start[pair]
        power = 1.0 if p[EXPONENT] == LINEAR else p[EXPONENT]
        k = p[K] * (model.painted[points, 0] if len(model.painted) else 1.0)
        held += float(np.sum(k * depth ** (power + 1.0))) / (power + 1.0)
        if is_last_part(pair, model.pairs):
            state.tank[pair], held = held, 0.0


@kernel
def reset_force_scales(model, state, workspace):
    """All forces act in full, to begin with; and what animation has moved may draw from it without end."""
    for pair in range(len(workspace.hold)):
        workspace.hold[pair] = workspace.too_much[pair] = 1.0
        workspace.enough[pair] = 0.0
        for body in (model.sensor_body[model.pairs[pair, 0]], model.target_body[model.pairs[pair, 1]]):
            if model.kind[body] == KEYFRAMED:
                for i in range(6):
                    if state.velocity[body, i] != 0.0:
                        state.tank[pair] = math.inf


@kernel
def check_energy(bisection, dt, model, state, workspace):
    """Whether no pair gives more than its tank holds; then the tanks are brought to the step's end.

    Else the largest share of their forces that those pairs can pay for is narrowed down; none at all costs nothing.
    """
    hold, paid = workspace.hold, True
    for pair in range(len(model.pairs)):
        workspace.work[pair] = _contact_work(pair, dt, model, state, workspace)
        workspace.left[pair] = max(state.tank[pair] + _integration_energy(pair, dt, model, state), 0.0)
        if workspace.work[pair] > workspace.left[pair]:
            workspace.too_much[pair], paid = hold[pair], False
        elif hold[pair] < 1.0:
            workspace.enough[pair] = hold[pair]
    if (paid and bisection == 0) or bisection == MAX_BISECTIONS - 1:
        for pair in range(len(model.pairs)):
            state.tank[pair] -= workspace.work[pair]
        return True
    for pair in range(len(model.pairs)):
        if workspace.too_much[pair] < 1.0 or workspace.work[pair] > workspace.left[pair]:
            middle = 0.5 * (workspace.enough[pair] + workspace.too_much[pair])
            hold[pair] = middle if bisection < MAX_BISECTIONS - 2 else workspace.enough[pair]
    return False


@kernel
def _contact_work(pair, dt, model, state, workspace):
    """Work that a pair's forces do in a step on both bodies together, joules.

    What is put in counts by the mean of the velocities at both ends, so that all that a body loses is found; what comes out by
    the velocity at the end if that is more.
    """
    force, touches = workspace.force[pair], False
    for i in range(6):
        touches = touches or force[i] != 0.0
    if not touches:
        return 0.0
    a, b = model.sensor_body[model.pairs[pair, 0]], model.target_body[model.pairs[pair, 1]]
    early = _relative_velocity(a, b, workspace.before, state.position, workspace.rotation)
    late = _relative_velocity(a, b, state.velocity, state.position, workspace.rotation)
    mean, end = 0.0, 0.0
    for i in range(6):
        mean += 0.5 * dt * force[i] * (early[i] + late[i])
        end += dt * force[i] * late[i]
    return mean if mean < 0.0 else max(mean, end)


@kernel
def _integration_energy(pair, dt, model, state):
    """Energy that a pair's free bodies have lost since the start by being moved with the velocity of each step's end, joules.

    Gravity speeds a body up by the mean velocity and lowers it by the last: falling it loses in each step what it gains rising.
    """
    lag = 0.0
    for body in (model.sensor_body[model.pairs[pair, 0]], model.target_body[model.pairs[pair, 1]]):
        if model.kind[body] == FREE:
            for i in range(3):
                lag += 0.5 * dt * model.mass[body] * model.gravity[i] * (state.velocity[body, i] - model.thrown[body, i])
    return lag


@inlined
def _relative_velocity(a, b, velocity, position, rotation):
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
