# SPDX-License-Identifier: GPL-3.0-or-later
"""Where sensors meet targets: contact points' segments against the targets' trees, written as contact rows (kernels)."""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import inlined, kernel
from ...geometry.bvh import Segment, Tree, segment_entry
from ...geometry.shapes import MESH
from ..solver_model import NO_TRIANGLE, TOO_DEEP, SolverModel, State
from ..workspace import Workspace
from .deformation import place_all_triangles, place_listed_triangles
from .detection_data import LANES, DetectionData
from .neighbour_lists import find_entry, rebuild_list
from .shape_contacts import clear_slot, find_shape_contacts, finish_block, segment_of, write_relative_pose, write_row

NEARLY_TOO_DEEP = 0.9
"""Share of the maximum penetration. If a point was deeper than this a step ago and its segment meets nothing now, it may be
pressed past the maximum penetration now."""


@kernel
def _distance_to_box(pose: np.ndarray, center: np.ndarray, bounds: np.ndarray, root: int) -> float:
    """Distance of the centre of a sensor's sphere from the target's box, metres."""
    square = 0.0
    for i in range(3):
        x = pose[9 + i] + pose[3 * i] * center[0]
        x += pose[3 * i + 1] * center[1] + pose[3 * i + 2] * center[2]
        out = max(bounds[root, i] - x, x - bounds[root, 3 + i], 0.0)
        square += out * out
    return math.sqrt(square)


@kernel
def _travel_bound(pose: np.ndarray, old: np.ndarray, center: np.ndarray, radius: float) -> float:
    """Bound on how far any point of the sensor has moved between two poses, metres."""
    shift, turn = 0.0, 0.0
    for i in range(3):
        change = pose[9 + i] - old[9 + i]
        for j in range(3):
            difference = pose[3 * i + j] - old[3 * i + j]
            change += difference * center[j]
            turn += difference * difference
        shift += change * change
    return math.sqrt(shift) + math.sqrt(0.5 * turn) * radius


@inlined
def _segment_travel(point: int, reach: float, pose: np.ndarray, old: np.ndarray, frame: np.ndarray) -> float:
    """How far any point of a segment has moved between two poses at the most, metres: one of its ends."""
    now, (tx, ty, tz) = segment_of(point, reach, pose, frame)
    then, (qx, qy, qz) = segment_of(point, reach, old, frame)
    base = (now.ox - then.ox) ** 2 + (now.oy - then.oy) ** 2 + (now.oz - then.oz) ** 2
    return math.sqrt(max(base, (tx - qx) ** 2 + (ty - qy) ** 2 + (tz - qz) ** 2))


@inlined
def _update_lists(pair: int, pose: np.ndarray, model: SolverModel, detection: DetectionData, state: State) -> None:
    """Rebuild the neighbour lists of those contact points that have moved further than their lists are valid."""
    sensor, target = model.pairs.sensor[pair], model.pairs.target[pair]
    lists, surfaces = detection.neighbours, detection.surfaces
    deformed = surfaces.target_travel[target] + surfaces.sensor_travel[sensor]
    moved = _travel_bound(pose, lists.pose[pair], model.sensors.center[sensor], model.sensors.radius[sensor])
    travel = moved + deformed - lists.deformation[pair]
    lists.steps[pair] += 1.0
    limit = lists.shortest_distance[pair]
    travel_per_step = travel / lists.steps[pair] if limit >= 0.0 else 0.0
    # Wide tubes cost more to use, so they are narrowed where everything has come to rest.
    narrow = lists.steps[pair] == 256.0 and 32.0 * travel_per_step < 0.5 * lists.tube_radius[pair]
    if travel > limit or narrow:
        _rebuild_lists(pair, (travel, travel_per_step, narrow), pose, model, detection, state)


