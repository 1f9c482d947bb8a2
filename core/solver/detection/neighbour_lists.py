# SPDX-License-Identifier: GPL-3.0-or-later
"""Neighbour lists: triangles near a contact point's segment, so that the tree is searched seldom (kernels).

These are neighbour lists as in molecular dynamics (Verlet 1967), extended for surfaces. A tube around each segment is searched,
and the result is valid until some point of the segment has moved by more than the tube's radius. It is one of these:

* nothing;
* one sheet: all triangles in the tube face the segment's base, none leans by more than 56° and none lacks a neighbour, and the
  segment's line, extended at both ends, goes through one of them only. Then the segment meets this sheet or none, and the
  triangle is found by walking across edges from the one met last. This holds however many triangles there are;
* a list of triangles, or too many for one: then the tree is searched.

Why a sheet is met only once: where all triangles face the base and each has its neighbours, as many of them lie over one place
of the plane across the segment as over the next, since an edge is left by one triangle and entered by the other. Any point of
the surface in the tube can be followed to the segment's line; it rises on the way by no more than the lean allows, and the line
was extended by that much. So the line would have met a second sheet too; and no segment in the tube leans enough to meet the
same sheet twice.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.bvh import (
    LEAVING_OFFSET,
    NOT_MET,
    Box,
    Segment,
    Shear,
    Tree,
    box_of,
    intersect_plane,
    intersect_triangle,
    is_interior,
    is_outside,
    project_sheared,
    segment_entry,
    shear_to_axis,
)
from .detection_data import NeighbourLists

LIST_LENGTH = 12
"""Most triangles in a list; where there are more, the tree is searched every time."""
ASK_TREE, ONE_SHEET = -1, -2
"""In the place of a list's length: search the tree; the tube holds one sheet."""
MIN_FACING = 0.5547
"""Cosine of the largest angle by which the triangles of a sheet lean: their slope is 1.5 then."""
EXTENSION = 3.0
"""By how many radii a tube is longer than its segment at each end: twice that slope."""
MAX_RADIUS_SHARE = 0.25
"""Largest radius of a tube as a share of its segment's length; segments in the tube lean by no more than 30° then."""
MAX_WALK = 16
"""Most triangles that a walk goes through; then the tree is searched."""


def neighbour_lists_for(slots: int, pairs: int) -> NeighbourLists:
    """Allocate the lists; they are made when they are first asked for."""
    return NeighbourLists(
        triangles=np.zeros((slots, LIST_LENGTH), np.int32),
        length=np.zeros(slots, np.int32),
        known_triangle=np.full(slots, -1, np.int32),
        valid_distance=np.full(slots, -1.0),
        pose=np.zeros((pairs, 12)),
        shortest_distance=np.full(pairs, -1.0),
        steps=np.zeros(pairs),
        deformation=np.zeros(pairs),
        tube_radius=np.zeros(pairs),
    )


@inlined
def find_entry(
    segment: Segment, slot: int, target: int, hint: int, lists: NeighbourLists, tree: Tree
) -> tuple[float, int, float]:
    """Return the same as :func:`.segment_entry`, from the list of a slot where that is possible."""
    count, known = lists.length[slot], lists.known_triangle[slot]
    if count == ONE_SHEET:
        triangle, t = _walk_to_triangle(segment, known, tree)
        if triangle >= 0:
            lists.known_triangle[slot] = triangle
            return t, triangle if 0.0 <= t <= 1.0 else -1, NOT_MET
        return segment_entry(segment, target, hint, tree)
    if known >= 0:
        t = intersect_plane(segment, tree.faces, known)
        return t, known if 0.0 <= t <= 1.0 else -1, NOT_MET
    if count >= 0:
        return _entry_from_list(segment, slot, lists, tree.faces)
    return segment_entry(segment, target, hint, tree)


@kernel
def _entry_from_list(segment: Segment, slot: int, lists: NeighbourLists, faces: np.ndarray) -> tuple[float, int, float]:
    """Return the same as :func:`.segment_entry`, from a list of all triangles that the segment can meet."""
    t, triangle, leaving = NOT_MET, -1, NOT_MET
    shear = shear_to_axis(segment)
    for j in range(lists.length[slot]):
        i = lists.triangles[slot, j]
        u = intersect_triangle(segment, shear, faces, i)
        if 0.0 <= u <= 1.0:
            if u < t:
                t, triangle = u, i
        elif u < 0.0:
            leaving = min(leaving, LEAVING_OFFSET - u)
    return t, triangle, leaving


