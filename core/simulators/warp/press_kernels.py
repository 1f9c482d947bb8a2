# SPDX-License-Identifier: GPL-3.0-or-later
"""A step of pressed sensors in many environments, in the part of Python that :mod:`.translation` makes Warp kernels of.

A step is three kernels, one after the other, without a word to the host between them: where the bodies of each environment are
and how they move (:func:`move_world`); what each texel measures (:func:`press_texel`); and the wrenches (:func:`sum_world`).
The steps of :mod:`.pressing`, on which they are modelled, find the contacts where a step begins and again where it ends. Here
they are kept from one step to the next, as both places are the same. All formulas are those of :mod:`.laws` and of the solver.
These functions also run as plain Python.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...effects.engine.compiled_program import TexelMotion
from ...geometry.bvh import Segment, Tree, segment_entry
from ...geometry.rotations import write_backward_step_motion, write_rotation, write_step_motion, write_velocity
from ...geometry.shapes import MESH, Vector, is_in_shape, shape_entry, shape_normal
from ...laws.contact_law import ContactLaw, read_law, scaled_law, whole_texel_law, with_friction
from ...laws.friction import (
    deflection_scale,
    friction_force,
    max_bristle_deflection,
    next_deflection,
    rate_under_decay,
    sliding_decay,
    turned_into_plane,
)
from ...laws.normal_force import normal_force, normal_tangent
from ...solver.detection.narrow_phase import NEARLY_TOO_DEEP
from ...solver.dynamics.contact_assembly import LinearContact, Tangent, linearise_contact
from ...solver.dynamics.effect_kernels import NOW, STEP
from ...solver.dynamics.relative_kinematics import relative_motion, velocity_at
from ...solver.jumps import crosses_texel, meets_sphere
from .block import block_sum, wait_for_block
from .effect_functions import force_with_effects, friction_with_effects, reading_with_effects
from .press_arrays import BoolArray, Jumps, Results, SensorArrays, Slots, TargetArrays, Worlds

NO_CONTACT, TOO_DEEP = -1.0, -2.0
"""Instead of a share in :attr:`.Slots.pressed`."""
HAS_EFFECTS = 0
"""Whether effects act on forces; the translation of a sensor puts its own number here."""


class Entry(NamedTuple):
    """Where a segment enters a target.

    Attributes
    ----------
    t : float
        Position on the segment, 0 at its base and 1 at its tip; another number where it does not.
    nx, ny, nz : float
        Outward normal there, in the target's frame.
    triangle : int
    inside : bool
        The base is inside the target, as far as the segment tells.
    """

    t: float
    nx: float
    ny: float
    nz: float
    triangle: int
    inside: bool


class Sliding(NamedTuple):
    """How a target moves at a contact point, relative to the sensor.

    Attributes
    ----------
    rate : float, m/s
        Of the depth.
    x, y, z : float, m/s
        In the plane of the surface.
    """

    rate: float
    x: float
    y: float
    z: float


# --- where the bodies are


def move_target(world: int, target: int, sensor: SensorArrays, worlds: Worlds) -> None:
    """Write how a target of an environment moves relative to the sensor over a step, whose end is at its poses."""
    valid, begins, dt = are_poses(worlds.poses[world]), worlds.begins[world], sensor.dt
    if target == 0:
        worlds.valid[world] = valid
    if valid:
        if target == 0:
            worlds.fresh[world] = begins
        at, turned = np.zeros((2, 3)), np.zeros((2, 4))  # of sensor and target, where the step begins
        to, turned_to = np.zeros((2, 3)), np.zeros((2, 4))
        velocity, step_motion, rotation = np.zeros((2, 6)), np.zeros((2, 12)), np.zeros((2, 3, 3))
        motion, turned_motion = np.zeros(12), np.zeros(12)
        for side in range(2):
            body = side * (1 + target)
            place_next(worlds.poses[world, body], to[side], turned_to[side])
            for i in range(3):
                at[side, i] = to[side, i] if begins else worlds.position[world, body, i]
            for i in range(4):
                turned[side, i] = turned_to[side, i] if begins else worlds.quaternion[world, body, i]
            write_velocity(at[side], turned[side], to[side], turned_to[side], dt, velocity[side])
            write_rotation(turned[side], rotation[side])
            write_step_motion(velocity[side], dt, step_motion[side])
        relative_motion(0, 1, step_motion, at, rotation, motion)
        _write_row(motion, worlds.motion[world, target])
        _turn_motion(dt, step_motion[0], rotation[0], motion, turned_motion)
        _write_row(turned_motion, worlds.end_motion[world, target])
        for side in range(2):
            write_rotation(turned_to[side], rotation[side])
            write_backward_step_motion(velocity[side], dt, step_motion[side])
        relative_motion(0, 1, step_motion, to, rotation, motion)
        _write_row(motion, worlds.past_motion[world, target])
        write_pose(to, rotation, 1, motion)
        _write_row(motion, worlds.pose[world, target])


def are_poses(poses: np.ndarray) -> bool:
    """Whether all of the poses (b, 7) are finite, with quaternions that are not zero."""
    good = True
    for body in range(poses.shape[0]):
        size, square = 0.0, 0.0
        for i in range(7):
            size += abs(poses[body, i])
        for i in range(3, 7):
            square += poses[body, i] * poses[body, i]
        if not (size < math.inf and 0.0 < square < math.inf):
            good = False
    return good


def place_next(pose: np.ndarray, position: np.ndarray, quaternion: np.ndarray) -> None:
    """Write a pose (7,) as position and unit quaternion."""
    w, x, y, z = pose[3], pose[4], pose[5], pose[6]
    length = math.sqrt(w * w + x * x + y * y + z * z)
    for i in range(3):
        position[i] = pose[i]
    for i in range(4):
        quaternion[i] = pose[3 + i] / length


def _write_row(values: np.ndarray, out: np.ndarray) -> None:
    """Write twelve numbers."""
    for i in range(12):
        out[i] = values[i]


def _turn_motion(dt: float, step_motion: np.ndarray, rotation: np.ndarray, motion: np.ndarray, out: np.ndarray) -> None:
    """Write a relative motion (12,), given in the sensor's axes at the step's beginning, in those at its end."""
    for i in range(12):
        out[i] = motion[i]
    for k in range(3):
        for m in range(3):
            turn = 0.0  # entry (m, k) of the sensor's W in its own axes
            for i in range(3):
                for j in range(3):
                    turn += rotation[i, m] * step_motion[3 + 3 * i + j] * rotation[j, k]
            out[k] += dt * turn * motion[m]
            for j in range(3):
                out[3 + 3 * k + j] += dt * turn * motion[3 + 3 * m + j]


def write_pose(position: np.ndarray, rotation: np.ndarray, body: int, pose: np.ndarray) -> None:
    """Write the sensor's rotation (row by row) and position in the frame of a target's body."""
    for i in range(3):
        total = 0.0
        for k in range(3):
            total += rotation[body, k, i] * (position[0, k] - position[body, k])
        pose[9 + i] = total
        for j in range(3):
            pose[3 * i + j] = (
                rotation[body, 0, i] * rotation[0, 0, j]
                + rotation[body, 1, i] * rotation[0, 1, j]
                + rotation[body, 2, i] * rotation[0, 2, j]
            )


# --- what a texel measures


def press_texel(
    world: int, texel: int, sensor: SensorArrays, targets: TargetArrays, tree: Tree, worlds: Worlds, slots: Slots, out: Results
) -> None:
    """Bring the contact points of a texel to the step's end, and write down what the texel measures there."""
    press_points(world, texel, sensor, targets, tree, worlds, slots, out)
    write_reading(world, texel, sensor, worlds, slots, out)


