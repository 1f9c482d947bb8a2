# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts with spheres, boxes, capsules and planes in closed form (kernels).

The segment of a contact point and its maximum penetration are those of meshes (see :mod:`.narrow_phase`); only where a segment
enters is computed otherwise, and a point is too deep whenever its segment begins inside. All follows from where the bodies are,
so nothing is remembered but the bristles. A block of points is computed in vector registers, and what touches is kept.
"""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.bvh import Segment
from ...geometry.shapes import (
    BOX,
    CAPSULE,
    PLANE,
    SPHERE,
    Vector,
    is_in_shape,
    shape_distance,
    shape_entry,
    shape_normal,
)
from ..solver_model import Pairs, SolverModel, State
from ..workspace import ContactWork, Workspace
from .detection_data import BRISTLE, DEPTH, KEEP, LANES, NORMAL, POINT, ROW, DetectionData, read_vector, write_vector


@kernel
def write_relative_pose(pair: int, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write the sensor's rotation (row by row) and position in the target's frame into the pair's pose."""
    a, b = model.pairs.sensor_body[pair], model.pairs.target_body[pair]
    write_pose(a, b, state.position, workspace.bodies.rotation, workspace.pairs.pose[pair])


@inlined
def write_pose(a: int, b: int, position: np.ndarray, rotation: np.ndarray, pose: np.ndarray) -> None:
    """Write the rotation (row by row) and position of body `a` in the frame of body `b` into `pose` (12,)."""
    for i in range(3):
        total = 0.0
        for k in range(3):
            total += rotation[b, k, i] * (position[a, k] - position[b, k])
        pose[9 + i] = total
        for j in range(3):
            pose[3 * i + j] = (
                rotation[b, 0, i] * rotation[a, 0, j]
                + rotation[b, 1, i] * rotation[a, 1, j]
                + rotation[b, 2, i] * rotation[a, 2, j]
            )


@inlined
def in_target_axes(vector: Vector, pose: np.ndarray) -> Vector:
    """Return a vector of the sensor in the target's axes; `pose` is the sensor's in the target's frame, also as a tuple."""
    x, y, z = vector
    return (
        pose[0] * x + pose[1] * y + pose[2] * z,
        pose[3] * x + pose[4] * y + pose[5] * z,
        pose[6] * x + pose[7] * y + pose[8] * z,
    )


@inlined
def segment_at(place: Vector, normal: Vector, reach: float, pose: np.ndarray) -> tuple[Segment, Vector]:
    """Segment in the target's frame from `reach` (m) deep in the sensor to a contact point, and its tip.

    `pose` is the pair's, also as a tuple.
    """
    x, y, z = place
    tx = pose[9] + pose[0] * x + pose[1] * y + pose[2] * z
    ty = pose[10] + pose[3] * x + pose[4] * y + pose[5] * z
    tz = pose[11] + pose[6] * x + pose[7] * y + pose[8] * z
    dx, dy, dz = in_target_axes(normal, pose)
    dx, dy, dz = reach * dx, reach * dy, reach * dz
    return Segment(tx - dx, ty - dy, tz - dz, dx, dy, dz), (tx, ty, tz)


@inlined
def segment_of(point: int, reach: float, pose: np.ndarray, frame: np.ndarray) -> tuple[Segment, Vector]:
    """Do as :func:`segment_at` for a contact point by its number."""
    place, normal = (frame[point, 0], frame[point, 1], frame[point, 2]), (frame[point, 3], frame[point, 4], frame[point, 5])
    return segment_at(place, normal, reach, pose)


@inlined
def clear_slot(slot: int, triangle: int, state: State) -> None:
    """Write that the point of a slot does not act: `triangle` is NO_TRIANGLE or TOO_DEEP."""
    state.triangle[slot] = triangle
    for i in range(3):
        state.bristle[slot, i] = 0.0
    state.pressed_share[slot] = 0.0


@inlined
def in_sensor_axes(vector: Vector, pose: np.ndarray) -> Vector:
    """Return a vector of the target in the sensor's axes; `pose` is the sensor's in the target's frame, also as a tuple."""
    x, y, z = vector
    return (
        pose[0] * x + pose[3] * y + pose[6] * z,
        pose[1] * x + pose[4] * y + pose[7] * z,
        pose[2] * x + pose[5] * y + pose[8] * z,
    )


