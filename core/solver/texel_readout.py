# SPDX-License-Identifier: GPL-3.0-or-later
"""The forces on every texel in the present state (kernel)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..compiled.kernels import inlined, kernel
from ..effects.engine.compiled_program import TexelMotion, has_effects
from ..laws.contact_law import ContactLaw, read_law
from ..laws.friction import bristle_rate, deflection_scale, friction_force, max_bristle_deflection
from ..laws.normal_force import normal_force
from .contact_rows import BRISTLE, DEPTH, NORMAL, POINT, read_vector
from .dynamics.effect_kernels import NOW, apply_effects, force_and_friction_law, lane_range, press_texel
from .dynamics.relative_kinematics import motion_values, point_law, row_of, row_velocity, write_pair_motion
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
    motion, law = motion_values(workspace.pairs.motion[pair]), read_law(model.pairs.law, pair)
    for r in range(workspace.contacts.number[pair]):
        block, lane = row_of(r, pair, workspace.contacts)
        _read_contact(pair, block, lane, motion, law, model, state, workspace, out)


@inlined
def _read_contact(
    pair: int,
    block: int,
    lane: int,
    motion: tuple[float, ...],
    law: ContactLaw,
    model: SolverModel,
    state: State,
    workspace: Workspace,
    out: TexelReadout,
) -> None:
    """Add one contact to the readout."""
    contacts, sensor, whole = workspace.contacts, model.pairs.sensor[pair], 1.0 / model.pairs.force_weight[pair]
    rows, frame = contacts.rows, model.points.frame
    point = model.pairs.first_point[pair] + contacts.slots[block, lane] - model.pairs.first_slot[pair]
    texel, depth = model.points.texel[point], contacts.rows[block, DEPTH + lane]
    p = point_law(law, model.points.multipliers, point)
    nx, ny, nz = read_vector(rows, block, NORMAL, lane)
    px, py, pz = read_vector(rows, block, POINT, lane)
    vx, vy, vz, rate = row_velocity(block, lane, motion, contacts.deforming[pair], contacts)
    tx, ty, tz = vx - rate * nx, vy - rate * ny, vz - rate * nz
    square = tx * tx + ty * ty + tz * tz
    fn = normal_force(depth, rate, p)
    if has_effects(sensor, model.effects):
        texels = workspace.effects.contacts
        press_texel(texels, block, lane, pair, TexelMotion(depth, rate, 0.0, math.sqrt(square)), p, model)
        points = lane_range(pair, block, lane, 1, model, workspace)
        apply_effects(pair, NOW, points, p, model, state.effect_memory, workspace)
        fn, p = force_and_friction_law(pair, block, lane, p, model, texels)
    zx, zy, zz = read_vector(rows, block, BRISTLE, lane)
    held = deflection_scale(zx * zx + zy * zy + zz * zz, max_bristle_deflection(fn, p))
    zx, zy, zz = held * zx, held * zy, held * zz
    # Friction drags the sensor along with the target; the target's surface normal points into the sensor.
    fx, fy, fz = 0.0, 0.0, 0.0
    if fn > 0.0:
        fx = friction_force(zx, bristle_rate(zx, tx, square, fn, p), tx, p)
        fy = friction_force(zy, bristle_rate(zy, ty, square, fn, p), ty, p)
        fz = friction_force(zz, bristle_rate(zz, tz, square, fn, p), tz, p)
    fx, fy, fz, fn = whole * fx, whole * fy, whole * fz, whole * fn
    out.friction[texel] += math.sqrt(fx * fx + fy * fy + fz * fz)
    # Shear is the part of the whole force in the texel's plane: where the object's surface leans, some of it is normal force.
    fx, fy, fz = fx + fn * nx, fy + fn * ny, fz + fn * nz
    out.shear[texel, 0] += fx * frame[point, 6] + fy * frame[point, 7] + fz * frame[point, 8]
    out.shear[texel, 1] += fx * frame[point, 9] + fy * frame[point, 10] + fz * frame[point, 11]
    if fn > out.strongest[texel]:  # the slip is that of the target and the point which press hardest
        out.strongest[texel] = fn
        out.slip[texel] = math.sqrt(square)
    out.contact[texel] = True
    out.force[texel] += fn
    out.depth[texel] = max(out.depth[texel], depth)
    _add_to_wrench(sensor, (px, py, pz), (fx, fy, fz), fn, out)


@inlined
def _add_to_wrench(
    sensor: int, point: tuple[float, float, float], force: tuple[float, float, float], normal_force: float, out: TexelReadout
) -> None:
    """Add the force on a point (m) to a sensor's wrench, and its normal force to the sums for the centre of pressure."""
    (px, py, pz), (fx, fy, fz) = point, force
    net, moment = out.net, out.moment
    net[sensor, 0] += fx
    net[sensor, 1] += fy
    net[sensor, 2] += fz
    net[sensor, 3] += py * fz - pz * fy
    net[sensor, 4] += pz * fx - px * fz
    net[sensor, 5] += px * fy - py * fx
    moment[sensor, 0] += normal_force * px
    moment[sensor, 1] += normal_force * py
    moment[sensor, 2] += normal_force * pz
    moment[sensor, 3] += normal_force
