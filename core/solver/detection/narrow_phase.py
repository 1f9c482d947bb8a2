# SPDX-License-Identifier: GPL-3.0-or-later
"""Where sensors meet targets: contact points' segments against the targets' trees, written as contact rows (kernels)."""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.bvh import segment_entry
from ...laws.contact import DEPTH, LANES, NX, NY, NZ, PX, PY, PZ, ROW, ZX, ZY, ZZ
from .deformation import place_all, place_near
from .neighbour_lists import entry, look_around
from .surface_kinematics import finish_rows


@kernel
def _relative_pose(a, b, position, rotation, pose):
    """Write the sensor's rotation (row by row) and position in the target's frame into `pose`."""
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


@kernel
def _distance_to_box(pose, center, sensor, bounds, root):
    """Distance of the sensor's middle from the target's box, metres."""
    square = 0.0
    for i in range(3):
        x = pose[9 + i] + pose[3 * i] * center[sensor, 0]
        x += pose[3 * i + 1] * center[sensor, 1] + pose[3 * i + 2] * center[sensor, 2]
        out = max(bounds[root, i] - x, x - bounds[root, 3 + i], 0.0)
        square += out * out
    return math.sqrt(square)


@kernel
def _travel(pose, old, pair, center, sensor, radius):
    """Bound on how far any point of the sensor has moved between two poses, metres."""
    shift, turn = 0.0, 0.0
    for i in range(3):
        change = pose[9 + i] - old[pair, 9 + i]
        for j in range(3):
            difference = pose[3 * i + j] - old[pair, 3 * i + j]
            change += difference * center[sensor, j]
            turn += difference * difference
        shift += change * change
    return math.sqrt(shift) + math.sqrt(0.5 * turn) * radius


@inlined
def _segment(point, reach, pose, points):
    """Base of a contact point's segment in the target's frame, the vector to its tip, and the tip."""
    tx = pose[9] + pose[0] * points[point, 0] + pose[1] * points[point, 1] + pose[2] * points[point, 2]
    ty = pose[10] + pose[3] * points[point, 0] + pose[4] * points[point, 1] + pose[5] * points[point, 2]
    tz = pose[11] + pose[6] * points[point, 0] + pose[7] * points[point, 1] + pose[8] * points[point, 2]
    dx = reach * (pose[0] * points[point, 3] + pose[1] * points[point, 4] + pose[2] * points[point, 5])
    dy = reach * (pose[3] * points[point, 3] + pose[4] * points[point, 4] + pose[5] * points[point, 5])
    dz = reach * (pose[6] * points[point, 3] + pose[7] * points[point, 4] + pose[8] * points[point, 5])
    return tx - dx, ty - dy, tz - dz, dx, dy, dz, tx, ty, tz


@inlined
def _own_travel(point, reach, pose, old, points):
    """How far any point of a segment has moved between two poses at the most, metres: one of its ends."""
    ox, oy, oz, _, _, _, tx, ty, tz = _segment(point, reach, pose, points)
    px, py, pz, _, _, _, qx, qy, qz = _segment(point, reach, old, points)
    base = (ox - px) ** 2 + (oy - py) ** 2 + (oz - pz) ** 2
    return math.sqrt(max(base, (tx - qx) ** 2 + (ty - qy) ** 2 + (tz - qz) ** 2))


@inlined
def _keep_up(pair, sensor, target, pose, world, tree, neighbours, shapes, hint):
    """Look around anew for those contact points that have moved by more than what they know holds for."""
    known = neighbours.pose[pair]
    deformed = shapes.travelled[target] + shapes.point_travelled[sensor]
    travel = _travel(pose, neighbours.pose, pair, world.center, sensor, world.radius[sensor]) + deformed - known[14]
    known[13] += 1.0
    step = travel / known[13] if known[12] >= 0.0 else 0.0
    # Wide tubes cost more to use, so they are narrowed where all has come to rest.
    narrower = known[13] == 256.0 and 32.0 * step < 0.5 * known[15]
    if travel > known[12] or narrower:
        _look_around_all(pair, travel, step, narrower, pose, world, tree, neighbours, shapes, hint)