@kernel
def _rebuild_lists(
    pair: int,
    travelled: tuple[float, float, bool],
    pose: np.ndarray,
    model: SolverModel,
    detection: DetectionData,
    state: State,
) -> None:
    """Measure distances from the present pose, and rebuild the lists that are due, or all that are not empty.

    The radius of the tubes follows the motion: the travel of some thirty steps. All lists of a target that deforms are made
    again, since all of its triangles must be brought to the present moment for that.

    Parameters
    ----------
    pair : int
    travelled : (float, float, bool)
        Travel since distances were reckoned last (m), travel in each step (m), and whether tubes are to be narrowed.
    pose : (12,) float
        See :attr:`.PairWork.pose`.
    model : SolverModel
    detection : DetectionData
    state : State
    """
    travel, travel_per_step, narrow = travelled
    sensor, target = model.pairs.sensor[pair], model.pairs.target[pair]
    lists, surfaces, tree = detection.neighbours, detection.surfaces, detection.tree
    frame, reach, valid, old = model.points.frame, model.sensors.max_penetration[sensor], lists.valid_distance, lists.pose[pair]
    place_all_triangles(target, surfaces, tree)
    first, deforms = lists.shortest_distance[pair] < 0.0, surfaces.target_deforms[target]
    max_list, radius = model.pairs.max_list_radius[pair], model.pairs.max_tube_radius[pair]
    if not first:
        radius = min(max(32.0 * travel_per_step, 1e-3 * max_list), radius)
    deformed = surfaces.target_travel[target] + surfaces.sensor_travel[sensor] - lists.deformation[pair]
    shortest, slot = np.inf, model.pairs.first_slot[pair] - 1
    for point in range(model.pairs.first_point[pair], model.pairs.stop_point[pair]):
        slot += 1
        # Where the bound for all points would soon be used up, the point's own travel counts.
        near = 0.0 <= valid[slot] < 16.0 * travel
        valid[slot] -= min(_segment_travel(point, reach, pose, old, frame) + deformed, travel) if near else travel
        if valid[slot] < 0.0 or deforms or first or (narrow and lists.length[slot] != 0):
            segment, _ = segment_of(point, reach, pose, frame)
            empty = lists.length[slot] == 0 and state.triangle[slot] < 0
            rebuild_list(slot, segment, target, (radius, max_list, travel_per_step), (empty, not deforms), lists, tree)
        shortest = min(shortest, valid[slot])
    for i in range(12):
        old[i] = pose[i]
    lists.tube_radius[pair] = radius if narrow or first else max(lists.tube_radius[pair], radius)
    lists.shortest_distance[pair], lists.steps[pair] = shortest, 0.0
    lists.deformation[pair] = lists.deformation[pair] + deformed


@kernel
def _clear_contacts(pair: int, model: SolverModel, state: State) -> None:
    """Forget all contacts of a pair: no triangle is met, no bristle deflected."""
    start = model.pairs.first_slot[pair]
    for slot in range(start, start + model.pairs.stop_point[pair] - model.pairs.first_point[pair]):
        if state.triangle[slot] != NO_TRIANGLE:
            clear_slot(slot, NO_TRIANGLE, state)


