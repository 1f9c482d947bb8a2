# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the texels of the active sensor in the 3D view: positions, normals, maximum penetration and numbers."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...core.geometry.grid_layout import GridLayout
from ..scene.stored_names import GAP_COLORS
from ..session import frame_status, session_state, transforms
from . import sensor_report

VALID_COLOR, FAULTY_COLOR, NORMAL_COLOR, REACH_COLOR = (
    (0.1, 0.75, 0.95, 0.9),
    (1.0, 0.15, 0.1, 1.0),
    (0.2, 0.5, 1.0, 1.0),
    (1.0, 0.65, 0.1, 0.9),
)
DISC_SIDES = 8
MAX_LABELS = 600


@dataclass
class Drawing:
    """Points and lines of one report, in the frame of its object and Blender units."""

    report: object
    spots: dict[str, np.ndarray]
    lines: dict[str, np.ndarray]
    labels: list[tuple[str, np.ndarray]]
    batches: dict = field(default_factory=dict)


_drawing: Drawing | None = None


def drawing_of(report) -> Drawing:
    """Return the triangles, lines and labels that show a report."""
    texels, unit = report.texels, report.metres
    a, b, _ = texels.layout.triangles.T
    spacing = float(np.median(np.linalg.norm(texels.position[a] - texels.position[b], axis=1)))
    faulty = np.zeros(len(texels), bool)
    for problem in report.problems:
        faulty[problem.texels] = True
    lifted = texels.position + 0.04 * spacing * texels.normal
    turn = np.arange(DISC_SIDES) * 2 * np.pi / DISC_SIDES
    rim = lifted[:, None] + 0.16 * spacing * (
        np.cos(turn)[:, None] * texels.tangent[:, None] + np.sin(turn)[:, None] * texels.bitangent[:, None]
    )
    discs = np.stack([np.broadcast_to(lifted[:, None], rim.shape), rim, np.roll(rim, -1, axis=1)], axis=2)
    normals = np.stack([lifted, texels.position + 0.8 * spacing * texels.normal], axis=1)
    deep = np.stack([texels.position, texels.position - report.reach * texels.normal], axis=1)
    return Drawing(
        report=report,
        spots={"fine": discs[~faulty].reshape(-1, 3) / unit, "faulty": discs[faulty].reshape(-1, 3) / unit},
        lines={"normals": normals.reshape(-1, 3) / unit, "reach": deep.reshape(-1, 3) / unit},
        labels=_labels(texels, lifted / unit),
    )


def _labels(texels, positions: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return labels and their positions: row and column of texels in a grid, else the index; of a large grid only the rim."""
    layout = texels.layout
    if not isinstance(layout, GridLayout):
        return [(str(i), positions[i]) for i in range(len(positions))] if len(positions) <= MAX_LABELS else []
    rim = (layout.row == 0) | (layout.column == 0)
    shown = np.flatnonzero(rim if len(positions) > MAX_LABELS else np.ones(len(positions), bool))
    return [(f"{layout.row[i]},{layout.column[i]}", positions[i]) for i in shown]


def _present():
    """Return the active sensor, the scene's settings and the sensor's report; None when there is nothing to draw."""
    context = bpy.context
    obj, own = context.object, context.scene.palpate
    wanted = own.show_texels or own.show_normals or own.show_numbers or own.show_reach
    if obj is None or not wanted or obj.type != "MESH" or obj.palpate.role not in {"SENSOR", "PAD"}:
        return None
    if not context.space_data.overlay.show_overlays or not obj.visible_get() or obj.palpate.is_baked:
        return None
    report = sensor_report.known_report(obj, context.scene)
    return (obj, own, report) if report is not None and report.texels is not None else None


def _frame(obj) -> Matrix:
    location, quaternion, _ = transforms.decompose(transforms.as_array(obj.matrix_world))
    return Matrix(transforms.pose_matrix(location, quaternion))


def _current(report) -> Drawing:
    global _drawing
    if _drawing is None or _drawing.report is not report:
        _drawing = drawing_of(report)
    return _drawing


def draw() -> None:
    """Draw in a 3D view, after the scene's own geometry."""
    found = _present()
    if found is None:
        return
    import gpu

    obj, own, report = found
    drawing = _current(report)
    gpu.state.blend_set("ALPHA")
    with gpu.matrix.push_pop():
        gpu.matrix.multiply_matrix(_frame(obj))
        gpu.state.depth_test_set("NONE" if session_state.is_xray(bpy.context.space_data.shading) else "LESS_EQUAL")
        shown = hides_dots(bpy.context.scene, obj, bpy.context.space_data.shading)
        if own.show_texels and not shown:
            _draw(drawing, "fine", VALID_COLOR)
        if own.show_normals and not shown:
            _draw(drawing, "normals", NORMAL_COLOR)
        gpu.state.depth_test_set("NONE")  # what follows may be inside the object
        if own.show_texels and not shown:
            _draw(drawing, "faulty", FAULTY_COLOR)
        if own.show_reach:
            _draw(drawing, "reach", REACH_COLOR)
    gpu.state.blend_set("NONE")


def hides_dots(scene, obj, shading) -> bool:
    """Return True where colours stand where the dots would: of a heat map, or of errors in measurements."""
    if obj.mode != "OBJECT":
        return False
    readings = frame_status.status_of(scene).frame
    active = obj.data.color_attributes.active_color
    errors = shading.type == "SOLID" and shading.color_type == "VERTEX" and active is not None and active.name == GAP_COLORS
    return errors or (readings is not None and obj.name in readings.sensors)


def _draw(drawing: Drawing, name: str, color) -> None:
    """Draw the triangles or lines of a name."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    is_line = name in drawing.lines
    places = drawing.lines[name] if is_line else drawing.spots[name]
    if not len(places):
        return
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR" if is_line else "UNIFORM_COLOR")
    if name not in drawing.batches:
        drawing.batches[name] = batch_for_shader(shader, "LINES" if is_line else "TRIS", {"pos": places.astype(np.float32)})
    shader.bind()
    shader.uniform_float("color", color)
    if is_line:
        shader.uniform_float("lineWidth", 1.5)
        shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    drawing.batches[name].draw(shader)


def draw_numbers() -> None:
    """Draw the labels in a 3D view, in pixels, after everything else."""
    found = _present()
    if found is None or not found[1].show_numbers:
        return
    import blf
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    obj, _, report = found
    context, frame = bpy.context, _frame(obj)
    normals = report.texels.normal @ np.array(frame.to_3x3()).T
    eye = np.array(context.region_data.view_matrix.to_3x3().transposed().col[2])
    blf.size(0, 11 * context.preferences.system.ui_scale)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 1.0)
    facing = normals @ eye > 0.1 if len(_current(report).labels) == len(normals) else None
    for i, (text, place) in enumerate(_current(report).labels):
        if facing is not None and not facing[i]:
            continue
        spot = location_3d_to_region_2d(context.region, context.region_data, frame @ Vector(place))
        if spot is not None:
            width, height = blf.dimensions(0, text)
            blf.position(0, spot.x - width / 2, spot.y - height / 2, 0)
            blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


def clear() -> None:
    """Forget what was drawn last."""
    global _drawing
    _drawing = None