def press_points(
    world: int, texel: int, sensor: SensorArrays, targets: TargetArrays, tree: Tree, worlds: Worlds, slots: Slots, out: Results
) -> None:
    """Bring the contact points of a texel to the step's end, and write down its force there."""
    force, along_x, along_y, touched = 0.0, 0.0, 0.0, False
    count = targets.kind.shape[0]
    if worlds.valid[world]:
        for point in range(sensor.first_point[texel], sensor.first_point[texel + 1]):
            law = read_law(sensor.law, min(world, sensor.law.shape[0] - 1))
            if worlds.fresh[world]:
                begin_point(world, point, slots)
                if HAS_EFFECTS == 1:  # which remember the depth at rest
                    for target in range(count):
                        find_contact(world, target, point, sensor, targets, tree, worlds, slots)
            _advance_point(world, point, law, sensor, worlds, slots)
            for target in range(count):
                find_contact(world, target, point, sensor, targets, tree, worlds, slots)
                if slots.pressed[world, target, point] >= 0.0:
                    fn = _write_force(world, target, point, law, sensor, worlds, slots)
                    fx, fy, fz = (
                        slots.force[world, target, point, 0],
                        slots.force[world, target, point, 1],
                        slots.force[world, target, point, 2],
                    )
                    force += fn
                    along_x += fx * sensor.frame[6, point] + fy * sensor.frame[7, point] + fz * sensor.frame[8, point]
                    along_y += fx * sensor.frame[9, point] + fy * sensor.frame[10, point] + fz * sensor.frame[11, point]
                    touched = True
    out.texels[world, texel, 0] = force
    out.texels[world, texel, 1] = along_x
    out.texels[world, texel, 2] = along_y
    out.contact[world, texel] = touched


