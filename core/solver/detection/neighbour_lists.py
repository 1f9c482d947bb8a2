# SPDX-License-Identifier: GPL-3.0-or-later
"""What a contact point's segment can meet while it moves little, so that the tree is asked seldom (kernels).

Neighbour lists as in molecular dynamics (Verlet 1967), with what surfaces have and atoms lack. Around each segment a tube is
looked through, and what is found holds until some point of the segment has moved by more than the tube's radius:

* nothing;
* one sheet: all triangles in the tube face the segment's base, none leans by more than 56° and none lacks a neighbour, and the
  segment's line, drawn out at both ends, goes through one of them only. Then the segment meets this sheet or none, and the
  triangle is found by walking across edges from the one met last. This holds however many triangles there are;
* a list of triangles, or too many for one: then the tree is asked.

Why one sheet is met once: where all triangles face the base and each has its neighbours, as many of them lie over one place of
the plane across the segment as over the next, since an edge is left by one triangle and entered by the other. A point of the
surface in the tube can be followed to the segment's line; it rises on the way by no more than the lean allows, and by so much
the line was drawn out. So a second sheet would have been met by the line too; and no segment in the tube leans enough to meet
the same sheet twice.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...compiled.struct_reference import by_reference
from ...geometry.bvh import (
    boxes_disjoint,
    intersect_plane,
    intersect_triangle,
    is_interior,
    project_sheared,
    segment_entry,
    shear_to_axis,
)

LIST_LENGTH = 12
"""Most triangles that are remembered as near a segment; where there are more, the tree is asked every time."""
ASK_TREE, ONE_SHEET = -1, -2
"""In the place of a list's length: ask the tree; one sheet."""
MIN_FACING = 0.5547
"""Cosine of the angle by which the triangles of a sheet lean at the most: their slope is 1.5 then."""
EXTENSION = 3.0
"""By how many radii a tube is longer than its segment at each end: twice that slope."""
MAX_RADIUS_SHARE = 0.25
"""Largest radius of a tube by the length of its segment; segments in the tube lean by no more than 30° then."""
MAX_WALK = 16
"""Most triangles that a walk goes through; then the tree is asked."""


@by_reference
class NeighbourLists(NamedTuple):
    """What each contact point can meet; a cache that changes the speed and never the numbers.

    Attributes
    ----------
    near : (s, LISTED) int
    number : (s,) int
        Length of each list, ASK or ONE_SHEET.
    only : (s,) int
        The triangle that a texel's line goes through for certain and alone; of a sheet, the triangle met last; else -1.
    until : (s,) float, metres
        How far any point of the sensor may be from where it was at the pair's `pose` for this to hold.
    pose : (q, 16) float
        Rotation (row by row) and position of each pair's sensor in the target's frame, from which distances are reckoned; the
        least of `until`; how many steps ago the pose was taken; how far deformation had moved either until then; and the
        radius of the widest tube in use.
    """

    near: np.ndarray
    number: np.ndarray
    only: np.ndarray
    until: np.ndarray
    pose: np.ndarray


def neighbour_lists_for(slots: int, pairs: int) -> NeighbourLists:
    """Make room; what is near is looked for when it is first asked for."""
    near, pose = np.zeros((slots, LIST_LENGTH), np.int32), np.zeros((pairs, 16))
    pose[:, 12] = -1.0
    return NeighbourLists(near, np.zeros(slots, np.int32), np.full(slots, -1, np.int32), np.full(slots, -1.0), pose)


@inlined
def find_entry(ox, oy, oz, dx, dy, dz, slot, target, hint, neighbour_lists, tree):
    """Answer like :func:`.segment_entry`, from what is known to be near."""
    number, only = neighbour_lists.number[slot], neighbour_lists.only[slot]
    if number == ONE_SHEET:
        triangle, t = _walk_to_triangle(ox, oy, oz, dx, dy, dz, only, tree)
        if triangle >= 0:
            neighbour_lists.only[slot] = triangle
            return t, triangle if 0.0 <= t <= 1.0 else -1, 2.0
        return segment_entry(ox, oy, oz, dx, dy, dz, target, hint, tree)
    if only >= 0:
        t = intersect_plane(ox, oy, oz, dx, dy, dz, tree.faces, only)
        return t, only if 0.0 <= t <= 1.0 else -1, 2.0
    if number >= 0:
        return _entry_from_list(ox, oy, oz, dx, dy, dz, neighbour_lists.near, slot, number, tree.faces)
    return segment_entry(ox, oy, oz, dx, dy, dz, target, hint, tree)


