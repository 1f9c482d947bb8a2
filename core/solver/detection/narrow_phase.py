# SPDX-License-Identifier: GPL-3.0-or-later
"""Where sensors meet targets: contact points' segments against the targets' trees, written as contact rows (kernels)."""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.bvh import segment_entry
from ...laws.contact import DEPTH, LANES, NX, NY, NZ, PX, PY, PZ, ROW, ZX, ZY, ZZ
from .deformation import place_all_triangles, place_listed_triangles
from .neighbour_lists import find_entry, rebuild_list
from .surface_kinematics import apply_surface_motion


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
def _travel_bound(pose, old, pair, center, sensor, radius):
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
def _segment_travel(point, reach, pose, old, points):
    """How far any point of a segment has moved between two poses at the most, metres: one of its ends."""
    ox, oy, oz, _, _, _, tx, ty, tz = _segment(point, reach, pose, points)
    px, py, pz, _, _, _, qx, qy, qz = _segment(point, reach, old, points)
    base = (ox - px) ** 2 + (oy - py) ** 2 + (oz - pz) ** 2
    return math.sqrt(max(base, (tx - qx) ** 2 + (ty - qy) ** 2 + (tz - qz) ** 2))


@inlined
def _update_lists(pair, sensor, target, pose, model, tree, neighbour_lists, surfaces, hint):
    """Look around anew for those contact points that have moved by more than what they know holds for."""
    known = neighbour_lists.pose[pair]
    deformed = surfaces.travelled[target] + surfaces.point_travelled[sensor]
    travel = _travel_bound(pose, neighbour_lists.pose, pair, model.center, sensor, model.radius[sensor]) + deformed - known[14]
    known[13] += 1.0
    step = travel / known[13] if known[12] >= 0.0 else 0.0
    # Wide tubes cost more to use, so they are narrowed where all has come to rest.
    narrower = known[13] == 256.0 and 32.0 * step < 0.5 * known[15]
    if travel > known[12] or narrower:
        _rebuild_lists(pair, travel, step, narrower, pose, model, tree, neighbour_lists, surfaces, hint)


@kernel
def _rebuild_lists(pair, travel, step, narrower, pose, model, tree, neighbour_lists, surfaces, hint):
    """Reckon distances from the present pose, and look around where that is due, or wherever something is near.

    The radius of the tubes follows the motion: some thirty steps' travel. Of a target that deforms all is looked at anew, since
    all of its triangles must be brought to the present moment for that.
    """
    sensor, target = model.pairs[pair, 0], model.pairs[pair, 1]
    points, reach, known, until = model.points, model.reach[sensor], neighbour_lists.pose[pair], neighbour_lists.until
    place_all_triangles(target, surfaces, tree)
    first, deforms, listed = known[12] < 0.0, surfaces.deforms[target], model.listed[pair]
    radius = model.skin[pair] if first else min(max(32.0 * step, 1e-3 * listed), model.skin[pair])
    deformed = surfaces.travelled[target] + surfaces.point_travelled[sensor] - known[14]
    soonest, slot = np.inf, model.slot_start[pair] - 1
    for point in range(model.point_first[pair], model.point_stop[pair]):
        slot += 1
        near = 0.0 <= until[slot] < 16.0 * travel  # where the bound for all points is soon used up, the point's own way counts
        until[slot] -= min(_segment_travel(point, reach, pose, known, points) + deformed, travel) if near else travel
        if until[slot] < 0.0 or deforms or first or (narrower and neighbour_lists.number[slot] != 0):
            ox, oy, oz, dx, dy, dz, _, _, _ = _segment(point, reach, pose, points)
            empty = neighbour_lists.number[slot] == 0 and hint[slot] < 0
            rebuild_list(slot, ox, oy, oz, dx, dy, dz, target, radius, listed, step, empty, not deforms, neighbour_lists, tree)
        soonest = min(soonest, until[slot])
    for i in range(12):
        known[i] = pose[i]
    known[15] = radius if narrower or first else max(known[15], radius)
    known[12], known[13], known[14] = soonest, 0.0, known[14] + deformed


@kernel
def _clear_contacts(pair, model, state):
    """Nothing of this pair touches: no triangle met, no bristle bent."""
    start = model.slot_start[pair]
    for slot in range(start, start + model.point_stop[pair] - model.point_first[pair]):
        if state.hint[slot] != -1:
            state.hint[slot] = -1
            for i in range(4):
                state.bristles[slot, i] = 0.0