def write_reading(world: int, texel: int, sensor: SensorArrays, worlds: Worlds, slots: Slots, out: Results) -> None:
    """Write down the reading for the force of a texel."""
    reading = 0.0
    if worlds.valid[world]:
        n = sensor.first_point.shape[0] - 1
        row = texel if sensor.conversion.shape[0] == n else world * n + texel
        zero, scale = sensor.conversion[row, 0], sensor.conversion[row, 1]
        when = 0 if worlds.fresh[world] else 1
        if worlds.fresh[world]:
            for i in range(slots.reading_memory.shape[2]):
                for j in range(slots.reading_memory.shape[3]):
                    slots.reading_memory[world, texel, i, j] = 0.0
        reading = reading_with_effects(
            out.texels[world, texel, 0], zero, scale, when,
            sensor.reading_constants[world], slots.reading_memory[world, texel],
        )  # fmt: skip
    out.readings[world, texel] = reading


def begin_point(world: int, point: int, slots: Slots) -> None:
    """Forget all that a contact point remembers."""
    for target in range(slots.pressed.shape[1]):
        slots.pressed[world, target, point] = NO_CONTACT
        slots.triangle[world, target, point] = -1
        for i in range(3):
            slots.bristle[world, target, point, i] = 0.0
    for i in range(slots.memory.shape[2]):
        for j in range(slots.memory.shape[3]):
            slots.memory[world, point, i, j] = 0.0


def _sliding_at(px: float, py: float, pz: float, nx: float, ny: float, nz: float, m: np.ndarray) -> Sliding:
    """Motion of a target at a point (m), given its relative motion (12,), as rate along the normal and sliding."""
    vx, vy, vz = velocity_at(
        (px, py, pz), (m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8], m[9], m[10], m[11])
    )  # fmt: skip
    rate = vx * nx + vy * ny + vz * nz
    return Sliding(rate, vx - rate * nx, vy - rate * ny, vz - rate * nz)


