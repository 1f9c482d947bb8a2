# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera, light and settings for pictures of a scene, for scenes without a camera or light and for other views."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Euler, Vector

from ...core.errors import ParameterError
from ..display import materials
from ..session import fcurves
from . import camera_direction, render, studio
from .loaded_texels import LoadedTexels

ENGINES = {"cycles": ("CYCLES",), "eevee": ("BLENDER_EEVEE_NEXT", "BLENDER_EEVEE"), "workbench": ("BLENDER_WORKBENCH",)}
"""Engines by the name that users give; Blender's own names depend on its version."""
DEFAULT_VIEW = (-55.0, 30.0)
"""Azimuth (from +x towards +y) and elevation of the camera, degrees, for a scene without a camera."""
MARGIN = 0.06
"""Free margin around the subjects, as a share of the picture's width and height."""
_BACKDROP_SIZE_RATIO = 3.0
"""An object outside the simulation is a backdrop if it is larger than the subjects by this factor."""
_MAX_FRAMED_FRAMES = 60
"""Number of frames, at most, at which the subjects are measured for the camera."""
NEARBY_RATIO = 2.0
"""An object outside the simulation that touches the subjects, as a gripper's housing, is framed up to this ratio of sizes."""
NEARBY = 0.05
"""Distance at which an object counts as touching, as a share of the subjects' size."""
MOST_ROOM = 1.25
"""How much farther the camera stands, at most, to have what surrounds sensors and targets in the picture. What would make them
smaller than that, as the housing of a gripper, is cropped. Chosen by eye."""
_HALVINGS = 12
"""Steps of the search for how much is cropped: to 1 / 4,096 of what surrounds."""


def engine_of(scene, name: str) -> str:
    """Return this Blender's name of an engine.

    Raises
    ------
    ParameterError
        This Blender has no such engine.
    """
    before = scene.render.engine
    for candidate in ENGINES[name]:
        try:
            scene.render.engine = candidate
        except TypeError:  # the names of the engines can only be found by trying
            continue
        scene.render.engine = before
        return candidate
    raise ParameterError(f"This Blender has no engine '{name}': choose from {', '.join(ENGINES)}.")


def subjects(scene) -> list:
    """Return the objects that a picture should show: sensors, pads, targets, their children, arrows and markers."""
    taking_part = {obj for obj in scene.objects if obj.palpate.role != "NONE" or materials.SENSOR_KEY in obj}
    return [
        obj for obj in scene.objects if render.is_rendered(obj) and (obj in taking_part or taking_part & set(_ancestors(obj)))
    ]


def _ancestors(obj) -> Iterator:
    while obj.parent is not None:
        obj = obj.parent
        yield obj


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """How pictures of a scene are to be taken.

    Attributes
    ----------
    engine : {"cycles", "eevee", "workbench"}, optional
        Default: the scene's.
    view : (2,) float, degrees, optional
        Azimuth and elevation of the camera. Default: the direction of the scene's camera, or :data:`DEFAULT_VIEW`, unless
        another one shows more of the loaded texels.
    transparent : bool
        No background: no world, and no floor or backdrop that is much larger than everything else.
    own_camera : bool
        The scene's camera stays where it is.
    own_light : bool
        The scene's lamps, world and backdrop count; only a scene without lamps gets some. Default: studio light.
    see_through : bool
        Targets will be see-through where they cover loaded texels.
    size : (2,) int, pixels, optional
        Width and height of the pictures. Default: the scene's.
    """

    engine: str | None = None
    view: tuple[float, float] | None = None
    transparent: bool = False
    own_camera: bool = False
    own_light: bool = False
    see_through: bool = False
    size: tuple[int, int] | None = None


@contextmanager
def render_setup(
    scene, frames: Sequence[int], options: RenderOptions, loaded: Mapping[int, LoadedTexels] | None = None
) -> Iterator[None]:
    """Prepare a scene for pictures, and restore it afterwards.

    Parameters
    ----------
    scene : Scene
    frames : sequence of int
        At all these frames the :func:`subjects` have to be in the picture.
    options : RenderOptions
    loaded : mapping of int to LoadedTexels, optional
        Loaded texels at some of the frames, which the camera is turned to.
    """
    with fcurves.frame_kept(scene), render.TemporaryChanges() as changes:
        _set_output(scene, options, changes)
        _set_colors(scene, changes)
        _set_camera(scene, frames, options, loaded or {}, changes)
        _set_lights(scene, frames, options, changes)
        if scene.render.engine == "BLENDER_WORKBENCH":
            _set_workbench(scene, changes)
        yield