@inlined
def _projected_corners(
    segment: Segment, shear: Shear, f: np.ndarray, i: int
) -> tuple[float, float, float, float, float, float]:
    """A triangle's corners projected along the segment, its base being the origin: ax, ay, bx, by, cx, cy."""
    ox, oy, oz = segment.ox, segment.oy, segment.oz
    ax, ay = project_sheared(f[i, 0] - ox, f[i, 1] - oy, f[i, 2] - oz, shear)
    bx, by = project_sheared(f[i, 3] - ox, f[i, 4] - oy, f[i, 5] - oz, shear)
    cx, cy = project_sheared(f[i, 6] - ox, f[i, 7] - oy, f[i, 8] - oz, shear)
    return ax, ay, bx, by, cx, cy


@inlined
def _lateral_margin(radius: float, segment: Segment, shear: Shear) -> float:
    """Largest projected distance from the origin of something that a motion by `radius` brings onto it.

    The last term is the rounding of what is compared with it, which must not leave out a triangle that is only just met.
    """
    ox, oy, oz, dx, dy, dz = segment
    rounding = 1e-13 * (abs(ox) + abs(oy) + abs(oz) + abs(dx) + abs(dy) + abs(dz))
    return radius * math.sqrt(1.0 + shear.x * shear.x + shear.y * shear.y) + rounding


@kernel
def _walk_to_triangle(segment: Segment, triangle: int, tree: Tree) -> tuple[int, float]:
    """Walk across edges from `triangle` to the one that a segment's line goes through, no edge of it touched.

    Returns
    -------
    triangle : int
        -1 where the line goes through an edge or the way is long.
    t : float
        Position on the segment, the same bits as :func:`.segment_entry` has for it.
    """
    shear = shear_to_axis(segment)
    for _ in range(MAX_WALK):
        ax, ay, bx, by, cx, cy = _projected_corners(segment, shear, tree.faces, triangle)
        u, v, w = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
        if u + v + w < 0.0:
            u, v, w = -u, -v, -w
        least = min(u, v, w)
        if least > 0.0:
            return triangle, intersect_plane(segment, tree.faces, triangle)
        if not least < 0.0:
            return -1, NOT_MET
        triangle = tree.adjacent[triangle, 0 if u == least else (1 if v == least else 2)]
        if triangle < 0:
            return -1, NOT_MET
    return -1, NOT_MET


@kernel
def rebuild_list(
    slot: int,
    segment: Segment,
    target: int,
    lengths: tuple[float, float, float],
    expected: tuple[bool, bool],
    lists: NeighbourLists,
    tree: Tree,
) -> None:
    """Search again which triangles a segment can meet.

    Parameters
    ----------
    slot : int
        Where to write it.
    segment : Segment
        In the target's frame.
    target : int
    lengths : (float, float, float), metres
        Radius of the tube to search, if that can be; the largest radius for a list of triangles; how far the sensor is
        expected to move in a step.
    expected : (bool, bool)
        Whether nothing is expected to be near, and whether the target's triangles keep their normals, so that there may be
        sheets.
    lists : NeighbourLists
    tree : Tree
    """
    radius, list_radius, travel = lengths
    empty, sheets = expected
    length = math.sqrt(segment.dx * segment.dx + segment.dy * segment.dy + segment.dz * segment.dz)
    radius = min(radius, MAX_RADIUS_SHARE * length)
    count, valid = lists.length, lists.valid_distance
    lists.known_triangle[slot] = -1
    if empty and radius > 0.0:
        free = _clearance(segment, target, 2.0 * radius, 0.25 * radius, tree)
        if free > 0.0:
            count[slot], valid[slot] = 0, free
            return
    for attempt in range(2):
        tube = radius if attempt == 0 else 0.125 * radius
        if not sheets or tube <= 2.0 * travel:
            break
        found, triangle, margin, free = _count_sheets(segment, target, tube, tree)
        if found == 0 or (found == 1 and free > 0.25 * tube):
            count[slot], valid[slot] = 0, tube if found == 0 else min(free, tube)
            return
        if found == 1:
            certain = margin > 0.25 * tube
            count[slot], lists.known_triangle[slot] = 1 if certain else ONE_SHEET, triangle
            valid[slot] = min(margin, tube) if certain else tube
            return
    list_radius = min(list_radius, radius)
    count[slot], valid[slot] = ASK_TREE, max(radius, 8.0 * travel)
    if list_radius > 2.0 * travel:
        count[slot], lists.known_triangle[slot] = _list_triangles(segment, target, list_radius, slot, lists, tree)
        valid[slot] = list_radius