def _advance_point(world: int, point: int, law: ContactLaw, sensor: SensorArrays, worlds: Worlds, slots: Slots) -> None:
    """Bring bristles and the memory of effects from the step's beginning to its end."""
    stiff, scale = sensor.multipliers[point, 0], sensor.multipliers[point, 1]
    painted = scaled_law(law, stiff, scale)
    deepest, deepest_rate, deepest_slide = 0.0, 0.0, 0.0
    for target in range(slots.pressed.shape[1]):
        if slots.pressed[world, target, point] >= 0.0:
            n = slots.normal[world, target, point]
            px, py, pz = contact_point(point, slots.pressed[world, target, point], sensor)
            nx, ny, nz = n[0], n[1], n[2]
            moved = _sliding_at(px, py, pz, nx, ny, nz, worlds.motion[world, target])
            square = moved.x * moved.x + moved.y * moved.y + moved.z * moved.z
            end = slots.depth[world, target, point] + sensor.dt * moved.rate
            tangent = _tangent(
                world, TexelMotion(slots.depth[world, target, point], moved.rate, 0.0, math.sqrt(square)), painted, scale,
                sensor, slots.memory[world, point],
            )  # fmt: skip
            z = slots.bristle[world, target, point]
            zx, zy, zz = z[0], z[1], z[2]
            contact = linearise_contact(
                (nx, ny, nz), (zx, zy, zz),
                (moved.x + moved.rate * nx, moved.y + moved.rate * ny, moved.z + moved.rate * nz), tangent, sensor.dt, law,
            )  # fmt: skip
            _move_bristle(contact, _sliding_at(px, py, pz, nx, ny, nz, worlds.end_motion[world, target]), z)
            if end > deepest:
                deepest, deepest_rate, deepest_slide = end, moved.rate, sensor.dt * math.sqrt(square)
    if HAS_EFFECTS == 1:
        force_with_effects(
            STEP, TexelMotion(deepest, deepest_rate, deepest_slide, 0.0), whole_texel_law(painted, sensor.share, 1.0),
            sensor.force_constants[world], slots.memory[world, point], True,
        )  # fmt: skip


def _tangent(
    world: int, motion: TexelMotion, painted: ContactLaw, scale: float, sensor: SensorArrays, memory: np.ndarray
) -> Tangent:
    """Return the normal law at the step's end, linearised, and what effects and paint make of friction."""
    bias, slope = normal_tangent(motion.depth, motion.rate, sensor.dt, painted)
    viscosity, pulls = 0.0, sensor.pulls == 1
    if HAS_EFFECTS == 1:
        end = motion.depth + sensor.dt * motion.rate
        force, by_depth, by_rate = force_with_effects(
            STEP, TexelMotion(end, motion.rate, 0.0, motion.speed), whole_texel_law(painted, sensor.share, 1.0),
            sensor.force_constants[world], memory, False,
        )  # fmt: skip
        factor, viscosity = friction_with_effects(motion.speed, force, sensor.friction_constants[world])
        slope = sensor.share * max(by_depth * sensor.dt + by_rate, 0.0) if end > 0.0 else 0.0
        bias = sensor.share * force - slope * motion.rate
        scale, viscosity = scale * factor, sensor.share * viscosity
    return Tangent(bias, slope, scale, viscosity, pulls)


def _move_bristle(contact: LinearContact, v: Sliding, z: np.ndarray) -> None:
    """Bring a bristle (3,) to the step's end, given the sliding in the sensor's axes at that time."""
    zx = next_deflection(contact.keep, z[0], contact.gain, v.x)
    zy = next_deflection(contact.keep, z[1], contact.gain, v.y)
    zz = next_deflection(contact.keep, z[2], contact.gain, v.z)
    scale = deflection_scale(zx * zx + zy * zy + zz * zz, contact.limit)
    z[0], z[1], z[2] = scale * zx, scale * zy, scale * zz


def contact_point(point: int, pressed: float, sensor: SensorArrays) -> tuple[float, float, float]:
    """Return where a contact point touches, given the share of the maximum penetration that is pressed in, in metres."""
    way, f = pressed * sensor.reach, sensor.frame
    return f[0, point] - way * f[3, point], f[1, point] - way * f[4, point], f[2, point] - way * f[5, point]


