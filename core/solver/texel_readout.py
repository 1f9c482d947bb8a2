# SPDX-License-Identifier: GPL-3.0-or-later
"""The forces on every texel in the present state (kernel)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..compiled.kernels import inlined, kernel
from ..effects.engine.compiled_program import TexelMotion, has_effects
from ..laws.contact_law import LINEAR_EXPONENT, ContactLaw, read_law, with_friction
from ..laws.friction import bristle_rate, deflection_scale, friction_force, max_bristle_deflection
from ..laws.normal_force import linear_normal_force, normal_force
from .detection.detection_data import (
    BRISTLE,
    DEPTH,
    FRICTION,
    LANES,
    NORMAL,
    POINT,
    PUSH,
    SIZE,
    SPEED,
    read_vector,
    write_vector,
)
from .dynamics.effect_kernels import NO_TIME, apply_effects, lane_range, press_texel
from .dynamics.friction_state import motion_values, point_law, row_of, row_velocity, velocity_at, write_pair_motion
from .solver_model import SolverModel, State
from .workspace import Workspace


class TexelReadout(NamedTuple):
    """Forces on the n texels of all m sensors, in the frame of the sensor's body.

    Attributes
    ----------
    force : (n,) float, N
        Normal force.
    shear : (n, 2) float, N
        Force in the texel's plane, along its x and y axis.
    friction : (n,) float, N
        Sum of the friction forces of its contact points.
    depth : (n,) float, metres
        Of the deepest of its contact points.
    slip : (n,) float, m/s
        Sliding speed where the target presses hardest.
    contact : (n,) bool
    strongest : (n,) float, N
        Largest normal force of a contact point.
    net : (m, 6) float, N and N·m
        Force on each sensor and torque about the body's reference point.
    moment : (m, 4) float, N·m and N
        Sums of normal force times contact point, and of normal force.
    """

    force: np.ndarray
    shear: np.ndarray
    friction: np.ndarray
    depth: np.ndarray
    slip: np.ndarray
    contact: np.ndarray
    strongest: np.ndarray
    net: np.ndarray
    moment: np.ndarray

    @classmethod
    def zero(cls, texels: int, sensors: int, *frames: int) -> TexelReadout:
        """Return the readout of sensors that nothing touches; with a leading axis in each array if `frames` are given."""
        n, m = (*frames, texels), (*frames, sensors)
        force, friction, depth, slip = (np.zeros(n) for _ in range(4))
        contact, strongest = np.zeros(n, dtype=np.bool_), np.full(n, -1.0)
        return cls(force, np.zeros((*n, 2)), friction, depth, slip, contact, strongest, np.zeros((*m, 6)), np.zeros((*m, 4)))


@kernel
def read_texels(model: SolverModel, state: State, workspace: Workspace, out: TexelReadout) -> None:
    """Compute the forces on every texel at this moment, from contacts that were just found (Eq. 8, 9, 13).

    Parameters
    ----------
    model : SolverModel
    state : State
    workspace : Workspace
    out : TexelReadout
        Zero at first; written.
    """
    for pair in range(len(model.pairs.sensor)):
        read_pair(pair, model, state, workspace, out)


@kernel
def read_pair(pair: int, model: SolverModel, state: State, workspace: Workspace, out: TexelReadout) -> None:
    """Add the contacts of one pair to the readout."""
    write_pair_motion(pair, model, state, workspace)
    law, varies = read_law(model.pairs.law, pair), has_effects(model.pairs.sensor[pair], model.effects)
    varies = varies or len(model.points.multipliers) > 0 or workspace.contacts.deforming[pair]
    if varies or law.exponent != LINEAR_EXPONENT:
        _write_forces_one_by_one(pair, law, model, state, workspace)
    else:
        _write_forces(pair, law, workspace)
    _add_forces(pair, model, workspace, out)


@inlined
def _friction(
    bristle: tuple[float, float, float],
    velocity: tuple[float, float, float],
    normal: tuple[float, float, float],
    rate: float,
    fn: float,
    law: ContactLaw,
) -> tuple[float, float, float]:
    """Friction on a contact point under the normal force `fn`, N.

    It drags the sensor along with the target; the target's surface normal points into the sensor.
    """
    (zx, zy, zz), (tx, ty, tz) = bristle, tangential_velocity(velocity, normal, rate)
    square = tx * tx + ty * ty + tz * tz
    held = deflection_scale(zx * zx + zy * zy + zz * zz, max_bristle_deflection(fn, law))
    zx, zy, zz = held * zx, held * zy, held * zz
    fx = friction_force(zx, bristle_rate(zx, tx, square, fn, law), tx, law)
    fy = friction_force(zy, bristle_rate(zy, ty, square, fn, law), ty, law)
    fz = friction_force(zz, bristle_rate(zz, tz, square, fn, law), tz, law)
    pressed = fn > 0.0
    return (fx if pressed else 0.0), (fy if pressed else 0.0), (fz if pressed else 0.0)


@inlined
def tangential_velocity(
    velocity: tuple[float, float, float], normal: tuple[float, float, float], rate: float
) -> tuple[float, float, float]:
    """Return the part of a velocity in the surface, whose part along the normal is `rate`."""
    (vx, vy, vz), (nx, ny, nz) = velocity, normal
    return vx - rate * nx, vy - rate * ny, vz - rate * nz


@kernel
def _write_forces(pair: int, law: ContactLaw, workspace: Workspace) -> None:
    """Write normal force, friction and sliding speed into the rows of a pair with the linear law, alike for all its points."""
    contacts, motion, rows = workspace.contacts, motion_values(workspace.pairs.motion[pair]), workspace.contacts.rows
    first = contacts.first_block[pair]
    for b in range(first, first + (contacts.number[pair] + LANES - 1) // LANES):
        for lane in range(LANES):  # runs in vector registers: no branches, no calls
            normal, bristle = read_vector(rows, b, NORMAL, lane), read_vector(rows, b, BRISTLE, lane)
            vx, vy, vz = velocity_at(read_vector(rows, b, POINT, lane), motion)
            rate = vx * normal[0] + vy * normal[1] + vz * normal[2]
            fn = linear_normal_force(rows[b, DEPTH + lane], rate, law)
            fx, fy, fz = _friction(bristle, (vx, vy, vz), normal, rate, fn, law)
            tx, ty, tz = tangential_velocity((vx, vy, vz), normal, rate)
            write_vector(rows, b, FRICTION, lane, fx, fy, fz)
            rows[b, PUSH + lane], rows[b, SPEED + lane] = fn, math.sqrt(tx * tx + ty * ty + tz * tz)


@kernel
def _write_forces_one_by_one(pair: int, law: ContactLaw, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Do as :func:`_write_forces` where effects act, points are painted, surfaces deform or the law is curved."""
    contacts, motion, rows = workspace.contacts, motion_values(workspace.pairs.motion[pair]), workspace.contacts.rows
    effects, share = has_effects(model.pairs.sensor[pair], model.effects), model.pairs.force_share[pair]
    for r in range(contacts.number[pair]):
        b, lane = row_of(r, pair, contacts)
        point = model.pairs.first_point[pair] + contacts.slots[b, lane] - model.pairs.first_slot[pair]
        depth, p = rows[b, DEPTH + lane], point_law(law, model.points.multipliers, point)
        normal, bristle = read_vector(rows, b, NORMAL, lane), read_vector(rows, b, BRISTLE, lane)
        vx, vy, vz, rate = row_velocity(b, lane, motion, contacts.deforming[pair], contacts)
        tx, ty, tz = tangential_velocity((vx, vy, vz), normal, rate)
        speed, fn = math.sqrt(tx * tx + ty * ty + tz * tz), normal_force(depth, rate, p)
        if effects:
            texels = workspace.effects.contacts
            press_texel(texels, b, lane, pair, TexelMotion(depth, rate, 0.0, speed), p, model)
            points = lane_range(pair, b, lane, 1, model, workspace)
            apply_effects(pair, NO_TIME, points, p, model, state.effect_memory, workspace)
            fn, viscous = share * texels.force[b, lane], share * texels.extra_viscosity[b, lane]
            p = with_friction(p, texels.friction_factor[b, lane], viscous)
        fx, fy, fz = _friction(bristle, (vx, vy, vz), normal, rate, fn, p)
        write_vector(rows, b, FRICTION, lane, fx, fy, fz)
        rows[b, PUSH + lane], rows[b, SPEED + lane] = fn, speed