@inlined
def place_behind(place: Vector, normal: Vector, distance: float) -> Vector:
    """Return the place at a distance (m) behind a contact point, back along its normal."""
    return place[0] - distance * normal[0], place[1] - distance * normal[1], place[2] - distance * normal[2]


@inlined
def write_row(
    place: tuple[int, int],
    point: int,
    met: tuple[tuple[float, float, float], float, tuple[float, float, float]],
    segment: Segment,
    pose: np.ndarray,
    geometry: tuple[float, np.ndarray],
    rows: np.ndarray,
) -> None:
    """Write a contact into its row.

    Parameters
    ----------
    place : (int, int)
        Block and lane.
    point : int
        Contact point.
    met : ((x, y, z), float, (x, y, z))
        Normal of the target in its frame, share of the segment that is inside of it, and bristle deflection (m).
    segment : Segment
    pose : (12,) float
        See :attr:`.PairWork.pose`.
    geometry : (float, (N, 12) float)
        The maximum penetration (m) and :attr:`.Points.frame`.
    rows : (blocks, ROW) float
    """
    (block, lane), ((fx, fy, fz), inside, bristle), (reach, frame) = place, met, geometry
    origin, normal = (frame[point, 0], frame[point, 1], frame[point, 2]), (frame[point, 3], frame[point, 4], frame[point, 5])
    write_vector(rows, block, NORMAL, lane, *in_sensor_axes((fx, fy, fz), pose))
    write_vector(rows, block, POINT, lane, *place_behind(origin, normal, inside * reach))
    write_vector(rows, block, BRISTLE, lane, bristle[0], bristle[1], bristle[2])
    rows[block, DEPTH + lane] = inside * abs(segment.dx * fx + segment.dy * fy + segment.dz * fz)


@inlined
def finish_block(block: int, lane: int, rows: np.ndarray) -> None:
    """Write zeros into the lanes that the last block of a pair leaves over."""
    for column in range(0, ROW, LANES):
        for unused in range(lane if lane > 0 else LANES, LANES):
            rows[block, column + unused] = 0.0


FOUND = KEEP
"""Column of what a segment meets, until the step writes its own numbers there: TOUCHED, INSIDE, or zero for nothing."""
TOUCHED, INSIDE = 1.0, -1.0