def find_contact(
    world: int, target: int, point: int, sensor: SensorArrays, targets: TargetArrays, tree: Tree, worlds: Worlds, slots: Slots
) -> None:
    """Find where a contact point touches a target now, and write it down; a bristle is zero where nothing touches."""
    m, f, reach = worlds.pose[world, target], sensor.frame, sensor.reach
    px, py, pz, ax, ay, az = f[0, point], f[1, point], f[2, point], f[3, point], f[4, point], f[5, point]
    tx = m[9] + m[0] * px + m[1] * py + m[2] * pz
    ty = m[10] + m[3] * px + m[4] * py + m[5] * pz
    tz = m[11] + m[6] * px + m[7] * py + m[8] * pz
    dx = reach * (m[0] * ax + m[1] * ay + m[2] * az)
    dy = reach * (m[3] * ax + m[4] * ay + m[5] * az)
    dz = reach * (m[6] * ax + m[7] * ay + m[8] * az)
    segment, before = Segment(tx - dx, ty - dy, tz - dz, dx, dy, dz), slots.pressed[world, target, point]
    found = _entry(segment, target, before, slots.triangle[world, target, point], reach, targets, tree)
    slots.triangle[world, target, point] = found.triangle
    if not (0.0 <= found.t <= 1.0):
        slots.pressed[world, target, point] = TOO_DEEP if found.inside else NO_CONTACT
        for i in range(3):
            slots.bristle[world, target, point, i] = 0.0
            slots.force[world, target, point, i] = 0.0
        return
    pressed, n = 1.0 - found.t, slots.normal[world, target, point]
    slots.pressed[world, target, point] = pressed
    slots.depth[world, target, point] = pressed * abs(dx * found.nx + dy * found.ny + dz * found.nz)
    z = slots.bristle[world, target, point]
    for i in range(3):
        n[i] = m[i] * found.nx + m[3 + i] * found.ny + m[6 + i] * found.nz
    zx, zy, zz = turned_into_plane((z[0], z[1], z[2]), (n[0], n[1], n[2]))
    z[0], z[1], z[2] = zx, zy, zz


def _entry(segment: Segment, target: int, before: float, hint: int, length: float, targets: TargetArrays, tree: Tree) -> Entry:
    """Return where a segment of a length (m) enters a target."""
    if targets.kind[target] == MESH:
        return _mesh_entry(segment, targets.mesh[target], before, hint, tree)
    return _shape_entry(
        targets.kind[target], (targets.size[target, 0], targets.size[target, 1], targets.size[target, 2]),
        (segment.ox, segment.oy, segment.oz), (segment.dx / length, segment.dy / length, segment.dz / length), length,
    )  # fmt: skip


def _shape_entry(kind: int, size: Vector, base: Vector, way: Vector, length: float) -> Entry:
    """Return where a segment of a length (m) enters a shape, as :mod:`.shape_contacts` has it."""
    if is_in_shape(kind, size, base):
        return Entry(2.0, 0.0, 0.0, 0.0, -1, True)
    enters, axis = shape_entry(kind, size, base, way)
    if not (0.0 <= enters <= length):
        return Entry(2.0, 0.0, 0.0, 0.0, -1, False)
    nx, ny, nz = shape_normal(
        kind, size, axis, (base[0] + enters * way[0], base[1] + enters * way[1], base[2] + enters * way[2])
    )  # fmt: skip
    return Entry(enters / length, nx, ny, nz, -1, False)


def _mesh_entry(segment: Segment, mesh: int, before: float, hint: int, tree: Tree) -> Entry:
    """Return where a segment enters a mesh; past the maximum penetration as :mod:`.narrow_phase` has it."""
    t, triangle, leaving = segment_entry(segment, mesh, hint, tree)
    if triangle >= 0:
        return Entry(t, tree.faces[triangle, 9], tree.faces[triangle, 10], tree.faces[triangle, 11], triangle, False)
    inside = leaving <= 1.0
    ox, oy, oz, dx, dy, dz = segment
    if not inside and (before == TOO_DEEP or before > NEARLY_TOO_DEEP):
        size, root = 1.0, tree.roots[mesh]
        b = tree.bounds[root]
        in_box = (
            min(ox, ox + dx) <= b[3] and max(ox, ox + dx) >= b[0]
            and min(oy, oy + dy) <= b[4] and max(oy, oy + dy) >= b[1]
            and min(oz, oz + dz) <= b[5] and max(oz, oz + dz) >= b[2]
        )  # fmt: skip
        inside = in_box
        if in_box and before >= 0.0:  # a long line from the base leaves the surface before it enters it
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            for i in range(3):
                size += (b[3 + i] - b[i]) / length
            far, _, out = segment_entry(Segment(ox, oy, oz, size * dx, size * dy, size * dz), mesh, -1, tree)
            inside = out < far
    return Entry(2.0, 0.0, 0.0, 0.0, -1, inside)