@kernel
def _clearance(segment: Segment, mesh: int, far: float, least: float, tree: Tree) -> float:
    """How far, up to `far`, any point of a segment can move without meeting a leaf's box, metres; zero if not `least`.

    Boxes that are small compared with their distance stand for what is in them.
    """
    ox, oy, oz, dx, dy, dz = segment
    box = box_of(segment, 1.0)
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    ax, ay, az = dx / length, dy / length, dz / length
    tip = (ox + dx) * ax + (oy + dy) * ay + (oz + dz) * az
    bounds, node, stop = tree.bounds, tree.roots[mesh], tree.roots[mesh + 1]
    while node < stop:
        # Along the axes, and along the segment: surfaces that face it are ahead of its tip.
        low = min(ax * bounds[node, 0], ax * bounds[node, 3]) + min(ay * bounds[node, 1], ay * bounds[node, 4])
        low += min(az * bounds[node, 2], az * bounds[node, 5])
        gap = max(
            low - tip, bounds[node, 0] - box.x1, box.x0 - bounds[node, 3], bounds[node, 1] - box.y1,
            box.y0 - bounds[node, 4], bounds[node, 2] - box.z1, box.z0 - bounds[node, 5],
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
def _is_box_beside(segment: Segment, shear: Shear, aside: float, bounds: np.ndarray, node: int) -> bool:
    """Whether the rectangle around a box, projected along the segment, lies further than `aside` from the line."""
    ox, oy, oz = segment.ox, segment.oy, segment.oz
    x0, y0, z0 = bounds[node, 0] - ox, bounds[node, 1] - oy, bounds[node, 2] - oz
    x1, y1, z1 = bounds[node, 3] - ox, bounds[node, 4] - oy, bounds[node, 5] - oz
    x, y = project_sheared(0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1), shear)
    wide, high = project_sheared(
        0.5 * (x1 - x0), 0.5 * (y1 - y0), 0.5 * (z1 - z0), Shear(shear.axis, -abs(shear.x), -abs(shear.y))
    )
    return abs(x) > wide + aside or abs(y) > high + aside


@inlined
def _box_around(segment: Segment, more: float, radius: float) -> Box:
    """Box of a tube around a segment, which is longer at both ends by the share `more`; `radius` in metres."""
    ox, oy, oz, dx, dy, dz = segment
    fx, fy, fz = ox - more * dx, oy - more * dy, oz - more * dz
    tx, ty, tz = ox + (1.0 + more) * dx, oy + (1.0 + more) * dy, oz + (1.0 + more) * dz
    return Box(
        min(fx, tx) - radius, max(fx, tx) + radius, min(fy, ty) - radius, max(fy, ty) + radius,
        min(fz, tz) - radius, max(fz, tz) + radius,
    )  # fmt: skip