@kernel
def _entry_from_list(ox, oy, oz, dx, dy, dz, near, slot, number, faces):
    """Answer like :func:`.segment_entry`, from a list of all triangles that the segment can meet."""
    t, triangle, leaving = 2.0, -1, 2.0
    axis, shear_x, shear_y = shear_to_axis(dx, dy, dz)
    for j in range(number):
        i = near[slot, j]
        u = intersect_triangle(ox, oy, oz, dx, dy, dz, axis, shear_x, shear_y, faces, i)
        if 0.0 <= u <= 1.0:
            if u < t:
                t, triangle = u, i
        elif u < 0.0:
            leaving = min(leaving, -3.0 - u)
    return t, triangle, leaving


@inlined
def _corners_seen(ox, oy, oz, axis, shear_x, shear_y, f, i):
    """A triangle's corners seen along the segment, its base being the origin: ax, ay, bx, by, cx, cy."""
    ax, ay = project_sheared(f[i, 0] - ox, f[i, 1] - oy, f[i, 2] - oz, axis, shear_x, shear_y)
    bx, by = project_sheared(f[i, 3] - ox, f[i, 4] - oy, f[i, 5] - oz, axis, shear_x, shear_y)
    cx, cy = project_sheared(f[i, 6] - ox, f[i, 7] - oy, f[i, 8] - oz, axis, shear_x, shear_y)
    return ax, ay, bx, by, cx, cy


@inlined
def _lateral_margin(skin, ox, oy, oz, dx, dy, dz, shear_x, shear_y):
    """How far aside of the origin, seen along the segment, something may lie that a motion by `skin` brings onto it.

    The last term is the rounding of what is compared with it, which must not leave out a triangle that is only just met.
    """
    rounding = 1e-13 * (abs(ox) + abs(oy) + abs(oz) + abs(dx) + abs(dy) + abs(dz))
    return skin * math.sqrt(1.0 + shear_x * shear_x + shear_y * shear_y) + rounding


@kernel
def _walk_to_triangle(ox, oy, oz, dx, dy, dz, triangle, tree):
    """Go across edges from `triangle` to the one that a segment's line goes through, no edge of it touched.

    Returns
    -------
    triangle : int
        -1 where the line goes through an edge or the way is long.
    t : float
        Position on the segment, the same bits as :func:`.segment_entry` has for it.
    """
    axis, shear_x, shear_y = shear_to_axis(dx, dy, dz)
    for _ in range(MAX_WALK):
        ax, ay, bx, by, cx, cy = _corners_seen(ox, oy, oz, axis, shear_x, shear_y, tree.faces, triangle)
        u, v, w = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
        if u + v + w < 0.0:
            u, v, w = -u, -v, -w
        least = min(u, v, w)
        if least > 0.0:
            return triangle, intersect_plane(ox, oy, oz, dx, dy, dz, tree.faces, triangle)
        if not least < 0.0:
            return -1, 2.0
        triangle = tree.adjacent[triangle, 0 if u == least else (1 if v == least else 2)]
        if triangle < 0:
            return -1, 2.0
    return -1, 2.0


@kernel
def rebuild_list(slot, ox, oy, oz, dx, dy, dz, target, radius, listed, travel, empty, sheets, neighbour_lists, tree):
    """Find out anew what a segment can meet.

    Parameters
    ----------
    slot : int
        Where to write it.
    ox … dz : float
        Base of the segment and the vector to its tip, in the target's frame.
    target : int
    radius : float, metres
        Of the tube to look through, if that can be.
    listed : float, metres
        Most for a list of triangles.
    travel : float, metres
        How far the sensor is expected to move in a step.
    empty : bool
        Whether nothing is expected to be near.
    sheets : bool
        Whether the target's triangles keep their normals.
    neighbours : NeighbourLists
    tree : Tree
    """
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    radius = min(radius, MAX_RADIUS_SHARE * length)
    neighbour_lists.only[slot] = -1
    if empty and radius > 0.0:
        free = _clearance(ox, oy, oz, dx, dy, dz, target, 2.0 * radius, 0.25 * radius, tree)
        if free > 0.0:
            neighbour_lists.number[slot], neighbour_lists.until[slot] = 0, free
            return
    for attempt in range(2):
        tube = radius if attempt == 0 else 0.125 * radius
        if not sheets or tube <= 2.0 * travel:
            break
        count, triangle, margin, free = _count_sheets(ox, oy, oz, dx, dy, dz, target, tube, tree)
        if count == 0 or (count == 1 and free > 0.25 * tube):
            neighbour_lists.number[slot], neighbour_lists.until[slot] = 0, tube if count == 0 else min(free, tube)
            return
        if count == 1:
            certain = margin > 0.25 * tube
            neighbour_lists.number[slot], neighbour_lists.only[slot] = 1 if certain else ONE_SHEET, triangle
            neighbour_lists.until[slot] = min(margin, tube) if certain else tube
            return
    listed = min(listed, radius)
    neighbour_lists.number[slot], neighbour_lists.until[slot] = ASK_TREE, max(radius, 8.0 * travel)
    if listed > 2.0 * travel:
        number, only = _list_triangles(ox, oy, oz, dx, dy, dz, target, listed, neighbour_lists.near, slot, tree)
        neighbour_lists.number[slot], neighbour_lists.only[slot], neighbour_lists.until[slot] = number, only, listed