def _write_force(
    world: int, target: int, point: int, law: ContactLaw, sensor: SensorArrays, worlds: Worlds, slots: Slots
) -> float:
    """Write the force of a contact on the sensor, and return its normal part (N)."""
    stiff, scale = sensor.multipliers[point, 0], sensor.multipliers[point, 1]
    painted, depth = scaled_law(law, stiff, scale), slots.depth[world, target, point]
    n, z = slots.normal[world, target, point], slots.bristle[world, target, point]
    px, py, pz = contact_point(point, slots.pressed[world, target, point], sensor)
    v = _sliding_at(px, py, pz, n[0], n[1], n[2], worlds.past_motion[world, target])
    square = v.x * v.x + v.y * v.y + v.z * v.z
    fn = normal_force(depth, v.rate, painted)
    factor, viscosity = 1.0, 0.0
    if HAS_EFFECTS == 1:
        speed = math.sqrt(square)
        whole, _, _ = force_with_effects(
            NOW, TexelMotion(depth, v.rate, 0.0, speed), whole_texel_law(painted, sensor.share, 1.0),
            sensor.force_constants[world], slots.memory[world, point], False,
        )  # fmt: skip
        factor, viscosity = friction_with_effects(speed, whole, sensor.friction_constants[world])
        fn = sensor.share * whole
    friction = with_friction(painted, factor, sensor.share * viscosity)
    held = deflection_scale(z[0] * z[0] + z[1] * z[1] + z[2] * z[2], max_bristle_deflection(fn, friction))
    fx, fy, fz = 0.0, 0.0, 0.0
    if fn > 0.0:
        zx, zy, zz, decay = held * z[0], held * z[1], held * z[2], sliding_decay(square, fn, friction)
        fx = friction_force(zx, rate_under_decay(zx, v.x, decay), v.x, friction)
        fy = friction_force(zy, rate_under_decay(zy, v.y, decay), v.y, friction)
        fz = friction_force(zz, rate_under_decay(zz, v.z, decay), v.z, friction)
    f = slots.force[world, target, point]
    f[0], f[1], f[2] = fx + fn * n[0], fy + fn * n[1], fz + fn * n[2]
    return fn


# --- wrenches


def finish_world(
    world: int, lane: int, lanes: int, sensor: SensorArrays, worlds: Worlds, slots: Slots, jumps: Jumps, out: Results
) -> None:
    """End the step of an environment, for which its texels have been pressed; this and what it calls take a block of threads.

    The threads share the contact points: each begins with that of its number, `lane`, and goes on by `lanes`.
    """
    sum_world(world, lane, lanes, sensor, worlds, slots, out)
    mark_jumps(world, lane, lanes, worlds, jumps, out)
    if lane == 0:
        end_step(world, worlds)


def sum_world(world: int, lane: int, lanes: int, sensor: SensorArrays, worlds: Worlds, slots: Slots, out: Results) -> None:
    """Sum up the wrench on each target of an environment, in the world about the target's origin."""
    too_deep = 0.0
    for target in range(out.wrench.shape[1]):
        fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if worlds.valid[world]:
            for point in range(lane, slots.pressed.shape[2], lanes):
                pressed = slots.pressed[world, target, point]
                if pressed == TOO_DEEP:
                    too_deep += 1.0
                if pressed >= 0.0:
                    f = slots.force[world, target, point]
                    px, py, pz = contact_point(point, pressed, sensor)
                    fx, fy, fz = fx + f[0], fy + f[1], fz + f[2]
                    mx += py * f[2] - pz * f[1]
                    my += pz * f[0] - px * f[2]
                    mz += px * f[1] - py * f[0]
        fx, fy, fz = block_sum(fx), block_sum(fy), block_sum(fz)
        mx, my, mz = block_sum(mx), block_sum(my), block_sum(mz)
        if lane == 0:
            _write_wrench((fx, fy, fz), (mx, my, mz), worlds.valid[world], worlds.poses[world], 1 + target,
                          out.wrench[world, target])  # fmt: skip
    too_deep = block_sum(too_deep)
    if lane == 0:
        out.too_deep[world] = int(too_deep)


