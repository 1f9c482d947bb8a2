# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments of contact points in the frame of a target, and the rows of the contacts that they make (kernels)."""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.bvh import Segment
from ..contact_rows import BRISTLE, DEPTH, LANES, NORMAL, POINT, ROW, write_vector
from ..solver_model import SolverModel, State
from ..workspace import Workspace


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
def segment_of(point: int, reach: float, pose: np.ndarray, frame: np.ndarray) -> tuple[Segment, tuple[float, float, float]]:
    """Segment of a contact point in the target's frame, from `reach` (m) deep in the sensor to the point, and its tip."""
    tx = pose[9] + pose[0] * frame[point, 0] + pose[1] * frame[point, 1] + pose[2] * frame[point, 2]
    ty = pose[10] + pose[3] * frame[point, 0] + pose[4] * frame[point, 1] + pose[5] * frame[point, 2]
    tz = pose[11] + pose[6] * frame[point, 0] + pose[7] * frame[point, 1] + pose[8] * frame[point, 2]
    dx = reach * (pose[0] * frame[point, 3] + pose[1] * frame[point, 4] + pose[2] * frame[point, 5])
    dy = reach * (pose[3] * frame[point, 3] + pose[4] * frame[point, 4] + pose[5] * frame[point, 5])
    dz = reach * (pose[6] * frame[point, 3] + pose[7] * frame[point, 4] + pose[8] * frame[point, 5])
    return Segment(tx - dx, ty - dy, tz - dz, dx, dy, dz), (tx, ty, tz)


@inlined
def clear_slot(slot: int, triangle: int, state: State) -> None:
    """Write that the point of a slot does not act: `triangle` is NO_TRIANGLE or TOO_DEEP."""
    state.triangle[slot] = triangle
    for i in range(3):
        state.bristle[slot, i] = 0.0
    state.pressed_share[slot] = 0.0


@inlined
def _in_sensor_axes(x: float, y: float, z: float, pose: np.ndarray) -> tuple[float, float, float]:
    """Return a vector of the target in the sensor's axes; `pose` is the sensor's in the target's frame."""
    return (
        pose[0] * x + pose[3] * y + pose[6] * z,
        pose[1] * x + pose[4] * y + pose[7] * z,
        pose[2] * x + pose[5] * y + pose[8] * z,
    )


@inlined
def _place_behind(point: int, distance: float, frame: np.ndarray) -> tuple[float, float, float]:
    """Return the place at a distance (m) behind a contact point, back along its normal."""
    return (
        frame[point, 0] - distance * frame[point, 3],
        frame[point, 1] - distance * frame[point, 4],
        frame[point, 2] - distance * frame[point, 5],
    )


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
    write_vector(rows, block, NORMAL, lane, *_in_sensor_axes(fx, fy, fz, pose))
    write_vector(rows, block, POINT, lane, *_place_behind(point, inside * reach, frame))
    write_vector(rows, block, BRISTLE, lane, bristle[0], bristle[1], bristle[2])
    rows[block, DEPTH + lane] = inside * abs(segment.dx * fx + segment.dy * fy + segment.dz * fz)


@inlined
def finish_block(block: int, lane: int, rows: np.ndarray) -> None:
    """Write zeros into the lanes that the last block of a pair leaves over."""
    for unused in range(lane if lane > 0 else LANES, LANES):
        for column in range(0, ROW, LANES):
            rows[block, column + unused] = 0.0