@kernel
def _add_forces(pair: int, model: SolverModel, workspace: Workspace, out: TexelReadout) -> None:
    """Add the forces in the rows of a pair to its texels, to the sensor's wrench and to the sums for the centre of pressure."""
    _sum_forces(pair, 1.0 / model.pairs.force_weight[pair], workspace)
    sensor, sums, contacts = model.pairs.sensor[pair], workspace.pairs.sums[pair], workspace.contacts
    for i in range(6):
        out.net[sensor, i] += sums[i * LANES]
    for i in range(4):
        out.moment[sensor, i] += sums[(6 + i) * LANES]
    rows, frame, texels, slots = contacts.rows, model.points.frame, model.points.texel, contacts.slots
    first_point = model.pairs.first_point[pair] - model.pairs.first_slot[pair]
    force, shear, friction, depth, slip = out.force, out.shear, out.friction, out.depth, out.slip
    strongest, contact = out.strongest, out.contact
    for r in range(contacts.number[pair]):
        b, lane = row_of(r, pair, contacts)
        point = first_point + slots[b, lane]
        texel, fn = texels[point], rows[b, PUSH + lane]
        fx, fy, fz = read_vector(rows, b, FRICTION, lane)
        friction[texel] += rows[b, SIZE + lane]
        # Shear is the part of the whole force in the texel's plane: where the object's surface leans, some is normal force.
        shear[texel, 0] += fx * frame[point, 6] + fy * frame[point, 7] + fz * frame[point, 8]
        shear[texel, 1] += fx * frame[point, 9] + fy * frame[point, 10] + fz * frame[point, 11]
        if fn > strongest[texel]:  # the slip is that of the target and the point which press hardest
            strongest[texel] = fn
            slip[texel] = rows[b, SPEED + lane]
        contact[texel] = True
        force[texel] += fn
        depth[texel] = max(depth[texel], rows[b, DEPTH + lane])