def _set_colors(scene, changes: render.TemporaryChanges) -> None:
    """Show colours as they are: everything else would make a heat map differ from its colour bar."""
    view = scene.view_settings
    for name, value in (("view_transform", "Standard"), ("look", "None"), ("exposure", 0.0), ("gamma", 1.0)):
        if getattr(view, name) != value:
            changes.set(view, **{name: value})
    changes.set(view, use_curve_mapping=False)
    changes.set(scene.render, use_compositing=False, use_sequencer=False)


def _set_output(scene, options: RenderOptions, changes: render.TemporaryChanges) -> None:
    """Set engine, size and background."""
    if options.engine is not None:
        changes.set(scene.render, engine=engine_of(scene, options.engine))
    if options.size is not None:
        changes.set(scene.render, resolution_x=int(options.size[0]), resolution_y=int(options.size[1]))
    if options.transparent:
        changes.set(scene.render, film_transparent=True)
        for obj in _backdrops(scene):
            changes.set(obj, hide_render=True)
    if scene.render.engine == "CYCLES":
        changes.set(scene.cycles, use_denoising=True)


def _set_camera(scene, frames: Sequence[int], options: RenderOptions, loaded, changes: render.TemporaryChanges) -> None:
    """Add a camera that frames the subjects, unless the scene's own is to stay."""
    own = scene.camera if scene.camera is not None and scene.camera.data.type == "PERSP" else None
    if own is not None and options.view is None and options.own_camera:
        return
    view = options.view
    corners, surroundings = _corners(scene, frames)
    if view is None:
        towards = DEFAULT_VIEW if own is None else camera_direction.view_of(own.matrix_world.to_3x3() @ Vector((0.0, 0.0, 1.0)))
        view = camera_direction.best_view(scene, loaded, towards, options.see_through, corners)
    camera = changes.add(_camera(scene, own, view))
    changes.set(scene, camera=camera)
    _frame(scene, corners, surroundings)
    farthest = max((camera.matrix_world.translation - obj.matrix_world.translation).length for obj in subjects(scene))
    camera.data.clip_start, camera.data.clip_end = 0.005 * farthest, 20.0 * farthest


def _frame(scene, corners: np.ndarray, surroundings: np.ndarray) -> None:
    """Move the camera so that it shows points, and of other points around them as much as :data:`MOST_ROOM` leaves room for.

    Parameters
    ----------
    corners, surroundings : (n, 3) and (m, 3) float, Blender units, world
    """
    region = (MARGIN, MARGIN, 1 - MARGIN, 1 - MARGIN)
    middle = corners.mean(axis=0)
    nearest = np.clip(surroundings, corners.min(axis=0), corners.max(axis=0))

    def distance(share: float) -> float:
        """Frame this share of the way from the subjects' box to the points around; return the camera's distance."""
        render.fit_camera(scene, np.concatenate([corners, nearest + share * (surroundings - nearest)]), region)
        matrix = np.array(scene.camera.matrix_world)
        return float((matrix[:3, 3] - middle) @ matrix[:3, 2])

    most = MOST_ROOM * distance(0.0)
    if distance(1.0) <= most:
        return
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        low, high = (share, high) if distance(share) <= most else (low, share)
    distance(low)


def _set_lights(scene, frames: Sequence[int], options: RenderOptions, changes: render.TemporaryChanges) -> None:
    """Set studio light; where the scene's own light counts, add lamps and a bright world to a scene without light."""
    if not options.own_light:
        scene.frame_set(frames[-1])
        box = _box(_in_picture(scene))
        bottom = np.array([*(0.5 * (box[0] + box[1]))[:2], box[0, 2], _size(box)])
        studio.set_studio(scene, changes, _backdrops(scene), frames[-1], bottom, options.transparent)
        return
    if any(obj.type == "LIGHT" and not obj.hide_render for obj in scene.objects):
        return
    studio.add_lamps(scene, changes)
    if scene.world is None or not options.transparent and _is_dark(scene.world):
        changes.set(scene, world=changes.add(studio.bright_world()))


