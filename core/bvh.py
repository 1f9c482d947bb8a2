# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounding-volume tree over triangles, and the one question it answers: where does a texel's segment enter an object?

The tree is a list in depth-first order: child follows parent, and `skip` says where to go on when a box is missed, so that a
query needs no stack and allocates nothing. Boxes are tested against the box of what is left of the segment, which is
conservative whatever the rounding; triangles are tested with edge functions that two neighbours evaluate to the same number
with opposite sign, so that a segment through a shared edge or vertex always meets one of them (watertight, as in Woop, Benthin
and Wald, JCGT 2013).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .jit import kernel
from .mesh import TriangleMesh, face_normals

LEAF_SIZE = 4
"""Triangles per leaf; two to eight measured alike."""


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
    corners : (nt, 3, 3) float, metres
        Triangles in leaf order.
    normals : (nt, 3) float
        Outward unit normals in leaf order.
    source : (nt,) int
        Each triangle's index in the mesh it came from.
    roots : (m + 1,) int
        Node at which each mesh's tree starts; the last entry is the number of nodes.
    """

    bounds: np.ndarray
    skip: np.ndarray
    first: np.ndarray
    number: np.ndarray
    corners: np.ndarray
    normals: np.ndarray
    source: np.ndarray
    roots: np.ndarray


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
        leaf = number[:nodes] > 0
        parts.append(
            (
                bounds[:nodes],
                skip[:nodes] + node_offset,
                np.where(leaf, first[:nodes] + triangle_offset, 0),
                number[:nodes],
                corners[order],
                face_normals(mesh)[order],
                order,
            )
        )
        node_offset += nodes
        triangle_offset += n
        roots.append(node_offset)
    arrays = [np.ascontiguousarray(np.concatenate(part)) for part in zip(*parts, strict=True)]
    return Tree._make([*arrays, np.array(roots)])


@kernel
def _select(order, centroid, axis, lo, hi, middle):
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


@kernel
def _build(corners, centroid, order, leaf_size, bounds, skip, first, number):
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
def _node_count(n, leaf_size):
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


@kernel
def segment_entry(ox, oy, oz, dx, dy, dz, mesh, hint, tree):
    """Find where the segment from O to O + D first enters a surface from outside.

    Parameters
    ----------
    ox … dz : float
        Base of the segment and the vector to its tip, in the mesh's frame.
    mesh : int
        Which of the tree's meshes.
    hint : int
        Triangle to try first, -1 for none; it changes the speed and never the answer.

    Returns
    -------
    t : float
        Position on the segment, 0 at the base and 1 at the tip; 2 when there is none.
    triangle : int
        In leaf order, -1 when there is none.
    exit : float
        Position of the nearest intersection that leaves a surface, as far as it lies before `t`; 2 when there is none. Smaller
        than `t` means that the base is inside the object.
    """
    t, triangle, leaving = 2.0, -1, 2.0
    corners, normals = tree.corners, tree.normals
    # The axis along which the segment is longest, and the shear that lays it onto that axis.
    d = (dx, dy, dz)
    z = 0 if abs(dx) >= abs(dy) and abs(dx) >= abs(dz) else (1 if abs(dy) >= abs(dz) else 2)
    x, y = (z + 1) % 3, (z + 2) % 3
    if d[z] == 0.0:
        return t, triangle, leaving
    shear_x, shear_y = d[x] / d[z], d[y] / d[z]
    if hint >= 0:
        u = _cross_triangle(ox, oy, oz, dx, dy, dz, x, y, z, shear_x, shear_y, corners[hint], normals[hint])
        if 0.0 <= u <= 1.0:
            t, triangle = u, hint
    reach = min(t, 1.0)
    x0, x1 = min(ox, ox + reach * dx), max(ox, ox + reach * dx)
    y0, y1 = min(oy, oy + reach * dy), max(oy, oy + reach * dy)
    z0, z1 = min(oz, oz + reach * dz), max(oz, oz + reach * dz)
    node, stop = tree.roots[mesh], tree.roots[mesh + 1]
    while node < stop:
        box = tree.bounds[node]
        if box[0] > x1 or box[3] < x0 or box[1] > y1 or box[4] < y0 or box[2] > z1 or box[5] < z0:
            node = tree.skip[node]
            continue
        for i in range(tree.first[node], tree.first[node] + tree.number[node]):
            u = _cross_triangle(ox, oy, oz, dx, dy, dz, x, y, z, shear_x, shear_y, corners[i], normals[i])
            if 0.0 <= u <= 1.0:
                # Of two triangles met at the very same point (a shared edge) the first in the list answers, hint or not.
                if u < t or (u == t and i < triangle):
                    t, triangle = u, i
                    x0, x1 = min(ox, ox + u * dx), max(ox, ox + u * dx)
                    y0, y1 = min(oy, oy + u * dy), max(oy, oy + u * dy)
                    z0, z1 = min(oz, oz + u * dz), max(oz, oz + u * dz)
            elif -4.0 <= u <= -3.0:
                leaving = min(leaving, -3.0 - u)
        node += 1
    return t, triangle, leaving


@kernel
def _cross_triangle(ox, oy, oz, dx, dy, dz, x, y, z, shear_x, shear_y, corner, normal):
    """Position on the segment where it crosses a triangle: t in 0…1 entering, -3 - t leaving, 9 when it misses.

    The corners are seen along the segment as points of a plane, each computed from the corner alone, and the origin must lie on
    one side of all three edges. Rounding may turn the sign of an edge into zero, which counts as inside on both sides, but never
    into its opposite: nothing leaks between neighbours.
    """
    o = (ox, oy, oz)
    az, bz, cz = corner[0, z] - o[z], corner[1, z] - o[z], corner[2, z] - o[z]
    ax, ay = corner[0, x] - o[x] - shear_x * az, corner[0, y] - o[y] - shear_y * az
    bx, by = corner[1, x] - o[x] - shear_x * bz, corner[1, y] - o[y] - shear_y * bz
    u = ax * by - ay * bx
    cx, cy = corner[2, x] - o[x] - shear_x * cz, corner[2, y] - o[y] - shear_y * cz
    v = bx * cy - by * cx
    if (u < 0.0 and v > 0.0) or (u > 0.0 and v < 0.0):
        return 9.0
    w = cx * ay - cy * ax
    if (u < 0.0 or v < 0.0) and w > 0.0 or (u > 0.0 or v > 0.0) and w < 0.0 or (u == 0.0 and v == 0.0 and w == 0.0):
        return 9.0
    slope = normal[0] * dx + normal[1] * dy + normal[2] * dz
    if slope == 0.0:
        return 9.0
    height = normal[0] * (corner[0, 0] - ox) + normal[1] * (corner[0, 1] - oy) + normal[2] * (corner[0, 2] - oz)
    t = height / slope
    if not 0.0 <= t <= 1.0:
        return 9.0
    return t if slope < 0.0 else -3.0 - t