@kernel
def _look_around_all(pair, travel, step, narrower, pose, world, tree, neighbours, shapes, hint):
    """Reckon distances from the present pose, and look around where that is due, or wherever something is near.

    The radius of the tubes follows the motion: some thirty steps' travel. Of a target that deforms all is looked at anew, since
    all of its triangles must be brought to the present moment for that.
    """
    sensor, target = world.pairs[pair, 0], world.pairs[pair, 1]
    points, reach, known, until = world.points, world.reach[sensor], neighbours.pose[pair], neighbours.until
    place_all(target, shapes, tree)
    first, deforms, listed = known[12] < 0.0, shapes.deforms[target], world.listed[pair]
    radius = world.skin[pair] if first else min(max(32.0 * step, 1e-3 * listed), world.skin[pair])
    deformed = shapes.travelled[target] + shapes.point_travelled[sensor] - known[14]
    soonest, slot = np.inf, world.slot_start[pair] - 1
    for point in range(world.point_first[pair], world.point_stop[pair]):
        slot += 1
        near = 0.0 <= until[slot] < 16.0 * travel  # where the bound for all points is soon used up, the point's own way counts
        until[slot] -= min(_own_travel(point, reach, pose, known, points) + deformed, travel) if near else travel
        if until[slot] < 0.0 or deforms or first or (narrower and neighbours.number[slot] != 0):
            ox, oy, oz, dx, dy, dz, _, _, _ = _segment(point, reach, pose, points)
            empty = neighbours.number[slot] == 0 and hint[slot] < 0
            look_around(slot, ox, oy, oz, dx, dy, dz, target, radius, listed, step, empty, not deforms, neighbours, tree)
        soonest = min(soonest, until[slot])
    for i in range(12):
        known[i] = pose[i]
    known[15] = radius if narrower or first else max(known[15], radius)
    known[12], known[13], known[14] = soonest, 0.0, known[14] + deformed


@kernel
def _forget(pair, world, state):
    """Nothing of this pair touches: no triangle met, no bristle bent."""
    start = world.slot_start[pair]
    for slot in range(start, start + world.point_stop[pair] - world.point_first[pair]):
        if state.hint[slot] != -1:
            state.hint[slot] = -1
            for i in range(4):
                state.bristles[slot, i] = 0.0


@kernel
def gather(pair, dt, world, tree, neighbours, shapes, state, scratch):
    """Collect the contacts of one pair as rows.

    The segment of a contact point runs from `reach` deep in the sensor to it; where it enters the target counts. Memory of
    the pair in `state` is brought up to date: the triangle met, and the bristles, which are zero where nothing touches.

    Parameters
    ----------
    pair : int
    dt : float, seconds
        By which velocities of surfaces are told: the step that begins, or minus the step that has ended.
    world : World
    tree : Tree
    neighbours : Neighbours
    shapes : Shapes
    state : State
    scratch : Scratch
        `rotation` is read; `rows`, `slots` (which place in the memory each row belongs to), `own`, `contacts` and `sunk` are
        written.
    """
    sensor, target = world.pairs[pair, 0], world.pairs[pair, 1]
    a, b = world.sensor_body[sensor], world.target_body[target]
    points, hint, bristles = world.points, state.hint, state.bristles
    rows, slots, pose, first = scratch.rows, scratch.slots, scratch.pose[pair], scratch.first_block[pair]
    reach, root = world.reach[sensor], tree.roots[target]
    _relative_pose(a, b, state.position, scratch.rotation, pose)
    if _distance_to_box(pose, world.center, sensor, tree.bounds, root) > world.radius[sensor]:
        _forget(pair, world, state)
        scratch.contacts[pair], scratch.sunk[pair] = 0, 0
        return
    _keep_up(pair, sensor, target, pose, world, tree, neighbours, shapes, hint)
    sunk, slot = 0, world.slot_start[pair] - 1
    stop = slot + 1 + world.point_stop[pair] - world.point_first[pair]
    if shapes.deforms[target]:
        place_near(target, slot + 1, stop, neighbours.near, neighbours.number, shapes, tree)
    block, lane = first, 0
    for point in range(world.point_first[pair], world.point_stop[pair]):
        slot += 1
        before = hint[slot]
        if before == -1 and neighbours.number[slot] == 0:
            continue
        ox, oy, oz, dx, dy, dz, tx, ty, tz = _segment(point, reach, pose, points)
        met, triangle, leaving = entry(ox, oy, oz, dx, dy, dz, slot, target, before, neighbours, tree)
        if triangle < 0:
            # Sunk: the base is inside the object. Either the segment leaves it somewhere, or the object's surface has just run
            # past the base (it was within the last tenth of the reach a step ago, and is not just beside it now).
            in_box = (
                min(ox, tx) <= tree.bounds[root, 3] and max(ox, tx) >= tree.bounds[root, 0]
                and min(oy, ty) <= tree.bounds[root, 4] and max(oy, ty) >= tree.bounds[root, 1]
                and min(oz, tz) <= tree.bounds[root, 5] and max(oz, tz) >= tree.bounds[root, 2]
            )  # fmt: skip
            ran_past = in_box and before == -2
            if in_box and before >= 0 and bristles[slot, 3] > 0.9:
                place_all(target, shapes, tree)
                ran_past = _behind(ox, oy, oz, dx, dy, dz, target, tree)
            if leaving <= 1.0 or ran_past:
                sunk += 1
                hint[slot] = -2
            else:
                hint[slot] = -1
            for i in range(4):
                bristles[slot, i] = 0.0
            continue
        hint[slot] = triangle
        fx, fy, fz = tree.faces[triangle, 9], tree.faces[triangle, 10], tree.faces[triangle, 11]
        nx = pose[0] * fx + pose[3] * fy + pose[6] * fz
        ny = pose[1] * fx + pose[4] * fy + pose[7] * fz
        nz = pose[2] * fx + pose[5] * fy + pose[8] * fz
        rows[block, NX + lane], rows[block, NY + lane], rows[block, NZ + lane] = nx, ny, nz
        # From the point back along its normal to the intersection.
        inside = 1.0 - met
        rows[block, PX + lane] = points[point, 0] - inside * reach * points[point, 3]
        rows[block, PY + lane] = points[point, 1] - inside * reach * points[point, 4]
        rows[block, PZ + lane] = points[point, 2] - inside * reach * points[point, 5]
        rows[block, ZX + lane], rows[block, ZY + lane] = bristles[slot, 0], bristles[slot, 1]
        rows[block, ZZ + lane] = bristles[slot, 2]
        rows[block, DEPTH + lane] = inside * abs(dx * fx + dy * fy + dz * fz)
        bristles[slot, 3] = inside
        slots[block, lane] = slot
        lane += 1
        if lane == LANES:
            block, lane = block + 1, 0
    count = (block - first) * LANES + lane
    if lane > 0:
        for unused in range(lane, LANES):
            for column in range(0, ROW, LANES):
                rows[block, column + unused] = 0.0
    if shapes.smooth[target] or shapes.deforms[target] or shapes.bends[sensor]:
        finish_rows(pair, first, count, dt, world, tree, shapes, state, scratch)
    _lay_flat(first, count, rows)
    scratch.contacts[pair], scratch.sunk[pair] = count, sunk


