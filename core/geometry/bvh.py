# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounding-volume tree over triangles, which answers one query: where does a texel's segment enter an object?

The tree is a list in depth-first order: child follows parent, and `skip` says where to go on when a box is missed, so that a
query needs no stack and allocates nothing. Boxes are tested against the box of the remaining segment, which is
conservative whatever the rounding; triangles are tested with edge functions that two neighbours evaluate to the same number
with opposite sign, so that a segment through a shared edge or vertex always meets one of them (watertight, as in Woop, Benthin
and Wald, JCGT 2013).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..compiled.kernels import allocating_kernel, kernel
from ..compiled.struct_reference import by_reference
from .mesh import TriangleMesh, face_normals, unique_edges

LEAF_SIZE = 4
"""Triangles per leaf; two to eight measured alike."""


@by_reference
class Tree(NamedTuple):
    """One or several meshes' trees behind one another, ready for the kernels.

    Attributes
    ----------
    bounds : (nn, 6) float, metres
        Low and high corner of each node's box.
    skip : (nn,) int
        Node to visit when a box is missed.
    first, number : (nn,) int
        Triangles of a leaf; `number` is zero in inner nodes.
    faces : (nt, 12) float
        Triangles in leaf order: three corners (m) and the outward unit normal.
    source : (nt,) int
        Each triangle's index in the mesh it came from.
    roots : (m + 1,) int
        Node at which each mesh's tree starts; the last entry is the number of nodes.
    adjacent : (nt, 3) int
        Triangle on the other side of the edges from first to second, second to third and third to first corner, in leaf order;
        -1 unless that edge joins exactly two triangles of one orientation.
    normal_bounds : (nn, 6) float
        Low and high end of the normals of each node's triangles, by axis; ``±2`` where one of them has no neighbour. They are
        those of the meshes as they were given.
    """

    bounds: np.ndarray
    skip: np.ndarray
    first: np.ndarray
    number: np.ndarray
    faces: np.ndarray
    source: np.ndarray
    roots: np.ndarray
    adjacent: np.ndarray
    normal_bounds: np.ndarray


def build_tree(meshes: list[TriangleMesh]) -> Tree:
    """Build one tree per mesh.

    Parameters
    ----------
    meshes : list of TriangleMesh
        Without degenerate triangles (see :func:`.mesh.checked_mesh`).
    """
    parts, node_offset, triangle_offset, roots = [], 0, 0, [0]
    for mesh in meshes:
        corners = np.ascontiguousarray(mesh.vertices[mesh.triangles])
        n = len(corners)
        order = np.arange(n)
        size = 2 * n + 1
        bounds, skip = np.empty((size, 6)), np.empty(size, np.int64)
        first, number = np.zeros(size, np.int64), np.zeros(size, np.int64)
        nodes = _build(corners, corners.mean(axis=1), order, LEAF_SIZE, bounds, skip, first, number)
        leaf, normals = number[:nodes] > 0, np.ascontiguousarray(face_normals(mesh)[order])
        adjacent, normal_bounds = _adjacent_triangles(mesh.triangles[order]), np.empty((nodes, 6), np.float32)
        _fit_normal_bounds(normals, adjacent, skip, first, number, normal_bounds)
        parts.append(
            (
                bounds[:nodes],
                skip[:nodes] + node_offset,
                np.where(leaf, first[:nodes] + triangle_offset, 0),
                number[:nodes],
                np.hstack([corners[order].reshape(-1, 9), normals]),
                order,
                np.where(adjacent < 0, -1, adjacent + triangle_offset).astype(np.int32),
                normal_bounds,
            )
        )
        node_offset += nodes
        triangle_offset += n
        roots.append(node_offset)
    bounds, skip, first, number, faces, source, adjacent, normal_bounds = (
        np.ascontiguousarray(np.concatenate(part)) for part in zip(*parts, strict=True)
    )
    return Tree(bounds, skip, first, number, faces, source, np.array(roots), adjacent, normal_bounds)