def blocks_of_points(pairs: Pairs, frame: np.ndarray) -> np.ndarray:
    """Return position and normal of each pair's contact points, (blocks, 6 · LANES), in blocks as contact rows.

    `frame` is :attr:`.Points.frame`.
    """
    blocks = []
    for first, stop in zip(pairs.first_point, pairs.stop_point, strict=True):
        own = np.zeros((-(-(stop - first) // LANES) * LANES, 6))
        own[: stop - first] = frame[first:stop, :6]
        blocks.append(own.reshape(-1, LANES, 6).swapaxes(1, 2).reshape(-1, 6 * LANES))
    return np.concatenate(blocks)


@kernel
def find_shape_contacts(pair: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Find the contacts of a pair whose target is a shape; as :func:`.find_contacts`, when the pair's pose is written."""
    sensor, target, contacts = model.pairs.sensor[pair], model.pairs.target[pair], workspace.contacts
    pose, center, sizes = workspace.pairs.pose[pair], model.sensors.center[sensor], detection.shapes.size
    kind, size = detection.shapes.kind[target], (sizes[target, 0], sizes[target, 1], sizes[target, 2])
    place = (
        pose[0], pose[1], pose[2], pose[3], pose[4], pose[5], pose[6], pose[7], pose[8], pose[9], pose[10], pose[11],
    )  # fmt: skip
    _, middle = segment_at((center[0], center[1], center[2]), (0.0, 0.0, 0.0), 0.0, place)
    if kind == SPHERE:
        x, y, z = in_sensor_axes((pose[9], pose[10], pose[11]), pose)
        place = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, x, y, z
    near = shape_distance(kind, size, middle) <= model.sensors.radius[sensor]
    first, slot = contacts.first_block[pair], model.pairs.first_slot[pair]
    stop = slot + model.pairs.stop_point[pair] - model.pairs.first_point[pair]
    contacts.number[pair], contacts.too_deep[pair], block = 0, 0, first
    if not near:
        for other in range(slot, stop):
            _release(other, state.bristle)
        return
    reach, points, rows = model.sensors.max_penetration[sensor], detection.shapes.points, contacts.rows
    while slot < stop:
        if kind == SPHERE:
            _meet_block(SPHERE, size, block, reach, place, points, rows)
        elif kind == BOX:
            _meet_block(BOX, size, block, reach, place, points, rows)
        elif kind == CAPSULE:
            _meet_block(CAPSULE, size, block, reach, place, points, rows)
        else:
            _meet_block(PLANE, size, block, reach, place, points, rows)
        _keep_block(pair, block, slot, min(stop - slot, LANES), state.bristle, contacts)
        block, slot = block + 1, slot + LANES
    number = contacts.number[pair]
    finish_block(first + number // LANES, number % LANES, rows)


@inlined
def _meet_block(
    kind: int, size: Vector, block: int, reach: float, pose: tuple[float, ...], points: np.ndarray, rows: np.ndarray
) -> None:
    """Write what the points of a block meet into their own rows, but for the bristles.

    `pose` is the pair's; that of a sphere, which looks the same from everywhere, is in the sensor's axes.
    """
    for lane in range(LANES):  # runs in vector registers: no branches, no calls
        origin, outward = read_vector(points, block, 0, lane), read_vector(points, block, 3 * LANES, lane)
        way = outward if kind == SPHERE else in_target_axes(outward, pose)
        tip = origin if kind == SPHERE else in_target_axes(origin, pose)
        tip = tip[0] + pose[9], tip[1] + pose[10], tip[2] + pose[11]
        base = tip[0] - reach * way[0], tip[1] - reach * way[1], tip[2] - reach * way[2]
        entry, axis = shape_entry(kind, size, base, way)
        inside = 1.0 - entry / reach
        deep = reach * inside
        normal = shape_normal(kind, size, axis, place_behind(tip, way, deep))
        rows[block, DEPTH + lane] = deep * abs(way[0] * normal[0] + way[1] * normal[1] + way[2] * normal[2])
        normal = normal if kind == SPHERE else in_sensor_axes(normal, pose)
        write_vector(rows, block, NORMAL, lane, normal[0], normal[1], normal[2])
        write_vector(rows, block, POINT, lane, *place_behind(origin, outward, deep))
        touched = TOUCHED if 0.0 <= entry <= reach else 0.0
        rows[block, FOUND + lane] = INSIDE if is_in_shape(kind, size, base) else touched


@kernel
def _keep_block(pair: int, block: int, slot: int, count: int, bristle: np.ndarray, contacts: ContactWork) -> None:
    """Move the rows of a block's points that touch behind those of the pair that touch already, and add their bristles.

    The points have the slots from `slot` on. Bristles of points that do not touch become zero.
    """
    rows, slots, row, touching, too_deep = contacts.rows, contacts.slots, contacts.number[pair], 0, 0
    first = contacts.first_block[pair]
    for lane in range(LANES):
        touching += 1 if rows[block, FOUND + lane] == TOUCHED else 0
    if touching == LANES and count == LANES and row == (block - first) * LANES:
        for lane in range(LANES):  # all stay where they are
            rows[block, BRISTLE + lane] = bristle[slot + lane, 0]
            rows[block, BRISTLE + LANES + lane] = bristle[slot + lane, 1]
            rows[block, BRISTLE + 2 * LANES + lane] = bristle[slot + lane, 2]
            slots[block, lane] = slot + lane
        contacts.number[pair] = row + LANES
        return
    for lane in range(count):
        found = rows[block, FOUND + lane]
        if found == TOUCHED:
            to, place = first + row // LANES, row % LANES
            for column in range(0, BRISTLE, LANES):
                rows[to, column + place] = rows[block, column + lane]
            rows[to, DEPTH + place] = rows[block, DEPTH + lane]
            held = bristle[slot + lane, 0], bristle[slot + lane, 1], bristle[slot + lane, 2]
            write_vector(rows, to, BRISTLE, place, held[0], held[1], held[2])
            slots[to, place] = slot + lane
            row += 1
        else:
            _release(slot + lane, bristle)
            too_deep += 1 if found == INSIDE else 0
    contacts.number[pair] = row
    contacts.too_deep[pair] += too_deep


@inlined
def _release(slot: int, bristle: np.ndarray) -> None:
    """Let the bristle of a point that does not touch become zero."""
    if bristle[slot, 0] != 0.0 or bristle[slot, 1] != 0.0 or bristle[slot, 2] != 0.0:
        bristle[slot, 0] = bristle[slot, 1] = bristle[slot, 2] = 0.0