def _write_wrench(force: Vector, torque: Vector, valid: bool, poses: np.ndarray, body: int, wrench: np.ndarray) -> None:
    """Write what a body exerts on the sensor, given about its origin in its frame, as the wrench (6,) on the body."""
    for i in range(6):
        wrench[i] = 0.0
    if valid:
        at, quaternion, rotation = np.zeros(3), np.zeros(4), np.zeros((3, 3))
        place_next(poses[0], at, quaternion)
        write_rotation(quaternion, rotation)
        for i in range(3):
            wrench[i] = -(rotation[i, 0] * force[0] + rotation[i, 1] * force[1] + rotation[i, 2] * force[2])
            wrench[3 + i] = -(rotation[i, 0] * torque[0] + rotation[i, 1] * torque[1] + rotation[i, 2] * torque[2])
        x, y, z = at[0] - poses[body, 0], at[1] - poses[body, 1], at[2] - poses[body, 2]
        wrench[3] += y * wrench[2] - z * wrench[1]
        wrench[4] += z * wrench[0] - x * wrench[2]
        wrench[5] += x * wrench[1] - y * wrench[0]


def mark_jumps(world: int, lane: int, lanes: int, worlds: Worlds, jumps: Jumps, out: Results) -> None:
    """Write down whether a target of an environment went through the sensor, and where targets are now."""
    crossed, measures = 0.0, 0.0
    for target in range(jumps.sphere.shape[0]):
        pose, sphere, old = worlds.pose[world, target], jumps.sphere[target], jumps.centre[world, target]
        sx, sy, sz, b = old[0], old[1], old[2], jumps.bound
        dx, dy, dz = sphere[0] - pose[9], sphere[1] - pose[10], sphere[2] - pose[11]
        x = pose[0] * dx + pose[3] * dy + pose[6] * dz
        y = pose[1] * dx + pose[4] * dy + pose[7] * dz
        z = pose[2] * dx + pose[5] * dy + pose[8] * dz
        if worlds.valid[world] and not worlds.fresh[world]:
            if meets_sphere((sx, sy, sz), (x, y, z), sphere[3] + b[3], (b[0], b[1], b[2])):
                for texel in range(lane, jumps.frame.shape[0], lanes):
                    f = jumps.frame[texel]
                    if crosses_texel((sx, sy, sz), (x, y, z), sphere[3], (f[0], f[1], f[2]), (f[3], f[4], f[5])):
                        crossed = 1.0
                    if out.contact[world, texel]:
                        measures = 1.0
        wait_for_block()  # before one of the threads writes where the target is
        if lane == 0:
            old[0], old[1], old[2] = x, y, z
    crossed, measures = block_sum(crossed), block_sum(measures)
    if lane == 0:
        jumps.jumped[world] = crossed > 0.0 and not (measures > 0.0 or out.too_deep[world] > 0)


def end_step(world: int, worlds: Worlds) -> None:
    """Let the next step of an environment begin where this one ends."""
    worlds.begins[world] = not worlds.valid[world]
    if worlds.valid[world]:
        for body in range(worlds.poses.shape[1]):
            place_next(worlds.poses[world, body], worlds.position[world, body], worlds.quaternion[world, body])


def reset_worlds(world: int, mask: BoolArray, worlds: Worlds) -> None:
    """Let the environments of a mask begin with their next step."""
    if mask[world]:
        worlds.begins[world] = True
