# SPDX-License-Identifier: GPL-3.0-or-later
"""Read and write the F-curves of an object, in Blender versions with action slots (4.4 and later) and without."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import bpy
import numpy as np

LINEAR = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items["LINEAR"].value


def of_object(obj):
    """Return the F-curves of an object; None when it has no action."""
    return of_animation_data(obj.animation_data)


def of_animation_data(data):
    """Return the F-curves of the action that animation data or an NLA strip plays; None when there is no action."""
    if data is None or data.action is None:
        return None
    if not hasattr(data.action, "slots"):
        return data.action.fcurves
    bag = _channelbag(data, ensure=False)
    return None if bag is None else bag.fcurves


def ensure(obj, action_name: str) -> tuple[object, bool]:
    """Return the F-curves of an object, and True when an action was created for them."""
    data = obj.animation_data or obj.animation_data_create()
    is_new = data.action is None
    if is_new:
        data.action = bpy.data.actions.new(action_name)
    if not hasattr(data.action, "slots"):
        return data.action.fcurves, is_new
    if data.action_slot is None:
        data.action_slot = data.action.slots.new(id_type="OBJECT", name=obj.name)
    return _channelbag(data, ensure=True).fcurves, is_new


def _channelbag(data, ensure: bool):
    """Return the channels of the slot that animation data plays; they are created if `ensure` is set."""
    action, slot = data.action, data.action_slot
    if slot is None:
        return None
    for layer in action.layers:
        for strip in layer.strips:
            return strip.channelbag(slot, ensure=ensure)
    if not ensure:
        return None
    layer = action.layers[0] if len(action.layers) else action.layers.new("Layer")
    return layer.strips.new(type="KEYFRAME").channelbag(slot, ensure=True)


def write(curves, path: str, frames: np.ndarray, values: np.ndarray) -> None:
    """Replace the F-curves of a property by curves that are linear between keyframes.

    Parameters
    ----------
    curves : collection from :func:`ensure`
    path : str
    frames : (f,) int
    values : (f, c) float
        Column i is written to the curve with array index i.
    """
    remove(curves, (path,))
    for index, column in enumerate(np.asarray(values, float).T):
        curve = curves.new(path, index=index)
        curve.keyframe_points.add(len(frames))
        points = np.column_stack([frames, column]).astype(np.float32)
        curve.keyframe_points.foreach_set("co", points.ravel())
        curve.keyframe_points.foreach_set("interpolation", np.full(len(frames), LINEAR, dtype=np.int32))
        curve.update()


def remove(curves, paths) -> None:
    """Remove the F-curves of the properties in `paths`."""
    for curve in [curve for curve in curves if curve.data_path in paths]:
        curves.remove(curve)


def has_other_values(block, time: float) -> bool:
    """Return True when a property of a data-block was set to another value than its F-curve has, and not keyframed.

    Blender puts it back as soon as another frame is shown.
    """
    for curve in of_animation_data(getattr(block, "animation_data", None)) or ():
        try:
            value = block.path_resolve(curve.data_path)
        except ValueError:
            continue  # a curve of something that is gone
        value = value[curve.array_index] if hasattr(value, "__len__") else value
        expected = curve.evaluate(time)
        if not curve.mute and isinstance(value, float) and abs(value - expected) > 1e-6 * max(1.0, abs(expected)):
            return True
    return False


def animated_paths(block) -> set[str]:
    """Return the data paths of the properties of a data-block that keyframes, drivers or NLA strips animate."""
    return {curve.data_path for curve in curves_of(block)}


def curves_of(block) -> list:
    """Return all F-curves that animate properties of a data-block: of its action, its drivers and evaluated NLA strips."""
    data = block.animation_data
    if data is None:
        return []
    players = [data, *_evaluated_strips(data)]
    return [*data.drivers, *(curve for player in players for curve in of_animation_data(player) or ())]


def _evaluated_strips(data) -> list:
    """Return the NLA strips that Blender evaluates: of a solo track, even if it is muted, or else of all that are not muted."""
    tracks = [*data.nla_tracks] if data.use_nla else []
    evaluated = [track for track in tracks if track.is_solo] or [track for track in tracks if not track.mute]
    return [strip for track in evaluated for strip in _strips_in(track)]


def _strips_in(container) -> Iterator:
    """Yield the strips of a track, or of a meta strip, that are not muted."""
    for strip in container.strips:
        if not strip.mute:
            yield strip
            yield from _strips_in(strip)


# The frame of the animation at which a scene stands. Keyframes, images and computed frames are counted in these frames.
#
# Blender's Time Stretching (Output › Frame Range) makes the timeline run slower or faster than the animation. It changes how
# long a bake is watched, not what is baked. Palpate therefore computes without it and shows results by the animation's time.

WHOLE_FRAME_TOLERANCE = 1e-4
"""A time that is nearer than this many frames to a whole frame counts as that frame."""


def current_frame(scene) -> tuple[int, float]:
    """Return the last whole frame of the animation that a scene has reached, and the part of the next one, 0 to 1."""
    passing = scene.render.frame_map_old / scene.render.frame_map_new  # frames of the animation in one of the timeline
    time = (scene.frame_current + scene.frame_subframe) * passing
    number = math.floor(time + WHOLE_FRAME_TOLERANCE)
    part = time - number
    return number, part if part > WHOLE_FRAME_TOLERANCE else 0.0


@contextmanager
def frame_kept(scene, unless: Callable[[], bool] = lambda: False) -> Iterator[None]:
    """Let the scene stand at other frames inside the ``with`` block, and return to the present one `unless` it is taken."""
    before = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        with suppress(ReferenceError):  # the scene was deleted meanwhile
            if not unless():
                scene.frame_set(before[0], subframe=before[1])


@contextmanager
def without_time_stretching(scene) -> Iterator[None]:
    """Make frames of the timeline equal to frames of the animation while the context is open."""
    render = scene.render
    before = render.frame_map_old, render.frame_map_new
    try:
        if before[0] != before[1]:
            render.frame_map_old = render.frame_map_new = 100
        yield
    finally:
        with suppress(ReferenceError):  # the scene was deleted meanwhile
            if before[0] != before[1]:
                render.frame_map_old, render.frame_map_new = before
