# SPDX-License-Identifier: GPL-3.0-or-later
"""A step of pressed sensors in many environments, in the part of Python that :mod:`.translation` makes Warp kernels of.

A step is three kernels, one after the other, without a word to the host between them: how the bodies of each environment move
(:func:`move_world`); what each texel measures (:func:`press_texel`); and the wrenches (:func:`finish_world`). No thread goes
through the texels: each texel has a thread of its own, and the threads of a block add them up. Arrays of contact points have
these in their last axis, so that neighbouring threads read neighbouring numbers.
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
from ...geometry.rotations import write_rotation, write_step_motion, write_velocity
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
from ...solver.detection.shape_contacts import in_sensor_axes, in_target_axes, write_pose
from ...solver.dynamics.contact_assembly import LinearContact, Tangent, linearise_contact
from ...solver.dynamics.effect_kernels import FULL_STEP, NO_TIME
from ...solver.dynamics.friction_state import relative_motion, velocity_at
from ...solver.jumps import crosses_texel, meets_sphere
from ...solver.pressing import are_poses, write_reaction
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


class Touch(NamedTuple):
    """Where a contact point touches a target.

    Attributes
    ----------
    pressed : float
        As in :attr:`.Slots.pressed`.
    depth : float, metres
    px, py, pz : float, metres
        Contact point, in the sensor's frame.
    nx, ny, nz, zx, zy, zz : float
        Normal of the target and bristle deflection (m), in the sensor's frame.
    """

    pressed: float
    depth: float
    px: float
    py: float
    pz: float
    nx: float
    ny: float
    nz: float
    zx: float
    zy: float
    zz: float


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


def move_world(world: int, lane: int, lanes: int, sensor: SensorArrays, worlds: Worlds) -> None:
    """Write how the targets of an environment move relative to the sensor over a step, whose end is at its poses.

    The threads of a block share the work: each begins with the part of its number, `lane`, and goes on by `lanes`.
    """
    valid, begins = are_poses(worlds.poses[world]), worlds.begins[world]
    if lane == 0:
        worlds.valid[world] = valid
    if valid:
        if lane == 0:
            worlds.fresh[world] = begins
        for part in range(lane, 2 * worlds.poses.shape[1], lanes):
            _place_body(world, part % 2, part // 2, begins, sensor.dt, worlds)
    wait_for_block()
    if valid:
        for part in range(lane, 2 * worlds.pose.shape[1], lanes):
            _relate_target(world, part % 2, part // 2, sensor.dt, worlds)


def _place_body(world: int, end: int, body: int, begins: bool, dt: float, worlds: Worlds) -> None:
    """Write where a body is when a step begins (0) or ends (1), and how its points move, as seen from there."""
    to, turned, velocity, row = np.zeros(3), np.zeros(4), np.zeros(6), end * worlds.poses.shape[1] + body
    place_next(worlds.poses[world, body], to, turned)
    if not begins:
        write_velocity(worlds.position[world, body], worlds.quaternion[world, body], to, turned, dt, velocity)
    if begins or end == 1:  # another thread reads where the step begins
        for i in range(3):
            worlds.position[world, row, i] = to[i]
        for i in range(4):
            worlds.quaternion[world, row, i] = turned[i]
    write_step_motion(velocity, dt if end == 0 else -dt, worlds.step_motion[world, row])
    write_rotation(worlds.quaternion[world, row], worlds.rotation[world, row])


def _relate_target(world: int, end: int, target: int, dt: float, worlds: Worlds) -> None:
    """Write how a target moves relative to the sensor, as seen from the step's beginning (0) or from its end (1)."""
    motion, turned, row = np.zeros(12), np.zeros(12), end * worlds.poses.shape[1]
    relative_motion(
        row, row + 1 + target, worlds.step_motion[world], worlds.position[world], worlds.rotation[world], motion
    )  # fmt: skip
    _write_row(motion, worlds.motion[world, end, target])
    if end == 0:
        _turn_motion(dt, worlds.step_motion[world, 0], worlds.rotation[world, 0], motion, turned)
        _write_row(turned, worlds.end_motion[world, target])
    else:
        write_pose(row, row + 1 + target, worlds.position[world], worlds.rotation[world], turned)
        _write_row(turned, worlds.pose[world, target])


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
    _write_row(motion, out)
    for k in range(3):
        for m in range(3):
            turn = 0.0  # entry (m, k) of the sensor's W in its own axes
            for i in range(3):
                for j in range(3):
                    turn += rotation[i, m] * step_motion[3 + 3 * i + j] * rotation[j, k]
            out[k] += dt * turn * motion[m]
            for j in range(3):
                out[3 + 3 * k + j] += dt * turn * motion[3 + 3 * m + j]