@kernel
def _count_sheets(segment: Segment, mesh: int, radius: float, tree: Tree) -> tuple[int, int, float, float]:
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
    _, _, _, dx, dy, dz = segment
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    more = EXTENSION * radius / length
    shear = shear_to_axis(segment)
    aside = _lateral_margin(radius, segment, shear)
    rounding = _lateral_margin(0.0, segment, shear)
    box = _box_around(segment, more, radius)
    leaning = -MIN_FACING * length
    count, triangle, margin, free = 0, -1, 0.0, 0.0
    faces, normal_bounds = tree.faces, tree.normal_bounds
    node, stop = tree.roots[mesh], tree.roots[mesh + 1]
    while node < stop:
        if is_outside(tree.bounds, node, box):
            node = tree.skip[node]
            continue
        slope = max(normal_bounds[node, 0] * dx, normal_bounds[node, 3] * dx)
        along_y = max(normal_bounds[node, 1] * dy, normal_bounds[node, 4] * dy)
        slope += along_y + max(normal_bounds[node, 2] * dz, normal_bounds[node, 5] * dz)
        # What faces the base matters only where the line itself may go through it.
        within = rounding if slope < leaning else aside
        if _is_box_beside(segment, shear, within, tree.bounds, node):
            node = tree.skip[node]
            continue
        for i in range(tree.first[node], tree.first[node] + tree.number[node]):
            ax, ay, bx, by, cx, cy = _projected_corners(segment, shear, faces, i)
            if min(ax, bx, cx) > aside or max(ax, bx, cx) < -aside or min(ay, by, cy) > aside or max(ay, by, cy) < -aside:
                continue
            slope = faces[i, 9] * dx + faces[i, 10] * dy + faces[i, 11] * dz
            if not (slope < leaning and is_interior(i, faces, 9, tree.adjacent)):
                return -1, -1, 0.0, 0.0
            u, v, w = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
            if min(u, v, w) < 0.0 and max(u, v, w) > 0.0:
                continue
            t = intersect_plane(segment, faces, i)
            if -more <= t <= 1.0 + more:
                if count == 1:
                    return -1, -1, 0.0, 0.0
                count, triangle, free = 1, i, 0.4 * length * (t - 1.0)
                margin = abs(u) / math.hypot(bx - ax, by - ay)
                margin = min(margin, abs(v) / math.hypot(cx - bx, cy - by), abs(w) / math.hypot(ax - cx, ay - cy))
        node += 1
    return count, triangle, margin * radius / aside, free


@kernel
def _list_triangles(
    segment: Segment, mesh: int, radius: float, slot: int, lists: NeighbourLists, tree: Tree
) -> tuple[int, int]:
    """Write the triangles that a segment can meet as long as none of its points has moved by more than `radius` (m).

    They are written at `slot` of `lists`, in the order of the tree.

    Returns
    -------
    count : int
        How many there are; -1 when there is no room for them.
    known_triangle : int
        The triangle, where there is only one and the segment's line goes through it for certain, from outside; else -1.
    """
    dx, dy, dz, near = segment.dx, segment.dy, segment.dz, lists.triangles
    shear = shear_to_axis(segment)
    aside = _lateral_margin(radius, segment, shear)
    around = box_of(segment, 1.0)
    box = Box(
        around.x0 - radius, around.x1 + radius, around.y0 - radius, around.y1 + radius, around.z0 - radius, around.z1 + radius
    )
    count, known = 0, -1
    node, stop, f = tree.roots[mesh], tree.roots[mesh + 1], tree.faces
    while node < stop:
        if is_outside(tree.bounds, node, box):
            node = tree.skip[node]
            continue
        for i in range(tree.first[node], tree.first[node] + tree.number[node]):
            # Projected along the segment, the triangle must come within the radius of the origin.
            ax, ay, bx, by, cx, cy = _projected_corners(segment, shear, f, i)
            beside = min(ax, bx, cx) > aside or max(ax, bx, cx) < -aside or min(ay, by, cy) > aside or max(ay, by, cy) < -aside
            u, v, w = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
            side = 1.0 if u + v + w > 0.0 else -1.0
            if beside:
                continue
            # How far inside of each edge the origin is projected, times the edge's length.
            margin_u = aside * math.hypot(bx - ax, by - ay)
            margin_v = aside * math.hypot(cx - bx, cy - by)
            margin_w = aside * math.hypot(ax - cx, ay - cy)
            u, v, w = side * u, side * v, side * w
            if u < -margin_u or v < -margin_v or w < -margin_w:
                continue
            if count == near.shape[1]:
                return -1, -1
            slope = f[i, 9] * dx + f[i, 10] * dy + f[i, 11] * dz
            through = u > margin_u and v > margin_v and w > margin_w and slope < -2.0 * radius
            known = i if count == 0 and through else -1
            near[slot, count] = i
            count += 1
        node += 1
    return count, known
