# SPDX-License-Identifier: GPL-3.0-or-later
"""The contacts of a pair, linearised and summed up: what they resist, and the force they bring (kernels)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...compiled.kernels import addressed_kernel, inlined, kernel
from ...effects.engine.compiled_program import TexelMotion, has_effects, may_pull
from ...laws.contact_law import LINEAR_EXPONENT, ContactLaw, read_law
from ...laws.friction import bristle_step, deflection_scale, friction_tangent, max_bristle_deflection, next_deflection
from ...laws.normal_force import linear_tangent, normal_tangent
from ..detection.detection_data import (
    BRISTLE,
    DEPTH,
    EXTRA_VISCOSITY,
    FRICTION_SCALE,
    GAIN,
    KEEP,
    LANES,
    LIMIT,
    NORMAL,
    NORMAL_BIAS,
    NORMAL_SLOPE,
    POINT,
    DetectionData,
    read_vector,
)
from ..solver_model import SolverModel, State
from ..workspace import SUMS, Workspace
from .effect_kernels import FULL_STEP, apply_effects, lane_range, press_texel, write_tangent
from .friction_state import motion_values, point_law, relative_motion, row_of, row_velocity, velocity_at, write_pair_motion


class Tangent(NamedTuple):
    """The normal law of one contact at the step's end, and how effects and paint change its friction.

    Attributes
    ----------
    bias, slope : float, N and N·s/m
        Tangent of the normal law (see :func:`.normal_tangent`).
    friction_scale : float
        Multiplier of the friction coefficients.
    extra_viscosity : float, N·s/m
        Added to `ct`.
    may_pull : bool
        The normal force may be negative; friction is zero then.
    """

    bias: float
    slope: float
    friction_scale: float
    extra_viscosity: float
    may_pull: bool


class LinearContact(NamedTuple):
    """Force of a contact on the target, ``-(push + stiff_n ḋ) n - (bias z + stiff_t v_t)``, and the step of its bristles.

    Attributes
    ----------
    limit : float, metres
        Largest bristle deflection under the normal force at the step's end.
    push, stiff_n : float, N and N·s/m
    bias, stiff_t : float, N/m and N·s/m
    keep, gain : float
        See :func:`.next_deflection`.
    """

    limit: float
    push: float
    stiff_n: float
    bias: float
    stiff_t: float
    keep: float
    gain: float


@inlined
def linearise_contact(
    normal: tuple[float, float, float],
    bristle: tuple[float, float, float],
    velocity: tuple[float, float, float],
    tangent: Tangent,
    dt: float,
    law: ContactLaw,
) -> LinearContact:
    """Linearise a contact's force in the relative velocity at the step's end.

    All is zero where the contact separates within the step.

    Parameters
    ----------
    normal, bristle : (x, y, z)
        Normal, and bristle deflection at the step's beginning (m).
    velocity : (x, y, z)
        Of the target relative to the sensor where the force is linearised, m/s.
    tangent : Tangent
    dt : float, seconds
    law : ContactLaw

    Returns
    -------
    LinearContact
    """
    nx, ny, nz = normal
    zx, zy, zz = bristle
    vx, vy, vz = velocity
    rate = vx * nx + vy * ny + vz * nz
    tx, ty, tz = vx - rate * nx, vy - rate * ny, vz - rate * nz
    force = max(tangent.bias + tangent.slope * rate, 0.0)
    load = tangent.friction_scale * force
    limit = max_bristle_deflection(load, law)
    held = deflection_scale(zx * zx + zy * zy + zz * zz, limit)  # the load fell: the rest has slipped already
    keep, gain = bristle_step(tx * tx + ty * ty + tz * tz, load, dt, law)
    keep *= held
    zx = next_deflection(keep, zx, gain, tx)
    zy = next_deflection(keep, zy, gain, ty)
    zz = next_deflection(keep, zz, gain, tz)
    # The closed solution for constant velocity may exceed the limit: then the contact slides at the limit.
    scale = deflection_scale(zx * zx + zy * zy + zz * zz, limit)
    keep, gain = scale * keep, scale * gain
    bias, stiff_t = friction_tangent(keep, gain, held, dt, law)
    stiff_t += tangent.extra_viscosity
    on = force > 0.0
    acts = on or tangent.may_pull
    return LinearContact(
        limit, tangent.bias if acts else 0.0, tangent.slope if acts else 0.0, bias if on else 0.0, stiff_t if on else 0.0,
        keep if on else 0.0, gain if on else 0.0,
    )  # fmt: skip


@addressed_kernel
def sum_pair_contacts(
    pair: int, dt: float, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace
) -> None:
    """Sum up the contacts of a pair, linearised at the velocities that are guessed."""
    if workspace.contacts.number[pair] == 0:
        return
    a, b = model.pairs.sensor_body[pair], model.pairs.target_body[pair]
    bodies, known = workspace.bodies, workspace.pairs.known_motion[pair]
    write_pair_motion(pair, model, state, workspace)
    relative_motion(a, b, bodies.known_step_motion, state.position, bodies.rotation, known)
    law, unknown = read_law(model.pairs.law, pair), model.bodies.first_unknown
    alike = law.exponent == LINEAR_EXPONENT and len(model.points.multipliers) == 0 and not workspace.contacts.deforming[pair]
    if alike and unknown[a] < 0 and unknown[b] < 0 and not has_effects(model.pairs.sensor[pair], model.effects):
        _linearise_contacts(pair, dt, law, workspace)
    else:
        _sum_contacts(pair, dt, law, model, state.effect_memory, workspace)


@kernel
def _write_tangents(
    pair: int, dt: float, law: ContactLaw, model: SolverModel, memory: np.ndarray, workspace: Workspace
) -> None:
    """Write what differs between the contacts of a pair, for the vectorised loop, which must not call it itself.

    These are the tangents of a curved normal law at the guessed velocities, what effects make of them, and paint.
    """
    contacts, rows, multipliers, sensor = (
        workspace.contacts,
        workspace.contacts.rows,
        model.points.multipliers,
        model.pairs.sensor[pair],
    )
    effects, texels = has_effects(sensor, model.effects), workspace.effects.contacts
    motion = motion_values(workspace.pairs.motion[pair])
    first_point = model.pairs.first_point[pair] - model.pairs.first_slot[pair]
    for r in range(contacts.number[pair]):
        b, lane = row_of(r, pair, contacts)
        point = first_point + contacts.slots[b, lane]
        vx, vy, vz, rate = row_velocity(b, lane, motion, contacts.deforming[pair], contacts)
        p = point_law(law, multipliers, point)
        rows[b, FRICTION_SCALE + lane] = multipliers[point, 1] if len(multipliers) > 0 else 1.0
        rows[b, EXTRA_VISCOSITY + lane] = 0.0
        depth = rows[b, DEPTH + lane]
        if effects:
            speed = math.sqrt(max(vx * vx + vy * vy + vz * vz - rate * rate, 0.0))
            press_texel(texels, b, lane, pair, TexelMotion(depth + dt * rate, rate, 0.0, speed), p, model)
        else:
            rows[b, NORMAL_BIAS + lane], rows[b, NORMAL_SLOPE + lane] = normal_tangent(depth, rate, dt, p)
    if effects:
        first, left = contacts.first_block[pair], contacts.number[pair]
        for b in range(first, first + (left + LANES - 1) // LANES):
            count = min(left, LANES)
            apply_effects(pair, FULL_STEP, lane_range(pair, b, 0, count, model, workspace), law, model, memory, workspace)
            for lane in range(count):
                write_tangent(pair, b, lane, dt, model, texels, rows)
            left -= LANES


@inlined
def _add_contact(
    sums: np.ndarray,
    lane: int,
    contact: LinearContact,
    normal: tuple[float, float, float],
    point: tuple[float, float, float],
    bristle: tuple[float, float, float],
    known_velocity: tuple[float, float, float],
) -> None:
    """Add a contact's block ``Jᵀ C J``, its lower triangle row by row, and its wrench to the sums of a lane.

    `bristle` is the deflection at the step's beginning, `known_velocity` the part of the velocity not solved for.
    """
    nx, ny, nz = normal
    px, py, pz = point
    zx, zy, zz = bristle
    ux, uy, uz = known_velocity
    t = contact.stiff_t
    e = contact.stiff_n - t
    push = contact.push + e * (ux * nx + uy * ny + uz * nz)
    fx = -push * nx - contact.bias * zx - t * ux
    fy = -push * ny - contact.bias * zy - t * uy
    fz = -push * nz - contact.bias * zz - t * uz
    mx, my, mz = py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx
    ex, ey, ez = e * nx, e * ny, e * nz
    gx, gy, gz = e * mx, e * my, e * mz
    tx, ty, tz = t * px, t * py, t * pz
    square = tx * px + ty * py + tz * pz
    sums[0 * LANES + lane] += t + ex * nx
    sums[1 * LANES + lane] += ey * nx
    sums[2 * LANES + lane] += t + ey * ny
    sums[3 * LANES + lane] += ez * nx
    sums[4 * LANES + lane] += ez * ny
    sums[5 * LANES + lane] += t + ez * nz
    sums[6 * LANES + lane] += gx * nx
    sums[7 * LANES + lane] += gx * ny - tz
    sums[8 * LANES + lane] += gx * nz + ty
    sums[9 * LANES + lane] += gx * mx + square - tx * px
    sums[10 * LANES + lane] += gy * nx + tz
    sums[11 * LANES + lane] += gy * ny
    sums[12 * LANES + lane] += gy * nz - tx
    sums[13 * LANES + lane] += gy * mx - ty * px
    sums[14 * LANES + lane] += gy * my + square - ty * py
    sums[15 * LANES + lane] += gz * nx - ty
    sums[16 * LANES + lane] += gz * ny + tx
    sums[17 * LANES + lane] += gz * nz
    sums[18 * LANES + lane] += gz * mx - tz * px
    sums[19 * LANES + lane] += gz * my - tz * py
    sums[20 * LANES + lane] += gz * mz + square - tz * pz
    sums[21 * LANES + lane] += fx
    sums[22 * LANES + lane] += fy
    sums[23 * LANES + lane] += fz
    sums[24 * LANES + lane] += py * fz - pz * fy
    sums[25 * LANES + lane] += pz * fx - px * fz
    sums[26 * LANES + lane] += px * fy - py * fx


@kernel
def _linearise_contacts(pair: int, dt: float, law: ContactLaw, workspace: Workspace) -> None:
    """Do as :func:`_sum_contacts` for bodies whose motion is prescribed, which need no sums, and contacts that are alike."""
    contacts, motion = workspace.contacts, motion_values(workspace.pairs.motion[pair])
    rows, first = contacts.rows, contacts.first_block[pair]
    for b in range(first, first + (contacts.number[pair] + LANES - 1) // LANES):
        for lane in range(LANES):  # runs in vector registers: no branches, no calls
            normal, bristle = read_vector(rows, b, NORMAL, lane), read_vector(rows, b, BRISTLE, lane)
            velocity = velocity_at(read_vector(rows, b, POINT, lane), motion)
            bias, slope = linear_tangent(rows[b, DEPTH + lane], dt, law)
            contact = linearise_contact(normal, bristle, velocity, Tangent(bias, slope, 1.0, 0.0, False), dt, law)
            rows[b, LIMIT + lane], rows[b, KEEP + lane], rows[b, GAIN + lane] = contact.limit, contact.keep, contact.gain


@kernel
def _sum_contacts(pair: int, dt: float, law: ContactLaw, model: SolverModel, memory: np.ndarray, workspace: Workspace) -> None:
    """Linearise the contacts of a pair, and sum their forces on the target and what they resist.

    With a contact's damping tensor ``C = ct 1 + (cn - ct) n nᵀ`` and velocities ``v + ω × p`` the block is the sum of
    ``Jᵀ C J``, its lower triangle; the wrench is what the springs and the known part of the motion do.
    """
    contacts = workspace.contacts
    rows, sums = contacts.rows, workspace.pairs.sums[pair]
    motion, known = motion_values(workspace.pairs.motion[pair]), motion_values(workspace.pairs.known_motion[pair])
    for i in range(SUMS * LANES):
        sums[i] = 0.0
    surface_velocity, moving = contacts.surface_velocity, contacts.deforming[pair]
    sensor = model.pairs.sensor[pair]
    vary = law.exponent != LINEAR_EXPONENT or len(model.points.multipliers) > 0 or has_effects(sensor, model.effects)
    pulls = may_pull(sensor, model.effects)
    if vary:
        _write_tangents(pair, dt, law, model, memory, workspace)
    first = contacts.first_block[pair]
    for b in range(first, first + (contacts.number[pair] + LANES - 1) // LANES):
        for lane in range(LANES):  # runs in vector registers: no branches, no calls
            nx, ny, nz = read_vector(rows, b, NORMAL, lane)
            px, py, pz = read_vector(rows, b, POINT, lane)
            zx, zy, zz = read_vector(rows, b, BRISTLE, lane)
            vx, vy, vz = velocity_at((px, py, pz), motion)
            ux, uy, uz = velocity_at((px, py, pz), known)
            if moving:
                sx, sy, sz = read_vector(surface_velocity, b, 0, lane)
                vx, vy, vz = vx + sx, vy + sy, vz + sz
                ux, uy, uz = ux + sx, uy + sy, uz + sz
            bias, slope = linear_tangent(rows[b, DEPTH + lane], dt, law)
            scale, viscosity = 1.0, 0.0
            if vary:
                bias, slope = rows[b, NORMAL_BIAS + lane], rows[b, NORMAL_SLOPE + lane]
                scale, viscosity = rows[b, FRICTION_SCALE + lane], rows[b, EXTRA_VISCOSITY + lane]
            contact = linearise_contact(
                (nx, ny, nz), (zx, zy, zz), (vx, vy, vz), Tangent(bias, slope, scale, viscosity, pulls), dt, law
            )
            rows[b, LIMIT + lane], rows[b, KEEP + lane], rows[b, GAIN + lane] = contact.limit, contact.keep, contact.gain
            _add_contact(sums, lane, contact, (nx, ny, nz), (px, py, pz), (zx, zy, zz), (ux, uy, uz))
    for half in (8, 4, 2, 1):  # the lanes, in pairs
        for i in range(0, SUMS * LANES, LANES):
            for lane in range(half):
                sums[i + lane] += sums[i + lane + half]