# --- what a texel measures


def press_texel(
    world: int, texel: int, sensor: SensorArrays, targets: TargetArrays, tree: Tree, worlds: Worlds, slots: Slots, out: Results
) -> None:
    """Bring the contact points of a texel to the step's end, and write down what the texel measures there."""
    force = press_points(world, texel, sensor, targets, tree, worlds, slots, out)
    write_reading(world, texel, force, sensor, worlds, slots, out)


def press_points(
    world: int, texel: int, sensor: SensorArrays, targets: TargetArrays, tree: Tree, worlds: Worlds, slots: Slots, out: Results
) -> float:
    """Bring the contact points of a texel to the step's end, write down its force there, and return the normal part (N)."""
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
                touch = find_contact(world, target, point, sensor, targets, tree, worlds, slots)
                if touch.pressed >= 0.0:
                    fn, fx, fy, fz = _contact_force(world, target, point, touch, law, sensor, worlds, slots)
                    slots.force[world, target, 0, point] = fx
                    slots.force[world, target, 1, point] = fy
                    slots.force[world, target, 2, point] = fz
                    force += fn
                    along_x += fx * sensor.frame[6, point] + fy * sensor.frame[7, point] + fz * sensor.frame[8, point]
                    along_y += fx * sensor.frame[9, point] + fy * sensor.frame[10, point] + fz * sensor.frame[11, point]
                    touched = True
    out.texels[world, texel, 0] = force
    out.texels[world, texel, 1] = along_x
    out.texels[world, texel, 2] = along_y
    out.contact[world, texel] = touched
    return force


def write_reading(
    world: int, texel: int, force: float, sensor: SensorArrays, worlds: Worlds, slots: Slots, out: Results
) -> None:
    """Write down the reading for the normal force of a texel, N."""
    reading = 0.0
    if worlds.valid[world]:
        n = sensor.first_point.shape[0] - 1
        row = texel if sensor.conversion.shape[0] == n else world * n + texel
        zero, scale = sensor.conversion[row, 0], sensor.conversion[row, 1]
        step_length = 0 if worlds.fresh[world] else 1
        if worlds.fresh[world]:
            for i in range(slots.reading_memory.shape[2]):
                for j in range(slots.reading_memory.shape[3]):
                    slots.reading_memory[world, texel, i, j] = 0.0
        reading = reading_with_effects(
            force, zero, scale, step_length, sensor.reading_constants[world], slots.reading_memory[world, texel]
        )  # fmt: skip
    out.readings[world, texel] = reading


def begin_point(world: int, point: int, slots: Slots) -> None:
    """Forget all that a contact point remembers."""
    for target in range(slots.pressed.shape[1]):
        slots.pressed[world, target, point] = NO_CONTACT
        slots.triangle[world, target, point] = -1
        for i in range(3):
            slots.bristle[world, target, i, point] = 0.0
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
    deepest, deepest_rate, deepest_slide_step = 0.0, 0.0, 0.0
    for target in range(slots.pressed.shape[1]):
        pressed, depth = slots.pressed[world, target, point], slots.depth[world, target, point]
        n, z = slots.normal, slots.bristle
        nx, ny, nz = n[world, target, 0, point], n[world, target, 1, point], n[world, target, 2, point]
        zx, zy, zz = z[world, target, 0, point], z[world, target, 1, point], z[world, target, 2, point]
        if pressed >= 0.0:  # a GPU has read all of them at a time
            px, py, pz = contact_point(point, pressed, sensor)
            moved = _sliding_at(px, py, pz, nx, ny, nz, worlds.motion[world, 0, target])
            square = moved.x * moved.x + moved.y * moved.y + moved.z * moved.z
            end = depth + sensor.dt * moved.rate
            tangent = _tangent(
                world, TexelMotion(depth, moved.rate, 0.0, math.sqrt(square)), painted, scale, sensor,
                slots.memory[world, point],
            )  # fmt: skip
            contact = linearise_contact(
                (nx, ny, nz), (zx, zy, zz),
                (moved.x + moved.rate * nx, moved.y + moved.rate * ny, moved.z + moved.rate * nz), tangent, sensor.dt, law,
            )  # fmt: skip
            v = _sliding_at(px, py, pz, nx, ny, nz, worlds.end_motion[world, target])
            zx, zy, zz = _next_bristle(contact, v, (zx, zy, zz))
            z[world, target, 0, point] = zx
            z[world, target, 1, point] = zy
            z[world, target, 2, point] = zz
            if end > deepest:
                deepest, deepest_rate, deepest_slide_step = end, moved.rate, sensor.dt * math.sqrt(square)
    if HAS_EFFECTS == 1:
        force_with_effects(
            FULL_STEP, TexelMotion(deepest, deepest_rate, deepest_slide_step, 0.0), whole_texel_law(painted, sensor.share, 1.0),
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
            FULL_STEP, TexelMotion(end, motion.rate, 0.0, motion.speed), whole_texel_law(painted, sensor.share, 1.0),
            sensor.force_constants[world], memory, False,
        )  # fmt: skip
        factor, viscosity = friction_with_effects(motion.speed, force, sensor.friction_constants[world])
        slope = sensor.share * max(by_depth * sensor.dt + by_rate, 0.0) if end > 0.0 else 0.0
        bias = sensor.share * force - slope * motion.rate
        scale, viscosity = scale * factor, sensor.share * viscosity
    return Tangent(bias, slope, scale, viscosity, pulls)


