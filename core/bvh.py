# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounding-volume tree over triangles, and the one question it answers: where does a texel's segment enter an object?

The tree is a list in depth-first order: child follows parent, and `skip` says where to go on when a box is missed, so that a
query needs no stack and allocates nothing. Boxes are tested against the box of what is left of the segment, which is
conservative whatever the rounding; triangles are tested with edge functions that two neighbours evaluate to the same number
with opposite sign, so that a segment through a shared edge or vertex always meets one of them (watertight, as in Woop, Benthin
and Wald, JCGT 2013).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .jit import allocating, kernel
from .mesh import TriangleMesh, face_normals
from .reference import by_reference

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
    """

    bounds: np.ndarray
    skip: np.ndarray
    first: np.ndarray
    number: np.ndarray
    faces: np.ndarray
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
                np.hstack([corners[order].reshape(-1, 9), face_normals(mesh)[order]]),
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


@allocating
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


NEAR = 12
"""Most triangles that are remembered as near a segment; where there are more, the tree is asked every time."""


@kernel
def _line_of_sight(dx, dy, dz):
    """Axis along which a vector is longest, and the shear of the other two (in cyclic order) that lays it onto that axis."""
    if abs(dx) >= abs(dy) and abs(dx) >= abs(dz):
        return 0, dy / dx, dz / dx
    if abs(dy) >= abs(dz):
        return 1, dz / dy, dx / dy
    return 2, dx / dz, dy / dz


@kernel
def _seen_along(x, y, z, axis, shear_x, shear_y):
    """Project a point along the line of sight."""
    if axis == 0:
        return y - shear_x * x, z - shear_y * x
    if axis == 1:
        return z - shear_x * y, x - shear_y * y
    return x - shear_x * z, y - shear_y * z


@kernel
def _apart(bounds, node, x0, x1, y0, y1, z0, z1):
    """Whether a node's box and the box from (x0, y0, z0) to (x1, y1, z1) have no point in common."""
    return (
        bounds[node, 0] > x1 or bounds[node, 3] < x0
        or bounds[node, 1] > y1 or bounds[node, 4] < y0
        or bounds[node, 2] > z1 or bounds[node, 5] < z0
    )  # fmt: skip


@kernel
def segment_entry(ox, oy, oz, dx, dy, dz, mesh, hint, tree):
    """Find where the segment from O to O + D first enters a surface from outside.

    Parameters
    ----------
    ox … dz : float
        Base of the segment and the vector to its tip (not zero), in the mesh's frame.
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
        Position of the nearest intersection that leaves a surface, as far as it lies before `t`: then the base is inside the
        object. Beyond `t` it may be any such intersection; 2 when none was met.
    """
    t, triangle, leaving = 2.0, -1, 2.0
    axis, shear_x, shear_y = _line_of_sight(dx, dy, dz)
    if hint >= 0:
        u = cross_triangle(ox, oy, oz, dx, dy, dz, axis, shear_x, shear_y, tree.faces, hint)
        if 0.0 <= u <= 1.0:
            t, triangle = u, hint
    reach = min(t, 1.0)
    x0, x1 = min(ox, ox + reach * dx), max(ox, ox + reach * dx)
    y0, y1 = min(oy, oy + reach * dy), max(oy, oy + reach * dy)
    z0, z1 = min(oz, oz + reach * dz), max(oz, oz + reach * dz)
    bounds, node, stop = tree.bounds, tree.roots[mesh], tree.roots[mesh + 1]
    while node < stop:
        if _apart(bounds, node, x0, x1, y0, y1, z0, z1):
            node = tree.skip[node]
            continue
        for i in range(tree.first[node], tree.first[node] + tree.number[node]):
            u = cross_triangle(ox, oy, oz, dx, dy, dz, axis, shear_x, shear_y, tree.faces, i)
            if 0.0 <= u <= 1.0:
                # Of two triangles met at the very same point (a shared edge) the first in the list answers, hint or not.
                if u < t or (u == t and i < triangle):
                    t, triangle = u, i
                    x0, x1 = min(ox, ox + u * dx), max(ox, ox + u * dx)
                    y0, y1 = min(oy, oy + u * dy), max(oy, oy + u * dy)
                    z0, z1 = min(oz, oz + u * dz), max(oz, oz + u * dz)
            elif u < 0.0:
                leaving = min(leaving, -3.0 - u)
        node += 1
    return t, triangle, leaving


@kernel
def near_entry(ox, oy, oz, dx, dy, dz, near, slot, number, faces):
    """Answer like :func:`segment_entry`, from a list of all triangles that the segment can meet (see :func:`find_near`)."""
    t, triangle, leaving = 2.0, -1, 2.0
    axis, shear_x, shear_y = _line_of_sight(dx, dy, dz)
    for j in range(number):
        i = near[slot, j]
        u = cross_triangle(ox, oy, oz, dx, dy, dz, axis, shear_x, shear_y, faces, i)
        if 0.0 <= u <= 1.0:
            if u < t:
                t, triangle = u, i
        elif u < 0.0:
            leaving = min(leaving, -3.0 - u)
    return t, triangle, leaving