@kernel
def _clearance(ox, oy, oz, dx, dy, dz, mesh, far, least, tree):
    """How far, up to `far`, any point of a segment can move without meeting a leaf's box, metres; zero if not `least`.

    Boxes that are small beside their distance are taken for what is in them.
    """
    x0, x1 = min(ox, ox + dx), max(ox, ox + dx)
    y0, y1 = min(oy, oy + dy), max(oy, oy + dy)
    z0, z1 = min(oz, oz + dz), max(oz, oz + dz)
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    ax, ay, az = dx / length, dy / length, dz / length
    tip = (ox + dx) * ax + (oy + dy) * ay + (oz + dz) * az
    bounds, node, stop = tree.bounds, tree.roots[mesh], tree.roots[mesh + 1]
    while node < stop:
        # Along the axes, and along the segment: surfaces that face it are ahead of its tip.
        low = min(ax * bounds[node, 0], ax * bounds[node, 3]) + min(ay * bounds[node, 1], ay * bounds[node, 4])
        low += min(az * bounds[node, 2], az * bounds[node, 5])
        gap = max(
            low - tip, bounds[node, 0] - x1, x0 - bounds[node, 3], bounds[node, 1] - y1,
            y0 - bounds[node, 4], bounds[node, 2] - z1, z0 - bounds[node, 5],
        )  # fmt: skip
        if gap >= far:
            node = tree.skip[node]
            continue
        size = max(bounds[node, 3] - bounds[node, 0], bounds[node, 4] - bounds[node, 1], bounds[node, 5] - bounds[node, 2])
        if tree.number[node] == 0 and size > gap:
            node += 1
            continue
        far = gap
        if far < least:
            return 0.0
        node = tree.skip[node]
    return far


@kernel
def _box_beside_line(ox, oy, oz, axis, shear_x, shear_y, aside, bounds, node):
    """Whether a box, seen along the segment, lies further than `aside` from its line, by the rectangle around what is seen."""
    x0, y0, z0 = bounds[node, 0] - ox, bounds[node, 1] - oy, bounds[node, 2] - oz
    x1, y1, z1 = bounds[node, 3] - ox, bounds[node, 4] - oy, bounds[node, 5] - oz
    x, y = project_sheared(0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1), axis, shear_x, shear_y)
    wide, high = project_sheared(0.5 * (x1 - x0), 0.5 * (y1 - y0), 0.5 * (z1 - z0), axis, -abs(shear_x), -abs(shear_y))
    return abs(x) > wide + aside or abs(y) > high + aside