def _next_bristle(contact: LinearContact, v: Sliding, bristle: Vector) -> tuple[float, float, float]:
    """Return a bristle at the step's end, given the sliding in the sensor's axes at that time."""
    zx = next_deflection(contact.keep, bristle[0], contact.gain, v.x)
    zy = next_deflection(contact.keep, bristle[1], contact.gain, v.y)
    zz = next_deflection(contact.keep, bristle[2], contact.gain, v.z)
    scale = deflection_scale(zx * zx + zy * zy + zz * zz, contact.limit)
    return scale * zx, scale * zy, scale * zz


def contact_point(point: int, pressed: float, sensor: SensorArrays) -> tuple[float, float, float]:
    """Return where a contact point touches, given the share of the maximum penetration that is pressed in, in metres."""
    way, f = pressed * sensor.reach, sensor.frame
    return f[0, point] - way * f[3, point], f[1, point] - way * f[4, point], f[2, point] - way * f[5, point]


def find_contact(
    world: int, target: int, point: int, sensor: SensorArrays, targets: TargetArrays, tree: Tree, worlds: Worlds, slots: Slots
) -> Touch:
    """Find where a contact point touches a target now, and write it down; a bristle is zero where nothing touches."""
    m, f, reach = worlds.pose[world, target], sensor.frame, sensor.reach
    px, py, pz, ax, ay, az = f[0, point], f[1, point], f[2, point], f[3, point], f[4, point], f[5, point]
    tx = m[9] + m[0] * px + m[1] * py + m[2] * pz
    ty = m[10] + m[3] * px + m[4] * py + m[5] * pz
    tz = m[11] + m[6] * px + m[7] * py + m[8] * pz
    dx, dy, dz = in_target_axes((ax, ay, az), m)
    dx, dy, dz = reach * dx, reach * dy, reach * dz
    segment, before = Segment(tx - dx, ty - dy, tz - dz, dx, dy, dz), slots.pressed[world, target, point]
    hint, is_mesh = -1, targets.kind[target] == MESH
    if is_mesh:
        hint = slots.triangle[world, target, point]
    found = _entry(segment, target, before, hint, reach, targets, tree)
    if is_mesh:
        slots.triangle[world, target, point] = found.triangle
    z = slots.bristle
    if not (0.0 <= found.t <= 1.0):
        pressed = TOO_DEEP if found.inside else NO_CONTACT
        slots.pressed[world, target, point] = pressed
        for i in range(3):
            z[world, target, i, point] = 0.0
            slots.force[world, target, i, point] = 0.0
        return Touch(pressed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    pressed = 1.0 - found.t
    depth, way = pressed * abs(dx * found.nx + dy * found.ny + dz * found.nz), pressed * reach
    nx, ny, nz = in_sensor_axes((found.nx, found.ny, found.nz), m)
    zx, zy, zz = turned_into_plane(
        (z[world, target, 0, point], z[world, target, 1, point], z[world, target, 2, point]), (nx, ny, nz)
    )  # fmt: skip
    slots.pressed[world, target, point] = pressed
    slots.depth[world, target, point] = depth
    n = slots.normal
    n[world, target, 0, point], n[world, target, 1, point], n[world, target, 2, point] = nx, ny, nz
    z[world, target, 0, point], z[world, target, 1, point], z[world, target, 2, point] = zx, zy, zz
    return Touch(pressed, depth, px - way * ax, py - way * ay, pz - way * az, nx, ny, nz, zx, zy, zz)


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


def _contact_force(
    world: int, target: int, point: int, at: Touch, law: ContactLaw, sensor: SensorArrays, worlds: Worlds, slots: Slots
) -> tuple[float, float, float, float]:
    """Return the normal part of a contact's force on the sensor, and the force in the sensor's frame (N)."""
    stiff, scale = sensor.multipliers[point, 0], sensor.multipliers[point, 1]
    painted = scaled_law(law, stiff, scale)
    v = _sliding_at(at.px, at.py, at.pz, at.nx, at.ny, at.nz, worlds.motion[world, 1, target])
    square = v.x * v.x + v.y * v.y + v.z * v.z
    fn = normal_force(at.depth, v.rate, painted)
    factor, viscosity = 1.0, 0.0
    if HAS_EFFECTS == 1:
        speed = math.sqrt(square)
        whole, _, _ = force_with_effects(
            NO_TIME, TexelMotion(at.depth, v.rate, 0.0, speed), whole_texel_law(painted, sensor.share, 1.0),
            sensor.force_constants[world], slots.memory[world, point], False,
        )  # fmt: skip
        factor, viscosity = friction_with_effects(speed, whole, sensor.friction_constants[world])
        fn = sensor.share * whole
    friction = with_friction(painted, factor, sensor.share * viscosity)
    held = deflection_scale(at.zx * at.zx + at.zy * at.zy + at.zz * at.zz, max_bristle_deflection(fn, friction))
    fx, fy, fz = 0.0, 0.0, 0.0
    if fn > 0.0:
        zx, zy, zz, decay = held * at.zx, held * at.zy, held * at.zz, sliding_decay(square, fn, friction)
        fx = friction_force(zx, rate_under_decay(zx, v.x, decay), v.x, friction)
        fy = friction_force(zy, rate_under_decay(zy, v.y, decay), v.y, friction)
        fz = friction_force(zz, rate_under_decay(zz, v.z, decay), v.z, friction)
    return fn, fx + fn * at.nx, fy + fn * at.ny, fz + fn * at.nz


# --- wrenches


def finish_world(
    world: int, lane: int, lanes: int, sensor: SensorArrays, worlds: Worlds, slots: Slots, jumps: Jumps, out: Results
) -> None:
    """End the step of an environment whose texels have been pressed; the threads of a block share its contact points."""
    sum_world(world, lane, lanes, sensor, worlds, slots, out)
    mark_jumps(world, lane, lanes, worlds, jumps, out)
    end_step(world, lane, lanes, worlds)


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
                    f = slots.force
                    x, y, z = f[world, target, 0, point], f[world, target, 1, point], f[world, target, 2, point]
                    px, py, pz = contact_point(point, pressed, sensor)
                    fx, fy, fz = fx + x, fy + y, fz + z
                    mx += py * z - pz * y
                    my += pz * x - px * z
                    mz += px * y - py * x
        fx, fy, fz = block_sum(fx), block_sum(fy), block_sum(fz)
        mx, my, mz = block_sum(mx), block_sum(my), block_sum(mz)
        if lane == 0:
            net = np.zeros(6)
            net[0], net[1], net[2], net[3], net[4], net[5] = fx, fy, fz, mx, my, mz
            at, turned, sensor_body = worlds.position[world], worlds.rotation[world], worlds.poses.shape[1]  # at the step's end
            write_reaction(net, turned[sensor_body], at[sensor_body], at[sensor_body + 1 + target], out.wrench[world, target])
    too_deep = block_sum(too_deep)
    if lane == 0:
        out.too_deep[world] = int(too_deep)


def mark_jumps(world: int, lane: int, lanes: int, worlds: Worlds, jumps: Jumps, out: Results) -> None:
    """Write down whether a target of an environment went through the sensor, and where targets are now."""
    crossed, measures = 0.0, 0.0
    for target in range(jumps.sphere.shape[0]):
        pose, sphere, old = worlds.pose[world, target], jumps.sphere[target], jumps.centre[world, target]
        sx, sy, sz = old[0], old[1], old[2]
        x, y, z = in_sensor_axes((sphere[0] - pose[9], sphere[1] - pose[10], sphere[2] - pose[11]), pose)
        if worlds.valid[world] and not worlds.fresh[world]:
            b = jumps.bound
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


def end_step(world: int, lane: int, lanes: int, worlds: Worlds) -> None:
    """Let the next step of an environment begin where this one ends."""
    if lane == 0:
        worlds.begins[world] = not worlds.valid[world]
    if worlds.valid[world]:
        bodies = worlds.poses.shape[1]
        for body in range(lane, bodies, lanes):
            for i in range(3):
                worlds.position[world, body, i] = worlds.position[world, bodies + body, i]
            for i in range(4):
                worlds.quaternion[world, body, i] = worlds.quaternion[world, bodies + body, i]


def reset_worlds(world: int, mask: BoolArray, worlds: Worlds) -> None:
    """Let the environments of a mask begin with their next step."""
    if mask[world]:
        worlds.begins[world] = True
