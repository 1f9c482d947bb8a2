# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments of contact points in the frame of a target, and the rows of the contacts that they make (kernels)."""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.bvh import Segment
from ...geometry.shapes import Vector
from ..solver_model import SolverModel, State
from ..workspace import Workspace
from .detection_data import BRISTLE, DEPTH, LANES, NORMAL, POINT, ROW, write_vector


@kernel
def write_relative_pose(pair: int, model: SolverModel, state: State, workspace: Workspace) -> None:
    """Write the sensor's rotation (row by row) and position in the target's frame into the pair's pose."""
    a, b = model.pairs.sensor_body[pair], model.pairs.target_body[pair]
    position, rotation, pose = state.position, workspace.bodies.rotation, workspace.pairs.pose[pair]
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