@kernel
def _lay_flat(first, count, rows):
    """Lay back into the surface what its turn makes stand out of it of a bristle, which stays as long as it was."""
    for block in range(first, first + (count + LANES - 1) // LANES):
        for lane in range(LANES):
            nx, ny, nz = rows[block, NX + lane], rows[block, NY + lane], rows[block, NZ + lane]
            zx, zy, zz = rows[block, ZX + lane], rows[block, ZY + lane], rows[block, ZZ + lane]
            out_of_plane = zx * nx + zy * ny + zz * nz
            length = zx * zx + zy * zy + zz * zz
            flat_x, flat_y, flat_z = zx - out_of_plane * nx, zy - out_of_plane * ny, zz - out_of_plane * nz
            flat = flat_x * flat_x + flat_y * flat_y + flat_z * flat_z
            scale = math.sqrt(length / flat) if flat > 0.0 and out_of_plane != 0.0 else 1.0
            rows[block, ZX + lane], rows[block, ZY + lane] = scale * flat_x, scale * flat_y
            rows[block, ZZ + lane] = scale * flat_z


@kernel
def _behind(ox, oy, oz, dx, dy, dz, target, tree):
    """Whether a long segment from O along D leaves the target's surface before it enters it: then O is inside, or behind it."""
    root, size = tree.roots[target], 1.0
    for i in range(3):
        size += (tree.bounds[root, 3 + i] - tree.bounds[root, i]) / math.sqrt(dx * dx + dy * dy + dz * dz)
    t, _, leaving = segment_entry(ox, oy, oz, size * dx, size * dy, size * dz, target, -1, tree)
    return leaving < t


@kernel
def count_sunk(pair, closed, world, tree, shapes, state, scratch):
    """Count the contact points of a sensor that are deeper inside a target than they reach, and so feel nothing.

    Looked for once a frame by a long segment from each segment's base: among all points when the target is closed, else among
    those that were seen to sink in. Points that have come out again elsewhere, as in a hole of the target, are forgotten.
    The other arguments are those of :func:`gather`.
    """
    sensor, target = world.pairs[pair, 0], world.pairs[pair, 1]
    pose, hint = scratch.pose[pair], state.hint
    _relative_pose(world.sensor_body[sensor], world.target_body[target], state.position, scratch.rotation, pose)
    place_all(target, shapes, tree)
    points, reach, root = world.points, world.reach[sensor], tree.roots[target]
    sunk, slot = 0, world.slot_start[pair] - 1
    for point in range(world.point_first[pair], world.point_stop[pair]):
        slot += 1
        if hint[slot] >= 0 or (hint[slot] == -1 and not closed):
            continue
        ox, oy, oz, dx, dy, dz, _, _, _ = _segment(point, reach, pose, points)
        within = (
            tree.bounds[root, 0] <= ox <= tree.bounds[root, 3]
            and tree.bounds[root, 1] <= oy <= tree.bounds[root, 4]
            and tree.bounds[root, 2] <= oz <= tree.bounds[root, 5]
        )
        if (within or not closed) and _behind(ox, oy, oz, dx, dy, dz, target, tree):
            sunk += 1
        elif hint[slot] == -2:
            hint[slot] = -1
    return sunk
