# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera and light for one picture, where a scene has none of its own or another view is wanted; taken away again."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Euler, Vector

from ...core.errors import ParameterError
from ..display import materials
from . import render

ENGINES = {"cycles": ("CYCLES",), "eevee": ("BLENDER_EEVEE_NEXT", "BLENDER_EEVEE"), "workbench": ("BLENDER_WORKBENCH",)}
"""Words for engines → their names, which changed with Blender's versions."""
DEFAULT_VIEW = (-55.0, 30.0)
"""Azimuth, from +x towards +y, and elevation, degrees, from which a scene without a camera is looked at."""
MARGIN = 0.06
"""Of the picture's width and height, left free around what is framed."""
_BACKDROP_SIZE_RATIO = 3.0
"""Sizes of what is seen from which on an object that takes no part is a backdrop."""
_MAX_FRAMED_FRAMES = 60
"""Frames at which a camera's view is made sure of."""
_LAMPS = (((-35.0, 50.0), 3.2, (1.0, 0.97, 0.93)), ((70.0, 30.0), 1.2, (0.9, 0.95, 1.0)), ((170.0, 45.0), 2.0, (1.0, 1.0, 1.0)))
"""Suns: azimuth from the camera's and elevation, degrees; strength; colour."""


def engine_of(scene, name: str) -> str:
    """Return this Blender's name of an engine.

    Raises
    ------
    ParameterError
        There is none of that name.
    """
    before = scene.render.engine
    for candidate in ENGINES[name]:
        try:
            scene.render.engine = candidate
        except TypeError:  # the list of engines is made on request, and only this asks for it
            continue
        scene.render.engine = before
        return candidate
    raise ParameterError(f"This Blender has no engine '{name}': choose from {', '.join(ENGINES)}.")


def subjects(scene) -> list:
    """Return what a picture should show: sensors, pads, targets and their children, arrows and markers."""
    taking_part = {obj for obj in scene.objects if obj.palpate.role != "NONE" or materials.SENSOR_KEY in obj}
    return [obj for obj in scene.objects if _shows(obj) and (obj in taking_part or taking_part & set(_above(obj)))]


def _above(obj) -> Iterator:
    while obj.parent is not None:
        obj = obj.parent
        yield obj


def _shows(obj) -> bool:
    return obj.type in {"MESH", "CURVE", "SURFACE", "META", "FONT"} and not obj.hide_render and obj.visible_get()


@contextmanager
def render_setup(
    scene, frames, *, engine: str | None = None, view=None, transparent: bool = False, frame: bool = True, size=None
):
    """Prepare a scene for pictures, and put everything back.

    Parameters
    ----------
    frames : sequence of int
        At which all that matters has to be in the picture.
    engine : {"cycles", "eevee", "workbench"}, optional
        Default: the scene's.
    view : (2,) float, degrees, optional
        Azimuth and elevation of the camera. Default: the direction of the scene's camera, or :data:`DEFAULT_VIEW`.
    transparent : bool
        No background: no world, and no floor or backdrop that reaches far beyond everything else.
    frame : bool
        False leaves the scene's own camera where it is.
    size : (2,) int, pixels, optional
        Of the pictures. Default: the scene's.
    """
    made, changes = [], []

    def change(owner, name, value):
        changes.append((owner, name, getattr(owner, name)))
        setattr(owner, name, value)

    now = scene.frame_current, scene.frame_subframe
    try:
        if engine is not None:
            change(scene.render, "engine", engine_of(scene, engine))
        if size is not None:
            change(scene.render, "resolution_x", int(size[0]))
            change(scene.render, "resolution_y", int(size[1]))
        if transparent:
            change(scene.render, "film_transparent", True)
            for obj in _backdrops(scene):
                change(obj, "hide_render", True)
        own = scene.camera if scene.camera is not None and scene.camera.data.type == "PERSP" else None
        if own is None or view is not None or frame:
            camera = _camera(scene, own, view)
            made.append(camera)
            change(scene, "camera", camera)
            render.fit_camera(scene, _corners(scene, frames), (MARGIN, MARGIN, 1 - MARGIN, 1 - MARGIN))
            _clip(scene, camera)
        if not any(obj.type == "LIGHT" and not obj.hide_render for obj in scene.objects):
            made += _lamps(scene, scene.camera)
            if scene.world is None or not transparent and _is_dark(scene.world):
                world = _world()
                change(scene, "world", world)
                made.append(world)
        if scene.render.engine == "BLENDER_WORKBENCH":
            shading = scene.display.shading
            change(shading, "light", "FLAT")  # in a lamp's shade a heat map would not have the colours of its bar
            change(shading, "color_type", "VERTEX")
            change(shading, "show_cavity", True)
            change(shading, "cavity_type", "BOTH")
            change(shading, "show_object_outline", True)
            change(scene.display, "render_aa", "16")
        if scene.view_settings.view_transform != "Standard":  # a heat map must have the colours of its colour bar
            change(scene.view_settings, "view_transform", "Standard")
        yield
    finally:
        for owner, name, value in reversed(changes):
            setattr(owner, name, value)
        for block in made:
            _drop(block)
        scene.frame_set(now[0], subframe=now[1])


