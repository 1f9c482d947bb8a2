# SPDX-License-Identifier: GPL-3.0-or-later
"""The arrays of contact detection: the targets' surfaces or shapes, and what is known to be near each contact point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...compiled.kernels import inlined
from ...compiled.struct_reference import by_reference
from ...geometry.bvh import Tree
from ...geometry.shapes import MESH, Shape

# Layout of the contact rows, which are all that the solver's inner loops read and write.
#
# There is one row for each contact point and target that touch, in the frame of the sensor's body. :data:`LANES` rows make a
# block, in which each column lies in one piece: row r of a pair is ``rows[block, COLUMN + lane]`` with ``block, lane =
# divmod(r, LANES)``, counted from the pair's first block. A loop over the lanes then runs in vector registers, several rows at
# a time. Each pair begins with a block of its own. The lanes that its last block leaves over are zero, which is a contact
# without force.

LANES = 16
"""Rows in a block."""

# Columns. Three columns that follow one another hold a vector; its name is that of the first of them.
NORMAL = 0  # outward normal of the target
POINT = 3 * LANES  # contact point from the reference point of the sensor's body, m
BRISTLE = 6 * LANES  # bristle deflection, m
DEPTH = 9 * LANES  # m
KEEP, GAIN = 10 * LANES, 11 * LANES  # the step of the bristles: z(t + dt) = KEEP z + GAIN v
LIMIT = 12 * LANES  # largest |z|, m
# Written only where they are not the same for all contacts of a pair: the tangent of the normal law (N, N·s/m), the
# multiplier of the friction coefficients, and what is added to ct (N·s/m).
NORMAL_BIAS, NORMAL_SLOPE = 13 * LANES, 14 * LANES
FRICTION_SCALE, EXTRA_VISCOSITY = 15 * LANES, 16 * LANES
# What the readout writes over columns that only a step reads: friction (N), normal force (N), sliding speed (m/s), and the
# size of friction (N), when the whole force stands in the place of friction.
FRICTION, PUSH, SPEED, SIZE = KEEP, NORMAL_BIAS, NORMAL_SLOPE, FRICTION_SCALE
ROW = 17 * LANES
"""Numbers in a block."""


@inlined
def read_vector(rows: np.ndarray, block: int, column: int, lane: int) -> tuple[float, float, float]:
    """Return the vector that begins with a column."""
    return rows[block, column + lane], rows[block, column + LANES + lane], rows[block, column + 2 * LANES + lane]


@inlined
def write_vector(rows: np.ndarray, block: int, column: int, lane: int, x: float, y: float, z: float) -> None:
    """Write the vector that begins with a column."""
    rows[block, column + lane], rows[block, column + LANES + lane], rows[block, column + 2 * LANES + lane] = x, y, z


MOMENTS, PRESENT, OTHER = range(3)
"""Places in :attr:`SurfaceMotion.clock`."""


@by_reference
class SampleTrack(NamedTuple):
    """The windows of T surfaces behind one another, for the kernels.

    A *moment* is the beginning of a step, or the end of the last one.

    Attributes
    ----------
    values : (V, c) float
    stride : (T,) int
        From a row in one sample to the same row in the next; zero where there is only one.
    row : (steps + 1, T) int
        Where the sample before each moment begins.
    share : (steps + 1, T) float
    """

    values: np.ndarray
    stride: np.ndarray
    row: np.ndarray
    share: np.ndarray


@by_reference
class SurfaceMotion(NamedTuple):
    """The surfaces of T targets and m sensors at the steps of one frame.

    Attributes
    ----------
    any_deforms : (1,) bool
        Whether anything deforms at all.
    target_deforms, target_smooth : (T,) bool
        Targets whose vertices move, and those whose contact normals are interpolated between their vertices.
    sensor_deforms : (m,) bool
        Sensors whose contact points move in their body's frame.
    targets : SampleTrack
        Vertices (m, relative to the body's reference point) and vertex normals of targets that deform or are smooth.
    sensors : SampleTrack
        Rows of :attr:`.Points.frame` of sensors that deform.
    corner : (nt, 3) int
        Vertices of each triangle of the tree, counted within its target; without rows when nothing needs them.
    triangle_start : (T + 1,) int
    target_speed, sensor_speed : (T,), (m,) float, m/s
        Bound on how fast any vertex, or any end of a segment, moves.
    target_travel, sensor_travel : (T,), (m,) float, metres
        Bound on how far they have moved in the whole run.
    triangle_moment : (nt,) int
        Number of the moment to which each triangle was brought last.
    clock : (3,) int
        At MOMENTS the number of the present moment in the whole run; at PRESENT its index in the frame, and at OTHER the index
        of the moment that velocities are differences to.
    """

    any_deforms: np.ndarray
    target_deforms: np.ndarray
    target_smooth: np.ndarray
    sensor_deforms: np.ndarray
    targets: SampleTrack
    sensors: SampleTrack
    corner: np.ndarray
    triangle_start: np.ndarray
    target_speed: np.ndarray
    sensor_speed: np.ndarray
    target_travel: np.ndarray
    sensor_travel: np.ndarray
    triangle_moment: np.ndarray
    clock: np.ndarray


@by_reference
class NeighbourLists(NamedTuple):
    """Neighbour list of the contact point of each slot; a cache that changes the speed and never the numbers.

    Attributes
    ----------
    triangles : (s, LIST_LENGTH) int
    length : (s,) int
        Length of each list, ASK_TREE or ONE_SHEET (see :mod:`.neighbour_lists`).
    known_triangle : (s,) int
        The triangle that a texel's line goes through for certain and alone; of a sheet, the triangle met last; else -1.
    valid_distance : (s,) float, metres
        How far any point of the sensor may be from where it was at the pair's `pose` for this to be valid.
    pose : (q, 12) float
        Rotation (row by row) and position of each pair's sensor in the target's frame, from which distances are reckoned.
    shortest_distance : (q,) float, metres
        The least of the pair's `valid_distance`; -1 before the first lists are made.
    steps : (q,) float
        How many steps ago the pose was taken.
    deformation : (q,) float, metres
        How far deformation had moved target or sensor until then.
    tube_radius : (q,) float, metres
        Radius of the widest tube in use.
    """

    triangles: np.ndarray
    length: np.ndarray
    known_triangle: np.ndarray
    valid_distance: np.ndarray
    pose: np.ndarray
    shortest_distance: np.ndarray
    steps: np.ndarray
    deformation: np.ndarray
    tube_radius: np.ndarray


@by_reference
class TargetShapes(NamedTuple):
    """The kinds of surface of T targets.

    Attributes
    ----------
    kind : (T,) int
        MESH, or a kind of :mod:`.geometry.shapes`, whose contacts are computed in closed form.
    size : (T, 3) float, metres
        See :attr:`.Shape.size`.
    closed : (T,) bool
        Which meshes have an inside.
    points : (blocks, 6 · LANES) float
        See :func:`.blocks_of_points`; without rows where all are meshes.
    """

    kind: np.ndarray
    size: np.ndarray
    closed: np.ndarray
    points: np.ndarray

    @classmethod
    def of(
        cls, shapes: Sequence[Shape | None], closed: Sequence[bool] | np.ndarray, points: np.ndarray | None = None
    ) -> TargetShapes:
        """Return the shapes of targets; None stands for a mesh."""
        kind = np.array([MESH if shape is None else shape.kind for shape in shapes], np.int64)
        size = np.array([(0.0, 0.0, 0.0) if shape is None else shape.size for shape in shapes]).reshape(-1, 3)
        return cls(kind, size, np.array(closed, np.bool_), np.zeros((0, 0)) if points is None else points)


@by_reference
class DetectionData(NamedTuple):
    """The arrays of contact detection.

    Attributes
    ----------
    tree : Tree
        Of the targets' triangles.
    neighbours : NeighbourLists
    surfaces : SurfaceMotion
        How targets and sensors deform in the present frame.
    shapes : TargetShapes
    """

    tree: Tree
    neighbours: NeighbourLists
    surfaces: SurfaceMotion
    shapes: TargetShapes