def _adjacent_triangles(triangles: np.ndarray) -> np.ndarray:
    """(n, 3) int: the triangle across each edge, -1 unless the edge joins exactly two of one orientation."""
    _, which, count = unique_edges(triangles)
    edge, start, end = which.ravel(), triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    side = np.arange(len(edge))
    # Where an edge has two sides, the sum of their numbers without the one is the other.
    across = np.where(count[edge] == 2, np.bincount(edge, side)[edge].astype(np.int64) - side, -1)
    turned = start == end[across]  # each goes along the edge its own way
    return np.where((across >= 0) & turned, across // 3, -1).reshape(-1, 3)


@kernel
def is_interior(i: int, normals: np.ndarray, first: int, adjacent: np.ndarray) -> bool:
    """Whether a triangle has a normal, whose column is `first`, and a neighbour on each side."""
    square = normals[i, first] ** 2 + normals[i, first + 1] ** 2 + normals[i, first + 2] ** 2
    return square > 0.5 and adjacent[i, 0] >= 0 and adjacent[i, 1] >= 0 and adjacent[i, 2] >= 0


@kernel
def _fit_normal_bounds(
    normals: np.ndarray,
    adjacent: np.ndarray,
    skip: np.ndarray,
    first: np.ndarray,
    number: np.ndarray,
    normal_bounds: np.ndarray,
) -> None:
    """Fill in :attr:`Tree.normal_bounds`; rounded away from what is inside, since it is kept in single precision."""
    for node in range(len(normal_bounds) - 1, -1, -1):
        for axis in range(3):
            low, high = 2.0, -2.0
            if number[node] > 0:
                for i in range(first[node], first[node] + number[node]):
                    whole = is_interior(i, normals, 0, adjacent)
                    low = min(low, normals[i, axis] - 1e-6 if whole else -2.0)
                    high = max(high, normals[i, axis] + 1e-6 if whole else 2.0)
            else:  # its children come behind it
                left, right = node + 1, skip[node + 1]
                low = min(normal_bounds[left, axis], normal_bounds[right, axis])
                high = max(normal_bounds[left, 3 + axis], normal_bounds[right, 3 + axis])
            normal_bounds[node, axis], normal_bounds[node, 3 + axis] = low, high


@kernel
def _select(order: np.ndarray, centroid: np.ndarray, axis: int, lo: int, hi: int, middle: int) -> None:
    """Hoare's selection: afterwards order[lo:middle] lie below order[middle:hi] along `axis`."""
    hi -= 1
    while lo < hi:
        pivot = centroid[order[(lo + hi) // 2], axis]
        i, j = lo, hi
        while i <= j:
            while centroid[order[i], axis] < pivot:
                i += 1
            while centroid[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if middle <= j:
            hi = j
        elif middle >= i:
            lo = i
        else:
            return


@allocating_kernel
def _build(
    corners: np.ndarray,
    centroid: np.ndarray,
    order: np.ndarray,
    leaf_size: int,
    bounds: np.ndarray,
    skip: np.ndarray,
    first: np.ndarray,
    number: np.ndarray,
) -> int:
    """Split at the median of the longest axis until leaves are small; returns the number of nodes."""
    stack = np.empty((128, 3), np.int64)  # range of triangles, and the node whose skip the range's end decides
    stack[0, 0], stack[0, 1] = 0, len(order)
    depth, node = 1, 0
    while depth > 0:
        depth -= 1
        lo, hi = stack[depth, 0], stack[depth, 1]
        for axis in range(3):
            bounds[node, axis] = np.inf
            bounds[node, 3 + axis] = -np.inf
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for i in range(lo, hi):
            for axis in range(3):
                c = centroid[order[i], axis]
                low[axis] = min(low[axis], c)
                high[axis] = max(high[axis], c)
                for corner in range(3):
                    x = corners[order[i], corner, axis]
                    bounds[node, axis] = min(bounds[node, axis], x)
                    bounds[node, 3 + axis] = max(bounds[node, 3 + axis], x)
        skip[node] = node + _node_count(hi - lo, leaf_size)
        if hi - lo <= leaf_size:
            first[node], number[node] = lo, hi - lo
        else:
            axis = 0
            for other in range(1, 3):
                if high[other] - low[other] > high[axis] - low[axis]:
                    axis = other
            middle = (lo + hi) // 2
            _select(order, centroid, axis, lo, hi, middle)
            stack[depth, 0], stack[depth, 1] = middle, hi
            stack[depth + 1, 0], stack[depth + 1, 1] = lo, middle
            depth += 2
        node += 1
    return node


@kernel
def _node_count(n: int, leaf_size: int) -> int:
    """Nodes of a subtree over `n` triangles. Halving gives at most two sizes per level, so two counters walk down."""
    total = 0
    small, small_many, large_many = n, 1, 0  # ranges of length `small` and of length `small + 1` on this level
    while small_many + large_many > 0:
        total += small_many + large_many
        split_small = small_many if small > leaf_size else 0
        split_large = large_many if small + 1 > leaf_size else 0
        half = small // 2
        if small % 2 == 0:  # small → half, half; large → half, half + 1
            small_many, large_many = 2 * split_small + split_large, split_large
        else:  # small → half, half + 1; large → half + 1, half + 1
            small_many, large_many = split_small, split_small + 2 * split_large
        small = half
    return total


class Segment(NamedTuple):
    """A segment from its base O to O + D.

    Attributes
    ----------
    ox, oy, oz : float, metres
        Its base.
    dx, dy, dz : float, metres
        The vector to its tip.
    """

    ox: float
    oy: float
    oz: float
    dx: float
    dy: float
    dz: float


class Shear(NamedTuple):
    """The shear that lays a segment onto the axis along which it is longest.

    Attributes
    ----------
    axis : int
    x, y : float
        Factors for the other two axes, in cyclic order.
    """

    axis: int
    x: float
    y: float


class Box(NamedTuple):
    """An axis-aligned box, from (x0, y0, z0) to (x1, y1, z1), metres."""

    x0: float
    x1: float
    y0: float
    y1: float
    z0: float
    z1: float


@kernel
def shear_to_axis(segment: Segment) -> Shear:
    """Return the :class:`Shear` of a segment."""
    dx, dy, dz = segment.dx, segment.dy, segment.dz
    if abs(dx) >= abs(dy) and abs(dx) >= abs(dz):
        return Shear(0, dy / dx, dz / dx)
    if abs(dy) >= abs(dz):
        return Shear(1, dz / dy, dx / dy)
    return Shear(2, dx / dz, dy / dz)


@kernel
def project_sheared(x: float, y: float, z: float, shear: Shear) -> tuple[float, float]:
    """Project a point along the segment of a shear; two coordinates."""
    if shear.axis == 0:
        return y - shear.x * x, z - shear.y * x
    if shear.axis == 1:
        return z - shear.x * y, x - shear.y * y
    return x - shear.x * z, y - shear.y * z


@kernel
def is_outside(bounds: np.ndarray, node: int, box: Box) -> bool:
    """Whether a node's box and another box have no point in common."""
    return (
        bounds[node, 0] > box.x1 or bounds[node, 3] < box.x0
        or bounds[node, 1] > box.y1 or bounds[node, 4] < box.y0
        or bounds[node, 2] > box.z1 or bounds[node, 5] < box.z0
    )  # fmt: skip


@kernel
def box_of(segment: Segment, part: float) -> Box:
    """Box around the first part of a segment, `part` being its share."""
    ox, oy, oz, dx, dy, dz = segment
    return Box(
        min(ox, ox + part * dx), max(ox, ox + part * dx),
        min(oy, oy + part * dy), max(oy, oy + part * dy),
        min(oz, oz + part * dz), max(oz, oz + part * dz),
    )  # fmt: skip


NOT_MET = 2.0
"""Position that stands for no intersection: beyond the segment's tip at 1."""
MISSES = 9.0
"""Result of :func:`intersect_triangle` for a triangle that the segment does not cross."""
LEAVING_OFFSET = -3.0
"""A crossing that leaves a surface at the position t is returned as ``LEAVING_OFFSET - t``, which is negative."""


@kernel
def segment_entry(segment: Segment, mesh: int, hint: int, tree: Tree) -> tuple[float, int, float]:
    """Find where a segment first enters a surface from outside.

    Parameters
    ----------
    segment : Segment
        Not of length zero, in the mesh's frame.
    mesh : int
        Which of the tree's meshes.
    hint : int
        Triangle to try first, -1 for none; it changes the speed and never the answer.
    tree : Tree

    Returns
    -------
    t : float
        Position on the segment, 0 at the base and 1 at the tip; :data:`NOT_MET` when there is none.
    triangle : int
        In leaf order, -1 when there is none.
    leaving : float
        Position of the nearest intersection that leaves a surface, as far as it lies before `t`: then the base is inside the
        object. Beyond `t` it may be any such intersection; :data:`NOT_MET` when none was met.
    """
    t, triangle, leaving = NOT_MET, -1, NOT_MET
    shear = shear_to_axis(segment)
    if hint >= 0:
        u = intersect_triangle(segment, shear, tree.faces, hint)
        if 0.0 <= u <= 1.0:
            t, triangle = u, hint
    box = box_of(segment, min(t, 1.0))
    bounds, node, stop = tree.bounds, tree.roots[mesh], tree.roots[mesh + 1]
    while node < stop:
        if is_outside(bounds, node, box):
            node = tree.skip[node]
            continue
        for i in range(tree.first[node], tree.first[node] + tree.number[node]):
            u = intersect_triangle(segment, shear, tree.faces, i)
            if 0.0 <= u <= 1.0:
                # Of two triangles met at the very same point (a shared edge) the first in the list answers, hint or not.
                if u < t or (u == t and i < triangle):
                    t, triangle = u, i
                    box = box_of(segment, u)
            elif u < 0.0:
                leaving = min(leaving, LEAVING_OFFSET - u)
        node += 1
    return t, triangle, leaving


@kernel
def intersect_triangle(segment: Segment, shear: Shear, faces: np.ndarray, i: int) -> float:
    """Return the position on the segment where it crosses a triangle.

    A position t from 0 to 1 is a crossing that enters the surface. A crossing that leaves it is ``LEAVING_OFFSET - t``, and no
    crossing is :data:`MISSES`.

    The corners are projected along the segment into a plane, each computed from the corner alone, and the origin must lie on
    one side of all three edges. Rounding may turn the sign of an edge into zero, which counts as inside on both sides, but
    never into its opposite: nothing leaks between neighbours.
    """
    ox, oy, oz, dx, dy, dz = segment
    ax, ay, az = faces[i, 0] - ox, faces[i, 1] - oy, faces[i, 2] - oz
    bx, by, bz = faces[i, 3] - ox, faces[i, 4] - oy, faces[i, 5] - oz
    cx, cy, cz = faces[i, 6] - ox, faces[i, 7] - oy, faces[i, 8] - oz
    height = faces[i, 9] * ax + faces[i, 10] * ay + faces[i, 11] * az
    ax, ay = project_sheared(ax, ay, az, shear)
    bx, by = project_sheared(bx, by, bz, shear)
    cx, cy = project_sheared(cx, cy, cz, shear)
    u, v, w = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
    low, high = min(u, v, w), max(u, v, w)
    if (low < 0.0 and high > 0.0) or (low == 0.0 and high == 0.0):
        return MISSES
    slope = faces[i, 9] * dx + faces[i, 10] * dy + faces[i, 11] * dz
    if slope == 0.0:
        return MISSES
    t = height / slope
    if not 0.0 <= t <= 1.0:
        return MISSES
    return t if slope < 0.0 else LEAVING_OFFSET - t


@kernel
def intersect_plane(segment: Segment, faces: np.ndarray, i: int) -> float:
    """Position on the segment where it crosses a triangle's plane, the same bits as :func:`intersect_triangle` has for it."""
    ox, oy, oz, dx, dy, dz = segment
    ax, ay, az = faces[i, 0] - ox, faces[i, 1] - oy, faces[i, 2] - oz
    height = faces[i, 9] * ax + faces[i, 10] * ay + faces[i, 11] * az
    return height / (faces[i, 9] * dx + faces[i, 10] * dy + faces[i, 11] * dz)