@kernel
def _count_sheets(ox, oy, oz, dx, dy, dz, mesh, skin, tree):
    """Count the sheets in the tube around a segment, if it holds nothing else.

    Returns
    -------
    count : int
        How many triangles the line goes through; -1 when there are several, or some triangle in the tube is no part of a sheet.
    triangle : int
        The one that it goes through; else -1.
    margin : float, metres
        How far inside of its edges.
    free : float, metres
        How far the segment's tip may come nearer without reaching it, less than zero where it does. Of this distance along the
        segment a sheet that leans takes up one and a half parts where the tip moves aside, and one where it moves ahead.
    """
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    more = EXTENSION * skin / length
    axis, shear_x, shear_y = shear_to_axis(dx, dy, dz)
    aside = _lateral_margin(skin, ox, oy, oz, dx, dy, dz, shear_x, shear_y)
    rounding = _lateral_margin(0.0, ox, oy, oz, dx, dy, dz, shear_x, shear_y)
    fx, fy, fz = ox - more * dx, oy - more * dy, oz - more * dz
    tx, ty, tz = ox + (1.0 + more) * dx, oy + (1.0 + more) * dy, oz + (1.0 + more) * dz
    x0, x1 = min(fx, tx) - skin, max(fx, tx) + skin
    y0, y1 = min(fy, ty) - skin, max(fy, ty) + skin
    z0, z1 = min(fz, tz) - skin, max(fz, tz) + skin
    leaning = -MIN_FACING * length
    count, triangle, margin, free = 0, -1, 0.0, 0.0
    faces, normal_bounds = tree.faces, tree.normal_bounds
    node, stop = tree.roots[mesh], tree.roots[mesh + 1]
    while node < stop:
        if boxes_disjoint(tree.bounds, node, x0, x1, y0, y1, z0, z1):
            node = tree.skip[node]
            continue
        slope = max(normal_bounds[node, 0] * dx, normal_bounds[node, 3] * dx)
        slope += max(normal_bounds[node, 1] * dy, normal_bounds[node, 4] * dy) + max(
            normal_bounds[node, 2] * dz, normal_bounds[node, 5] * dz
        )
        # What faces the base matters only where the line itself may go through it.
        within = rounding if slope < leaning else aside
        if _box_beside_line(ox, oy, oz, axis, shear_x, shear_y, within, tree.bounds, node):
            node = tree.skip[node]
            continue
        for i in range(tree.first[node], tree.first[node] + tree.number[node]):
            ax, ay, bx, by, cx, cy = _corners_seen(ox, oy, oz, axis, shear_x, shear_y, faces, i)
            if min(ax, bx, cx) > aside or max(ax, bx, cx) < -aside or min(ay, by, cy) > aside or max(ay, by, cy) < -aside:
                continue
            slope = faces[i, 9] * dx + faces[i, 10] * dy + faces[i, 11] * dz
            if not (slope < leaning and is_interior(i, faces, 9, tree.adjacent)):
                return -1, -1, 0.0, 0.0
            u, v, w = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
            if min(u, v, w) < 0.0 and max(u, v, w) > 0.0:
                continue
            t = intersect_plane(ox, oy, oz, dx, dy, dz, faces, i)
            if -more <= t <= 1.0 + more:
                if count == 1:
                    return -1, -1, 0.0, 0.0
                count, triangle, free = 1, i, 0.4 * length * (t - 1.0)
                margin = abs(u) / math.hypot(bx - ax, by - ay)
                margin = min(margin, abs(v) / math.hypot(cx - bx, cy - by), abs(w) / math.hypot(ax - cx, ay - cy))
        node += 1
    return count, triangle, margin * skin / aside, free


@kernel
def _list_triangles(ox, oy, oz, dx, dy, dz, mesh, skin, near, slot, tree):
    """Write the triangles that a segment can meet as long as none of its points has moved by more than `skin`.

    Parameters
    ----------
    skin : float, metres
    near : (s, LISTED) int
        Written at `slot`, in the order of the tree.

    Returns
    -------
    number : int
        How many there are; -1 when there is no room for them.
    only : int
        The triangle, where there is but one and the segment's line goes through it for certain, from outside; else -1.
    """
    axis, shear_x, shear_y = shear_to_axis(dx, dy, dz)
    aside = _lateral_margin(skin, ox, oy, oz, dx, dy, dz, shear_x, shear_y)
    x0, x1 = min(ox, ox + dx) - skin, max(ox, ox + dx) + skin
    y0, y1 = min(oy, oy + dy) - skin, max(oy, oy + dy) + skin
    z0, z1 = min(oz, oz + dz) - skin, max(oz, oz + dz) + skin
    number, only = 0, -1
    bounds, node, stop = tree.bounds, tree.roots[mesh], tree.roots[mesh + 1]
    while node < stop:
        if boxes_disjoint(bounds, node, x0, x1, y0, y1, z0, z1):
            node = tree.skip[node]
            continue
        for i in range(tree.first[node], tree.first[node] + tree.number[node]):
            # Seen along the segment, the triangle must come within the skin of the origin.
            f = tree.faces
            ax, ay = project_sheared(f[i, 0] - ox, f[i, 1] - oy, f[i, 2] - oz, axis, shear_x, shear_y)
            bx, by = project_sheared(f[i, 3] - ox, f[i, 4] - oy, f[i, 5] - oz, axis, shear_x, shear_y)
            cx, cy = project_sheared(f[i, 6] - ox, f[i, 7] - oy, f[i, 8] - oz, axis, shear_x, shear_y)
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
