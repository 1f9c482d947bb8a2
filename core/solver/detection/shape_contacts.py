# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts with spheres, boxes, capsules and planes in closed form, and rows of contacts that are known already (kernels).

The segment of a contact point and its maximum penetration are those of meshes (see :mod:`.narrow_phase`); only where a segment
enters is computed otherwise, and a point is too deep whenever its segment begins inside. In the place of a triangle stands the
axis across the face of a box, else zero.
"""

from __future__ import annotations

from ...compiled.kernels import kernel
from ...geometry.shapes import MESH, is_in_shape, shape_distance, shape_entry, shape_normal
from ..contact_rows import LANES
from ..solver_model import NO_TRIANGLE, TOO_DEEP, SolverModel, State
from ..workspace import Workspace
from .detection_data import DetectionData
from .segments import clear_slot, finish_block, segment_of, write_relative_pose, write_row


@kernel
def find_shape_contacts(pair: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
    """Find the contacts of a pair whose target is a shape; as :func:`.find_contacts`, when the pair's pose is written."""
    sensor, target = model.pairs.sensor[pair], model.pairs.target[pair]
    pose, center, frame = workspace.pairs.pose[pair], model.sensors.center[sensor], model.points.frame
    kind, sizes, reach = detection.shapes.kind[target], detection.shapes.size, model.sensors.max_penetration[sensor]
    size = (sizes[target, 0], sizes[target, 1], sizes[target, 2])
    middle = (
        pose[9] + pose[0] * center[0] + pose[1] * center[1] + pose[2] * center[2],
        pose[10] + pose[3] * center[0] + pose[4] * center[1] + pose[5] * center[2],
        pose[11] + pose[6] * center[0] + pose[7] * center[1] + pose[8] * center[2],
    )
    near = shape_distance(kind, size, middle) <= model.sensors.radius[sensor]
    too_deep, slot, met = 0, model.pairs.first_slot[pair] - 1, False
    for point in range(model.pairs.first_point[pair], model.pairs.stop_point[pair]):
        slot += 1
        if not near:
            if state.triangle[slot] != NO_TRIANGLE:
                clear_slot(slot, NO_TRIANGLE, state)
            continue
        segment, _ = segment_of(point, reach, pose, frame)
        base, way = (segment.ox, segment.oy, segment.oz), (segment.dx / reach, segment.dy / reach, segment.dz / reach)
        entry, axis = shape_entry(kind, size, base, way)
        if is_in_shape(kind, size, base):
            too_deep += 1
            clear_slot(slot, TOO_DEEP, state)
        elif 0.0 <= entry <= reach:
            state.triangle[slot], state.pressed_share[slot], met = axis, 1.0 - entry / reach, True
        elif state.triangle[slot] != NO_TRIANGLE:
            clear_slot(slot, NO_TRIANGLE, state)
    workspace.contacts.number[pair], workspace.contacts.too_deep[pair] = 0, too_deep
    if met:
        write_known_contacts(pair, model, detection, state, workspace)


@kernel
def write_known_contacts(pair: int, model: SolverModel, detection: DetectionData, state: State, workspace: Workspace) -> None:
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
    sensor, target = model.pairs.sensor[pair], model.pairs.target[pair]
    contacts, faces, sizes = workspace.contacts, detection.tree.faces, detection.shapes.size
    rows, pose, first = contacts.rows, workspace.pairs.pose[pair], contacts.first_block[pair]
    frame, reach = model.points.frame, model.sensors.max_penetration[sensor]
    kind, size = detection.shapes.kind[target], (sizes[target, 0], sizes[target, 1], sizes[target, 2])
    bristle, slot, block, lane = state.bristle, model.pairs.first_slot[pair] - 1, first, 0
    for point in range(model.pairs.first_point[pair], model.pairs.stop_point[pair]):
        slot += 1
        met = state.triangle[slot]
        if met < 0:
            continue
        inside = state.pressed_share[slot]
        segment, (tx, ty, tz) = segment_of(point, reach, pose, frame)
        if kind == MESH:
            normal = faces[met, 9], faces[met, 10], faces[met, 11]
        else:
            surface = tx - inside * segment.dx, ty - inside * segment.dy, tz - inside * segment.dz
            normal = shape_normal(kind, size, met, surface)
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
    write_known_contacts(pair, model, detection, state, workspace)