@kernel
def find_contacts(pair: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Find the contacts of one pair and write them as rows; :func:`.finish_contacts` completes them.

    The segment of a contact point runs from its maximum penetration, inside the sensor, to the point; the contact is where it
    enters the target. The memory of the pair in `state` is brought up to date: the triangle met, and the bristles, which are
    zero where nothing touches.

    Parameters
    ----------
    pair : int
    model : SolverModel
    detection : DetectionData
    state : State
    workspace : Workspace
        The bodies' rotations are read, and the contacts are written.
    """
    sensor, target = model.pairs.sensor[pair], model.pairs.target[pair]
    contacts, tree, lists, surfaces = workspace.contacts, detection.tree, detection.neighbours, detection.surfaces
    rows, slots, pose, first = contacts.rows, contacts.slots, workspace.pairs.pose[pair], contacts.first_block[pair]
    frame, reach, root = model.points.frame, model.sensors.max_penetration[sensor], tree.roots[target]
    triangles, bristle, pressed_share = state.triangle, state.bristle, state.pressed_share
    write_relative_pose(pair, model, state, workspace)
    if detection.shapes.kind[target] != MESH:
        find_shape_contacts(pair, model, detection, state, workspace)
        return
    if _distance_to_box(pose, model.sensors.center[sensor], tree.bounds, root) > model.sensors.radius[sensor]:
        _clear_contacts(pair, model, state)
        contacts.number[pair], contacts.too_deep[pair] = 0, 0
        return
    _update_lists(pair, pose, model, detection, state)
    too_deep, slot, block, lane = 0, model.pairs.first_slot[pair] - 1, first, 0
    if surfaces.target_deforms[target]:
        stop = slot + 1 + model.pairs.stop_point[pair] - model.pairs.first_point[pair]
        place_listed_triangles(target, slot + 1, stop, lists, surfaces, tree)
    for point in range(model.pairs.first_point[pair], model.pairs.stop_point[pair]):
        slot += 1
        before = triangles[slot]
        if before == NO_TRIANGLE and lists.length[slot] == 0:
            continue
        segment, tip = segment_of(point, reach, pose, frame)
        met, triangle, leaving = find_entry(segment, slot, target, before, lists, tree)
        if triangle < 0:
            if _is_too_deep(segment, tip, slot, target, leaving, detection, state):
                too_deep += 1
                clear_slot(slot, TOO_DEEP, state)
            else:
                clear_slot(slot, NO_TRIANGLE, state)
            continue
        normal, inside = (tree.faces[triangle, 9], tree.faces[triangle, 10], tree.faces[triangle, 11]), 1.0 - met
        held = bristle[slot, 0], bristle[slot, 1], bristle[slot, 2]
        write_row((block, lane), point, (normal, inside, held), segment, pose, (reach, frame), rows)
        triangles[slot], pressed_share[slot], slots[block, lane] = triangle, inside, slot
        lane += 1
        if lane == LANES:
            block, lane = block + 1, 0
    finish_block(block, lane, rows)
    contacts.number[pair], contacts.too_deep[pair] = (block - first) * LANES + lane, too_deep


@kernel
def _write_known_contacts(pair: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Write the rows of the contacts that are in the state: what each point meets, and the share of its segment inside.

    They are those of the last call of :func:`.find_contacts`, to the bit, where the bodies are where they were then.

    Parameters
    ----------
    pair : int
    model : SolverModel
    detection : DetectionData
    state : State
    workspace : Workspace
        The pair's pose is read, and the rows and their number are written.
    """
    contacts, faces, reach = workspace.contacts, detection.tree.faces, model.sensors.max_penetration[model.pairs.sensor[pair]]
    rows, pose, first, frame = contacts.rows, workspace.pairs.pose[pair], contacts.first_block[pair], model.points.frame
    bristle, slot, block, lane = state.bristle, model.pairs.first_slot[pair] - 1, first, 0
    for point in range(model.pairs.first_point[pair], model.pairs.stop_point[pair]):
        slot += 1
        met = state.triangle[slot]
        if met < 0:
            continue
        inside = state.pressed_share[slot]
        segment, _ = segment_of(point, reach, pose, frame)
        normal = faces[met, 9], faces[met, 10], faces[met, 11]
        held = bristle[slot, 0], bristle[slot, 1], bristle[slot, 2]
        write_row((block, lane), point, (normal, inside, held), segment, pose, (reach, frame), rows)
        contacts.slots[block, lane] = slot
        lane += 1
        if lane == LANES:
            block, lane = block + 1, 0
    finish_block(block, lane, rows)
    contacts.number[pair] = (block - first) * LANES + lane


@kernel
def write_last_contacts(pair: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Write the pose and the contacts of a pair that were found last, when the bodies have not moved since."""
    write_relative_pose(pair, model, state, workspace)
    if detection.shapes.kind[model.pairs.target[pair]] == MESH:
        _write_known_contacts(pair, model, detection, state, workspace)
    else:  # they follow from the poses alone
        find_shape_contacts(pair, model, detection, state, workspace)


@kernel
def _is_too_deep(
    segment: Segment,
    tip: tuple[float, float, float],
    slot: int,
    target: int,
    leaving: float,
    detection: DetectionData,
    state: State,
) -> bool:
    """Whether a point whose segment enters no surface is pressed past its maximum penetration: the base is inside the object.

    Then either the segment leaves the object somewhere, or the object's surface has just moved past the base: the point was
    within the last tenth of the maximum penetration a step ago, and the object is not just beside it now.
    """
    tree, before = detection.tree, state.triangle[slot]
    root, bounds = tree.roots[target], tree.bounds
    tx, ty, tz = tip
    in_box = (
        min(segment.ox, tx) <= bounds[root, 3] and max(segment.ox, tx) >= bounds[root, 0]
        and min(segment.oy, ty) <= bounds[root, 4] and max(segment.oy, ty) >= bounds[root, 1]
        and min(segment.oz, tz) <= bounds[root, 5] and max(segment.oz, tz) >= bounds[root, 2]
    )  # fmt: skip
    moved_past = in_box and before == TOO_DEEP
    if in_box and before >= 0 and state.pressed_share[slot] > NEARLY_TOO_DEEP:
        place_all_triangles(target, detection.surfaces, tree)
        moved_past = _is_inside(segment, target, tree)
    return leaving <= 1.0 or moved_past


@kernel
def _is_inside(segment: Segment, target: int, tree: Tree) -> bool:
    """Whether a long line from a segment's base, in its direction, leaves the target's surface before it enters it."""
    root, size = tree.roots[target], 1.0
    ox, oy, oz, dx, dy, dz = segment
    for i in range(3):
        size += (tree.bounds[root, 3 + i] - tree.bounds[root, i]) / math.sqrt(dx * dx + dy * dy + dz * dz)
    t, _, leaving = segment_entry(Segment(ox, oy, oz, size * dx, size * dy, size * dz), target, -1, tree)
    return leaving < t


@kernel
def count_too_deep(pair: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> int:
    """Count the contact points of a pair that are pressed past their maximum penetration, and so measure nothing.

    They are looked for once a frame by a long line from each segment's base: among all points when the target is closed,
    otherwise among those that were seen to go in. Points that have come out elsewhere, as in a hole of the target, are cleared.
    The arguments are those of :func:`find_contacts`.
    """
    sensor, target = model.pairs.sensor[pair], model.pairs.target[pair]
    pose, tree, triangles = workspace.pairs.pose[pair], detection.tree, state.triangle
    closed = detection.shapes.closed[target]
    write_relative_pose(pair, model, state, workspace)
    place_all_triangles(target, detection.surfaces, tree)
    frame, reach, root, bounds = model.points.frame, model.sensors.max_penetration[sensor], tree.roots[target], tree.bounds
    too_deep, slot = 0, model.pairs.first_slot[pair] - 1
    for point in range(model.pairs.first_point[pair], model.pairs.stop_point[pair]):
        slot += 1
        if triangles[slot] >= 0 or (triangles[slot] == NO_TRIANGLE and not closed):
            continue
        segment, _ = segment_of(point, reach, pose, frame)
        within = (
            bounds[root, 0] <= segment.ox <= bounds[root, 3]
            and bounds[root, 1] <= segment.oy <= bounds[root, 4]
            and bounds[root, 2] <= segment.oz <= bounds[root, 5]
        )
        if (within or not closed) and _is_inside(segment, target, tree):
            too_deep += 1
        elif triangles[slot] == TOO_DEEP:
            triangles[slot] = NO_TRIANGLE
    return too_deep