@kernel
def _sum_forces(pair: int, whole: float, workspace: Workspace) -> None:
    """Sum up wrench and moment of a pair's rows; instead of friction, they then have its size and the whole force.

    `whole` is the factor from the forces in the rows to those that texels measure. The sums of the ten numbers, in the order of
    :attr:`TexelReadout.net` and :attr:`TexelReadout.moment`, stand in the first lanes of the pair's sums.
    """
    contacts, rows, sums = workspace.contacts, workspace.contacts.rows, workspace.pairs.sums[pair]
    for i in range(10 * LANES):
        sums[i] = 0.0
    first = contacts.first_block[pair]
    for b in range(first, first + (contacts.number[pair] + LANES - 1) // LANES):
        for lane in range(LANES):  # runs in vector registers: no branches, no calls
            nx, ny, nz = read_vector(rows, b, NORMAL, lane)
            px, py, pz = read_vector(rows, b, POINT, lane)
            fx, fy, fz = read_vector(rows, b, FRICTION, lane)
            fx, fy, fz, fn = whole * fx, whole * fy, whole * fz, whole * rows[b, PUSH + lane]
            rows[b, SIZE + lane] = math.sqrt(fx * fx + fy * fy + fz * fz)
            fx, fy, fz = fx + fn * nx, fy + fn * ny, fz + fn * nz
            write_vector(rows, b, FRICTION, lane, fx, fy, fz)
            rows[b, PUSH + lane] = fn
            sums[lane] += fx
            sums[LANES + lane] += fy
            sums[2 * LANES + lane] += fz
            sums[3 * LANES + lane] += py * fz - pz * fy
            sums[4 * LANES + lane] += pz * fx - px * fz
            sums[5 * LANES + lane] += px * fy - py * fx
            sums[6 * LANES + lane] += fn * px
            sums[7 * LANES + lane] += fn * py
            sums[8 * LANES + lane] += fn * pz
            sums[9 * LANES + lane] += fn
    for half in (8, 4, 2, 1):  # the lanes, in pairs
        for i in range(0, 10 * LANES, LANES):
            for lane in range(half):
                sums[i + lane] += sums[i + lane + half]