def _backdrops(scene) -> list:
    """Return what is only there to be in front of: it takes no part, carries nothing, and is far larger than what does."""
    seen = subjects(scene)
    carriers = {above for obj in seen for above in _above(obj)}
    size = float(np.linalg.norm(np.ptp(render.bounding_box_corners(seen), axis=0))) if seen else 0.0
    others = [obj for obj in scene.objects if _shows(obj) and obj not in seen and obj not in carriers]
    return [
        obj
        for obj in others
        if np.linalg.norm(np.ptp(render.bounding_box_corners([obj]), axis=0)) > _BACKDROP_SIZE_RATIO * size
    ]


def _camera(scene, own, view):
    camera = bpy.data.objects.new("Palpate Camera", bpy.data.cameras.new("Palpate Camera"))
    scene.collection.objects.link(camera)
    if own is not None:
        camera.data.lens, camera.data.sensor_width = own.data.lens, own.data.sensor_width
    else:
        camera.data.lens = 70.0
    if own is not None and view is None:
        turn = own.matrix_world.to_euler()
    else:
        azimuth, elevation = (math.radians(angle) for angle in (view or DEFAULT_VIEW))
        turn = Euler((math.pi / 2 - elevation, 0.0, azimuth + math.pi / 2))
    camera.rotation_euler = turn
    bpy.context.view_layer.update()
    return camera


def _corners(scene, frames) -> np.ndarray:
    """Corners of all that matters at some frames; of many, at enough of them that an arrow's longest is not missed by much."""
    places = np.linspace(0, len(frames) - 1, min(len(frames), _MAX_FRAMED_FRAMES)).round().astype(int)
    chosen = sorted({int(frames[place]) for place in places})
    found = []
    for number in chosen:
        scene.frame_set(number)
        found.append(render.bounding_box_corners(subjects(scene)))
    return np.concatenate(found)


def _clip(scene, camera) -> None:
    distance = max((camera.matrix_world.translation - obj.matrix_world.translation).length for obj in subjects(scene))
    camera.data.clip_start, camera.data.clip_end = 0.005 * distance, 20.0 * distance


def _lamps(scene, camera) -> list:
    back = camera.matrix_world.to_3x3() @ Vector((0.0, 0.0, 1.0))
    heading = math.atan2(back.y, back.x)
    made = []
    for (azimuth, elevation), strength, color in _LAMPS:
        lamp = bpy.data.lights.new("Palpate Light", "SUN")
        lamp.energy, lamp.color, lamp.angle = strength, color, math.radians(15.0)
        obj = bpy.data.objects.new("Palpate Light", lamp)
        scene.collection.objects.link(obj)
        obj.rotation_euler = (math.pi / 2 - math.radians(elevation), 0.0, heading + math.radians(azimuth) + math.pi / 2)
        made.append(obj)
    return made


def _is_dark(world) -> bool:
    """Whether a world is the plain one of a new file, which is nearly black."""
    tree = world.node_tree
    if tree is None:
        return max(world.color) < 0.1
    nodes = [node for node in tree.nodes if node.type == "BACKGROUND"]
    return len(nodes) == 1 and not nodes[0].inputs["Color"].is_linked and max(nodes[0].inputs["Color"].default_value[:3]) < 0.1


def _world():
    world = bpy.data.worlds.new("Palpate World")
    if world.node_tree is None:
        world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.86, 0.88, 0.92, 1.0)
    background.inputs["Strength"].default_value = 0.7
    return world


def _drop(block) -> None:
    if isinstance(block, bpy.types.World):
        bpy.data.worlds.remove(block)
        return
    data = block.data
    bpy.data.objects.remove(block)
    (bpy.data.cameras if isinstance(data, bpy.types.Camera) else bpy.data.lights).remove(data)
