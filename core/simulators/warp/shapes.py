# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a segment enters a simple shape from outside: sphere, box, capsule and plane, in closed form.

Each function returns the position on the segment, 0 at its base and 1 at its tip, the outward normal there (three numbers), and
whether the base is inside the shape. The position is :data:`.bvh.NOT_MET` where there is none.
"""

from __future__ import annotations

import math

from ...geometry.bvh import NOT_MET, Segment


def sphere_entry(segment: Segment, radius: float) -> tuple[float, float, float, float, bool]:
    """Where a segment enters a sphere around the origin."""
    ox, oy, oz, dx, dy, dz = segment
    square, along = dx * dx + dy * dy + dz * dz, ox * dx + oy * dy + oz * dz
    outside = ox * ox + oy * oy + oz * oz - radius * radius
    root = along * along - square * outside
    if outside < 0.0:
        return NOT_MET, 0.0, 0.0, 0.0, True
    if root < 0.0 or along >= 0.0:
        return NOT_MET, 0.0, 0.0, 0.0, False
    t = outside / (math.sqrt(root) - along)
    return t, (ox + t * dx) / radius, (oy + t * dy) / radius, (oz + t * dz) / radius, False


def plane_entry(segment: Segment) -> tuple[float, float, float, float, bool]:
    """Where a segment enters the half-space below z = 0."""
    if segment.oz < 0.0:
        return NOT_MET, 0.0, 0.0, 0.0, True
    if segment.dz >= 0.0:
        return NOT_MET, 0.0, 0.0, 0.0, False
    return -segment.oz / segment.dz, 0.0, 0.0, 1.0, False


def _slab(origin: float, direction: float, half: float) -> tuple[float, float]:
    """Where a segment enters and leaves the slab within ±half of an axis; it never does, or always is, where it runs beside."""
    if direction == 0.0:
        beside = origin > half or origin < -half
        return (math.inf, -math.inf) if beside else (-math.inf, math.inf)
    near = half if direction < 0.0 else -half
    return (near - origin) / direction, (-near - origin) / direction


def box_entry(segment: Segment, hx: float, hy: float, hz: float) -> tuple[float, float, float, float, bool]:
    """Where a segment enters a box around the origin with these half sizes."""
    ox, oy, oz, dx, dy, dz = segment
    x_in, x_out = _slab(ox, dx, hx)
    y_in, y_out = _slab(oy, dy, hy)
    z_in, z_out = _slab(oz, dz, hz)
    t, leaving = max(x_in, y_in, z_in), min(x_out, y_out, z_out)
    inside = t < 0.0 and leaving > 0.0
    if t < 0.0 or t > leaving or t > 1.0:
        return NOT_MET, 0.0, 0.0, 0.0, inside
    if t == x_in:
        return t, (-1.0 if dx > 0.0 else 1.0), 0.0, 0.0, False
    if t == y_in:
        return t, 0.0, (-1.0 if dy > 0.0 else 1.0), 0.0, False
    return t, 0.0, 0.0, (-1.0 if dz > 0.0 else 1.0), False


def capsule_entry(segment: Segment, radius: float, half: float) -> tuple[float, float, float, float, bool]:
    """Where a segment enters a capsule around the origin whose axis runs from −half to half along z."""
    ox, oy, oz, dx, dy, dz = segment
    axial = oz - min(max(oz, -half), half)
    if ox * ox + oy * oy + axial * axial < radius * radius:
        return NOT_MET, 0.0, 0.0, 0.0, True
    square, along = dx * dx + dy * dy, ox * dx + oy * dy
    outside = ox * ox + oy * oy - radius * radius
    root = along * along - square * outside
    t, end = 0.0, oz  # beside the cylinder, or within its radius, the segment can only meet an end
    if outside >= 0.0:
        if root < 0.0 or along >= 0.0:
            return NOT_MET, 0.0, 0.0, 0.0, False
        t = outside / (math.sqrt(root) - along)
        end = oz + t * dz
        if abs(end) <= half:
            return t, (ox + t * dx) / radius, (oy + t * dy) / radius, 0.0, False
    shift = half if end > 0.0 else -half
    return sphere_entry(Segment(ox, oy, oz - shift, dx, dy, dz), radius)
