# SPDX-License-Identifier: GPL-3.0-or-later
"""Live heat maps in the 3D view: drawn over the sensors while playing, and part of no file."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ..core import colormaps
from . import transforms

LIFT = 0.004
"""Share of the sensor's size by which the picture hovers above its surface, so that the two do not flicker."""
ARROW_SHARE = 1.0
"""Length of the longest arrow, in sizes of the sensor."""


@dataclass
class Picture:
    """Triangles and lines of one sensor in the world; GPU batches are made when it is first drawn.

    Attributes
    ----------
    corners : (t, 3) float32
    colors : (t, 4) float32
    line : (2, 3) float32 or None
        The net-force arrow's ends.
    """

    corners: np.ndarray
    colors: np.ndarray
    line: np.ndarray | None
    batches: list | None = None


_pictures: dict[int, list[Picture]] = {}
_largest: dict[int, dict[str, tuple[float, float]]] = {}
"""Largest normal force and net force of each sensor so far, by scene."""
_handle = None


def show(scene, run, frame) -> None:
    """Show one frame of a run."""
    settings = scene.palpate
    if bpy.app.background or not settings.show_overlay:
        clear(scene)
        return
    seen = _largest.setdefault(scene.session_uid, {})
    pictures = []
    for sensor in run.scenario.sensors:
        if sensor.readout:
            felt, pose = frame.sensors[sensor.name], frame.poses[sensor.body]
            before = seen.get(sensor.name, (1e-9, 1e-9))
            net = float(np.linalg.norm(felt.net_force))
            largest = max(before[0], float(felt.normal_force.max(initial=0.0))), max(before[1], net)
            seen[sensor.name] = largest
            maximum = largest[0] if settings.use_auto_range else settings.range_max
            pictures.append(_picture(sensor, felt, pose, maximum, largest[1], settings.color_map, run.binding.scale))
    _pictures[scene.session_uid] = pictures
    _redraw()


def _picture(sensor, felt, pose, maximum: float, strongest: float, color_map: str, scale: float) -> Picture:
    texels = sensor.texels
    rotation = transforms.rotation(pose[3:])
    size = float(np.ptp(texels.position, axis=0).max())
    points = texels.position + LIFT * size * texels.normal
    world = (pose[:3] + points @ rotation.T) / scale
    rgb = colormaps.colors(color_map, felt.normal_force / maximum)
    corner = texels.layout.triangles.ravel()
    colors = np.column_stack([rgb, np.ones(len(rgb))])[corner]
    line = None
    if felt.contact.any():
        foot = felt.centre_of_pressure
        tip = foot - felt.net_force * (ARROW_SHARE * size / strongest)
        line = (pose[:3] + np.array([foot, tip]) @ rotation.T) / scale
    return Picture(world[corner].astype(np.float32), colors.astype(np.float32), line)


def clear(scene=None) -> None:
    """Stop showing a scene, or all."""
    if scene is None:
        _pictures.clear()
        _largest.clear()
    else:
        _pictures.pop(scene.session_uid, None)
    _redraw()


def _redraw() -> None:
    if bpy.app.background:
        return
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES"}:
                area.tag_redraw()


def _draw() -> None:
    """Called by each 3D view after the scene's own geometry."""
    pictures = _pictures.get(bpy.context.scene.session_uid)
    space = bpy.context.space_data
    if not pictures or not space.overlay.show_overlays:
        return
    import gpu

    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    for picture in pictures:
        if picture.batches is None:
            picture.batches = _batches(picture)
        for shader, batch, uniforms in picture.batches:
            shader.bind()
            for name, value in uniforms.items():
                shader.uniform_float(name, value)
            batch.draw(shader)
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")


def _batches(picture: Picture) -> list:
    import gpu
    from gpu_extras.batch import batch_for_shader

    smooth = gpu.shader.from_builtin("SMOOTH_COLOR")
    result = [(smooth, batch_for_shader(smooth, "TRIS", {"pos": picture.corners, "color": picture.colors}), {})]
    if picture.line is not None:
        lines = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        viewport = gpu.state.viewport_get()[2:]
        uniforms = {"color": (1.0, 0.35, 0.05, 1.0), "lineWidth": 4.0, "viewportSize": viewport}
        result.append((lines, batch_for_shader(lines, "LINES", {"pos": picture.line.astype(np.float32)}), uniforms))
    return result


def register() -> None:
    global _handle
    if not bpy.app.background:
        _handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def unregister() -> None:
    global _handle
    clear()
    if _handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
        _handle = None