@kernel
def find_near(ox, oy, oz, dx, dy, dz, mesh, skin, near, slot, tree):
    """Write the triangles that a segment can meet as long as none of its points has moved by more than `skin`.

    Neighbour lists as in molecular dynamics (Verlet 1967): collected with a skin, used until the motion has used the skin up.

    Parameters
    ----------
    skin : float, metres
    near : (s, NEAR) int
        Written at `slot`, in the order of the tree.

    Returns
    -------
    number : int
        How many there are; -1 when there is no room for them.
    only : int
        The triangle, where there is but one and the segment's line goes through it for certain, from outside; else -1.
    """
    axis, shear_x, shear_y = _line_of_sight(dx, dy, dz)
    # The last term is the rounding of what follows, which must not leave out a triangle that is only just met.
    aside = skin * math.sqrt(1.0 + shear_x * shear_x + shear_y * shear_y) + 1e-14 * (abs(ox) + abs(oy) + abs(oz))
    x0, x1 = min(ox, ox + dx) - skin, max(ox, ox + dx) + skin
    y0, y1 = min(oy, oy + dy) - skin, max(oy, oy + dy) + skin
    z0, z1 = min(oz, oz + dz) - skin, max(oz, oz + dz) + skin
    number, only = 0, -1
    bounds, node, stop = tree.bounds, tree.roots[mesh], tree.roots[mesh + 1]
    while node < stop:
        if _apart(bounds, node, x0, x1, y0, y1, z0, z1):
            node = tree.skip[node]
            continue
        for i in range(tree.first[node], tree.first[node] + tree.number[node]):
            # Seen along the segment, the triangle must come within the skin of the origin.
            f = tree.faces
            ax, ay = _seen_along(f[i, 0] - ox, f[i, 1] - oy, f[i, 2] - oz, axis, shear_x, shear_y)
            bx, by = _seen_along(f[i, 3] - ox, f[i, 4] - oy, f[i, 5] - oz, axis, shear_x, shear_y)
            cx, cy = _seen_along(f[i, 6] - ox, f[i, 7] - oy, f[i, 8] - oz, axis, shear_x, shear_y)
            beside = min(ax, bx, cx) > aside or max(ax, bx, cx) < -aside or min(ay, by, cy) > aside or max(ay, by, cy) < -aside
            u, v, w = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
            side = 1.0 if u + v + w > 0.0 else -1.0
            if beside:
                continue
            # How far inside of each edge the origin is seen, times the edge's length.
            margin_u = aside * math.hypot(bx - ax, by - ay)
            margin_v = aside * math.hypot(cx - bx, cy - by)
            margin_w = aside * math.hypot(ax - cx, ay - cy)
            u, v, w = side * u, side * v, side * w
            if u < -margin_u or v < -margin_v or w < -margin_w:
                continue
            if number == near.shape[1]:
                return -1, -1
            slope = f[i, 9] * dx + f[i, 10] * dy + f[i, 11] * dz
            through = u > margin_u and v > margin_v and w > margin_w and slope < -2.0 * skin
            only = i if number == 0 and through else -1
            near[slot, number] = i
            number += 1
        node += 1
    return number, only


@kernel
def cross_triangle(ox, oy, oz, dx, dy, dz, axis, shear_x, shear_y, faces, i):
    """Position on the segment where it crosses a triangle: t in 0…1 entering, -3 - t leaving, 9 when it misses.

    The corners are seen along the segment as points of a plane, each computed from the corner alone, and the origin must lie on
    one side of all three edges. Rounding may turn the sign of an edge into zero, which counts as inside on both sides, but
    never into its opposite: nothing leaks between neighbours.
    """
    ax, ay, az = faces[i, 0] - ox, faces[i, 1] - oy, faces[i, 2] - oz
    bx, by, bz = faces[i, 3] - ox, faces[i, 4] - oy, faces[i, 5] - oz
    cx, cy, cz = faces[i, 6] - ox, faces[i, 7] - oy, faces[i, 8] - oz
    height = faces[i, 9] * ax + faces[i, 10] * ay + faces[i, 11] * az
    ax, ay = _seen_along(ax, ay, az, axis, shear_x, shear_y)
    bx, by = _seen_along(bx, by, bz, axis, shear_x, shear_y)
    cx, cy = _seen_along(cx, cy, cz, axis, shear_x, shear_y)
    u, v, w = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
    low, high = min(u, v, w), max(u, v, w)
    if (low < 0.0 and high > 0.0) or (low == 0.0 and high == 0.0):
        return 9.0
    slope = faces[i, 9] * dx + faces[i, 10] * dy + faces[i, 11] * dz
    if slope == 0.0:
        return 9.0
    t = height / slope
    if not 0.0 <= t <= 1.0:
        return 9.0
    return t if slope < 0.0 else -3.0 - t


@kernel
def cross_plane(ox, oy, oz, dx, dy, dz, faces, i):
    """Position on the segment where it crosses a triangle's plane, the same bits as :func:`cross_triangle` has for it."""
    ax, ay, az = faces[i, 0] - ox, faces[i, 1] - oy, faces[i, 2] - oz
    height = faces[i, 9] * ax + faces[i, 10] * ay + faces[i, 11] * az
    return height / (faces[i, 9] * dx + faces[i, 10] * dy + faces[i, 11] * dz)