@kernel
def find_contacts(pair, dt, model, tree, neighbour_lists, surfaces, state, workspace):
    """Collect the contacts of one pair as rows.

    The segment of a contact point runs from `reach` deep in the sensor to it; where it enters the target counts. Memory of
    the pair in `state` is brought up to date: the triangle met, and the bristles, which are zero where nothing touches.

    Parameters
    ----------
    pair : int
    dt : float, seconds
        By which velocities of surfaces are told: the step that begins, or minus the step that has ended.
    world : SolverModel
    tree : Tree
    neighbours : NeighbourLists
    shapes : SurfaceMotion
    state : State
    scratch : Workspace
        `rotation` is read; `rows`, `slots` (which place in the memory each row belongs to), `own`, `contacts` and `sunk` are
        written.
    """
    sensor, target = model.pairs[pair, 0], model.pairs[pair, 1]
    a, b = model.sensor_body[sensor], model.target_body[target]
    points, hint, bristles = model.points, state.hint, state.bristles
    rows, slots, pose, first = workspace.rows, workspace.slots, workspace.pose[pair], workspace.first_block[pair]
    reach, root = model.reach[sensor], tree.roots[target]
    _relative_pose(a, b, state.position, workspace.rotation, pose)
    if _distance_to_box(pose, model.center, sensor, tree.bounds, root) > model.radius[sensor]:
        _clear_contacts(pair, model, state)
        workspace.contacts[pair], workspace.too_deep[pair] = 0, 0
        return
    _update_lists(pair, sensor, target, pose, model, tree, neighbour_lists, surfaces, hint)
    too_deep, slot = 0, model.slot_start[pair] - 1
    stop = slot + 1 + model.point_stop[pair] - model.point_first[pair]
    if surfaces.deforms[target]:
        place_listed_triangles(target, slot + 1, stop, neighbour_lists.near, neighbour_lists.number, surfaces, tree)
    block, lane = first, 0
    for point in range(model.point_first[pair], model.point_stop[pair]):
        slot += 1
        before = hint[slot]
        if before == -1 and neighbour_lists.number[slot] == 0:
            continue
        ox, oy, oz, dx, dy, dz, tx, ty, tz = _segment(point, reach, pose, points)
        met, triangle, leaving = find_entry(ox, oy, oz, dx, dy, dz, slot, target, before, neighbour_lists, tree)
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
                place_all_triangles(target, surfaces, tree)
                ran_past = _is_inside(ox, oy, oz, dx, dy, dz, target, tree)
            if leaving <= 1.0 or ran_past:
                too_deep += 1
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
    if surfaces.smooth[target] or surfaces.deforms[target] or surfaces.bends[sensor]:
        apply_surface_motion(pair, first, count, dt, model, tree, surfaces, state, workspace)
    _rotate_bristles_into_plane(first, count, rows)
    workspace.contacts[pair], workspace.too_deep[pair] = count, too_deep


@kernel
def _rotate_bristles_into_plane(first, count, rows):
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
def _is_inside(ox, oy, oz, dx, dy, dz, target, tree):
    """Whether a long segment from O along D leaves the target's surface before it enters it: then O is inside, or behind it."""
    root, size = tree.roots[target], 1.0
    for i in range(3):
        size += (tree.bounds[root, 3 + i] - tree.bounds[root, i]) / math.sqrt(dx * dx + dy * dy + dz * dz)
    t, _, leaving = segment_entry(ox, oy, oz, size * dx, size * dy, size * dz, target, -1, tree)
    return leaving < t


@kernel
def count_too_deep(pair, closed, model, tree, surfaces, state, workspace):
    """Count the contact points of a sensor that are deeper inside a target than they reach, and so feel nothing.

    Looked for once a frame by a long segment from each segment's base: among all points when the target is closed, else among
    those that were seen to sink in. Points that have come out again elsewhere, as in a hole of the target, are forgotten.
    The other arguments are those of :func:`find_contacts`.
    """
    sensor, target = model.pairs[pair, 0], model.pairs[pair, 1]
    pose, hint = workspace.pose[pair], state.hint
    _relative_pose(model.sensor_body[sensor], model.target_body[target], state.position, workspace.rotation, pose)
    place_all_triangles(target, surfaces, tree)
    points, reach, root = model.points, model.reach[sensor], tree.roots[target]
    too_deep, slot = 0, model.slot_start[pair] - 1
    for point in range(model.point_first[pair], model.point_stop[pair]):
        slot += 1
        if hint[slot] >= 0 or (hint[slot] == -1 and not closed):
            continue
        ox, oy, oz, dx, dy, dz, _, _, _ = _segment(point, reach, pose, points)
        within = (
            tree.bounds[root, 0] <= ox <= tree.bounds[root, 3]
            and tree.bounds[root, 1] <= oy <= tree.bounds[root, 4]
            and tree.bounds[root, 2] <= oz <= tree.bounds[root, 5]
        )
        if (within or not closed) and _is_inside(ox, oy, oz, dx, dy, dz, target, tree):
            too_deep += 1
        elif hint[slot] == -2:
            hint[slot] = -1
    return too_deep