def _set_workbench(scene, changes: render.TemporaryChanges) -> None:
    """Let Workbench show the colours of the vertices, unshaded."""
    shading = scene.display.shading
    changes.set(shading, light="FLAT", color_type="VERTEX")  # light would make a heat map darker than its colour bar
    changes.set(shading, show_cavity=True, cavity_type="BOTH", show_object_outline=True)
    changes.set(scene.display, render_aa="16")


def _in_picture(scene) -> list:
    """Return the subjects and objects in contact with them, such as the housing of a gripper, unless they are much larger."""
    seen = subjects(scene)
    if not seen:
        return seen
    around = _box(seen)
    others = {obj: _box([obj]) for obj in scene.objects if render.is_rendered(obj) and obj not in seen}
    small = {obj: box for obj, box in others.items() if _size(box) <= NEARBY_RATIO * _size(around)}
    touching = {obj for obj, box in small.items() if _touch(box, around)}
    return [*seen, *(obj for obj in small if obj in touching or touching & set(_ancestors(obj)))]


def _box(objects) -> np.ndarray:
    """Return the lower and the upper corner of the bounding box of objects, (2, 3), world."""
    corners = render.bounding_box_corners(objects)
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def _size(box: np.ndarray) -> float:
    return float(np.linalg.norm(box[1] - box[0]))


def _touch(box: np.ndarray, around: np.ndarray) -> bool:
    """Return True for a box that is not away from another one by more than :data:`NEARBY`."""
    room = NEARBY * _size(around)
    return bool((box[0] <= around[1] + room).all() and (box[1] >= around[0] - room).all())


def _backdrops(scene) -> list:
    """Return floors and backdrops: objects outside the simulation, without subjects on them and far larger than these."""
    seen = subjects(scene)
    carriers = {ancestor for obj in seen for ancestor in _ancestors(obj)}
    size = _size(_box(seen)) if seen else 0.0
    others = [obj for obj in scene.objects if render.is_rendered(obj) and obj not in seen and obj not in carriers]
    return [obj for obj in others if _size(_box([obj])) > _BACKDROP_SIZE_RATIO * size]


def _camera(scene, own, view):
    """Add a camera in the given direction, else in that of the scene's `own` camera, else in the default direction."""
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


def _corners(scene, frames) -> tuple[np.ndarray, np.ndarray]:
    """Return corners of the bounding boxes of sensors, targets and markers, and of what surrounds them: (n, 3) and (m, 3).

    They are those of all frames; of many frames, of evenly spaced ones.
    """
    places = np.linspace(0, len(frames) - 1, min(len(frames), _MAX_FRAMED_FRAMES)).round().astype(int)
    chosen = sorted({int(frames[place]) for place in places})
    found, around = [], [np.zeros((0, 3))]
    for number in chosen:
        scene.frame_set(number)
        seen = _in_picture(scene)
        central = [obj for obj in seen if _is_central(obj)] or seen
        found.append(render.bounding_box_corners(central))
        middle = np.array([found[-1].min(axis=0), found[-1].max(axis=0)])
        # without pads that are away, as a table that sinks away
        others = [obj for obj in seen if obj not in central and (obj.palpate.role != "PAD" or _touch(_box([obj]), middle))]
        around += [render.bounding_box_corners(others)] if others else []
    return np.concatenate(found), np.concatenate(around)


def _is_central(obj) -> bool:
    """Return True for sensors, targets with what hangs on them, and arrows and markers of a bake."""
    hangs_on_target = any(parent.palpate.role == "TARGET" for parent in _ancestors(obj))
    return (
        obj.palpate.role in {"SENSOR", "TARGET"}
        or materials.SENSOR_KEY in obj
        or (obj.palpate.role == "NONE" and hangs_on_target)
    )


def _is_dark(world) -> bool:
    """Return True for the plain, nearly black world of a new file."""
    tree = world.node_tree
    if tree is None:
        return max(world.color) < 0.1
    nodes = [node for node in tree.nodes if node.type == "BACKGROUND"]
    return len(nodes) == 1 and not nodes[0].inputs["Color"].is_linked and max(nodes[0].inputs["Color"].default_value[:3]) < 0.1
