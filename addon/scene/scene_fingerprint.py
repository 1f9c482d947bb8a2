# SPDX-License-Identifier: GPL-3.0-or-later
"""Fingerprints of a scene's settings, meshes and animation, by which a change since a bake or a live run is noticed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from functools import cache, partial
from operator import attrgetter

import bpy
import numpy as np

from ...core.model.sensor_parameters import SENSOR_PARAMETERS
from ..properties import effect_stack, object_properties, parameter_properties
from ..session import fcurves, session_state, transforms
from . import deforming_objects, mesh_arrays, moved_bodies, participants, stored_names, uv_layouts

# Hash of everything that moves and deforms objects, directly or through other data-blocks.
#
# Counted are parents, constraints, modifiers, drivers and their animation. Poses and shapes are compared only at the frame that
# is shown; a change at other frames is noticed by this hash.

_POINT_PROPERTIES = ("co", "handle_left", "handle_right")
_EASING_PROPERTIES = ("easing", "back", "amplitude", "period")
"""Further properties of keyframes that an easing curve follows."""
_LAST_PLAIN_INTERPOLATION = 2
"""Interpolations with larger numbers are easing curves."""
_IGNORED_PROPERTIES = {"name", "show_expanded", "select", "active", "strip_time"}
"""Properties that do not influence motion, or that change at every frame."""


def fingerprint_of_animation(objects) -> str:
    """Return a hash of the animation of objects and of everything that they depend on, also between frames.

    Of a body that forces move only the drivers and the target of its drive count: its other keyframes are those of a bake.
    """
    digest = hashlib.blake2b(digest_size=16)
    for block in related_data_blocks(objects):
        data = getattr(block, "animation_data", None)
        if data is None:
            continue
        digest.update(b"next")  # marks the next block; its name may change
        for driver in data.drivers:
            _feed_curve(digest, driver)
            digest.update(repr(_driver(driver.driver)).encode("utf-8", "surrogatepass"))
        target = None
        if isinstance(block, bpy.types.Object) and block.palpate.body in object_properties.MOVED_BY_FORCES:
            target = moved_bodies.target_path(block)
            if target is None:
                continue
        for curve in fcurves.of_animation_data(data) or ():
            if target in (None, curve.data_path):
                _feed_curve(digest, curve)
        for track in data.nla_tracks:
            for strip in track.strips:
                curves = fcurves.of_animation_data(strip) or ()
                if target is None or any(curve.data_path == target for curve in curves):
                    _feed_strip(digest, track, strip)
    return digest.hexdigest()


def _feed_strip(digest, track, strip) -> None:
    digest.update(repr((track.mute, track.is_solo, _values(strip))).encode("utf-8", "surrogatepass"))
    for curve in (*strip.fcurves, *(fcurves.of_animation_data(strip) or ())):
        _feed_curve(digest, curve)


def related_data_blocks(objects) -> list:
    """Return objects and every data-block on which their pose and shape depend, in an order that does not change."""
    found, waiting = {}, list(objects)[::-1]
    while waiting:
        block = waiting.pop()
        if block is not None and block.session_uid not in found:
            found[block.session_uid] = block
            waiting += _references_of(block)
    return list(found.values())


def _references_of(block) -> Iterator:
    """Yield the data-blocks that a data-block refers to; some are None."""
    data = getattr(block, "animation_data", None)
    for driver in () if data is None else data.drivers:
        for variable in driver.driver.variables:
            yield from (target.id for target in variable.targets)
    if isinstance(block, bpy.types.Object):
        yield from (block.parent, block.data)
        yield from _constraint_targets(block.constraints)
        for modifier in block.modifiers:
            if modifier.name not in stored_names.MODIFIERS:
                yield from _pointers(modifier)
                yield from node_inputs(modifier)
        for bone in () if block.pose is None else block.pose.bones:
            yield from _constraint_targets(bone.constraints)
    elif isinstance(block, bpy.types.NodeTree):
        for node in block.nodes:
            yield getattr(node, "node_tree", None)
            defaults = (getattr(socket, "default_value", None) for socket in node.inputs)
            yield from (value for value in defaults if isinstance(value, bpy.types.ID))
    elif isinstance(block, bpy.types.Curve):
        yield from (block.bevel_object, block.taper_object)
    yield getattr(block, "shape_keys", None)


def _constraint_targets(constraints) -> Iterator:
    """Yield the data-blocks that constraints refer to."""
    for constraint in constraints:
        yield from _pointers(constraint)
        yield from (item.target for item in getattr(constraint, "targets", ()))


def node_inputs(modifier) -> Iterator:
    """Yield the data-blocks that are inputs of Geometry Nodes. Blender 5.2 and later has properties for inputs."""
    nodes = modifier.node_group if modifier.type == "NODES" else None
    for item in () if nodes is None else nodes.interface.items_tree:
        if getattr(item, "in_out", "") != "INPUT":
            continue
        if hasattr(modifier, "properties"):
            value = getattr(getattr(modifier.properties.inputs, item.identifier, None), "value", None)
        else:
            value = modifier.get(item.identifier)
        if isinstance(value, bpy.types.ID):
            yield value


def _pointers(item) -> Iterator:
    """Yield the data-blocks that the properties of a modifier or constraint point to."""
    yield from (getattr(item, name) for name in _pointer_names(type(item)))


@cache
def _pointer_names(kind) -> tuple[str, ...]:
    pointers = [prop for prop in kind.bl_rna.properties if prop.type == "POINTER"]
    return tuple(prop.identifier for prop in pointers if _is_block(prop.fixed_type))


def _is_block(kind) -> bool:
    while kind is not None and kind.identifier != "ID":
        kind = kind.base
    return kind is not None


def _feed_curve(digest, curve) -> None:
    digest.update(f"{curve.data_path}[{curve.array_index}]{curve.mute}{curve.extrapolation}".encode("utf-8", "surrogatepass"))
    points = curve.keyframe_points
    places, kinds = np.empty(2 * len(points), dtype=np.float32), np.empty(len(points), dtype=np.int32)
    for key in _POINT_PROPERTIES:
        points.foreach_get(key, places)
        digest.update(places.tobytes())
    points.foreach_get("interpolation", kinds)
    digest.update(kinds.tobytes())
    if (kinds > _LAST_PLAIN_INTERPOLATION).any():
        digest.update(repr([[getattr(point, key) for key in _EASING_PROPERTIES] for point in points]).encode())
    for modifier in curve.modifiers:
        digest.update(repr(_values(modifier)).encode("utf-8", "surrogatepass"))


def _driver(driver) -> tuple:
    variables = [
        (_values(item), [(t.id.name_full if t.id else "", _values(t)) for t in item.targets]) for item in driver.variables
    ]
    return driver.type, driver.expression, driver.use_self, variables


def _values(item) -> list[tuple]:
    """Return the values of the properties of a part of an animation, by name."""
    found = []
    for name in _value_names(type(item)):
        value = getattr(item, name)
        if name == "influence" and getattr(item, "use_animated_influence", False):
            continue  # its curve counts
        if isinstance(value, set):
            value = sorted(value)  # a set has no order
        found.append((name, value if isinstance(value, int | float | str | list) else tuple(value)))
    return found


@cache
def _value_names(kind) -> tuple[str, ...]:
    plain = [prop for prop in kind.bl_rna.properties if prop.type in {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}]
    given = [prop.identifier for prop in plain if not prop.is_readonly or prop.identifier == "type"]
    return tuple(name for name in given if name not in _IGNORED_PROPERTIES)


OBJECT_PROPERTIES = (
    *SENSOR_PARAMETERS,
    *(f"{key}_{part}" for key in parameter_properties.PAINTED_PARAMETERS for part in ("map", "factor")),
    *("region", "vertex_group", "threshold", "material", "face_set"),
    *moved_bodies.DRIVE_PROPERTIES,
    *uv_layouts.IMAGE_PROPERTIES,
    "role",
    "body",
    "mass",
    "contact_normals",
    "presses",
)
"""Properties of `Object.palpate` on which a run depends, besides velocities and effects."""

_mesh_fingerprints: dict[int, tuple[tuple[int, ...], str]] = {}
"""By scene: the objects whose meshes were read last, and the fingerprint of these meshes."""


def forget() -> None:
    """Forget the fingerprints of all meshes."""
    _mesh_fingerprints.clear()


def settings_of(scene, objects, name_of=attrgetter("name")) -> tuple:
    """Return all settings of a scene and of some of its objects on which a run depends, in a form that can be compared."""
    own = scene.palpate
    taking_part, hidden = participants.find_participants(scene)
    of_scene = (
        scene.frame_start,
        transforms.frames_per_second(scene),
        transforms.metres_per_unit(scene),
        tuple(transforms.gravity(scene)),
        own.use_auto_dt or own.dt,
        own.interpolation,
        own.subframes,
        tuple(hidden),
        tuple(map(name_of, taking_part)),
    )
    return of_scene + tuple(
        (
            name_of(obj),
            *(getattr(obj.palpate, key) for key in OBJECT_PROPERTIES),
            *obj.palpate.velocity,
            *obj.palpate.angular_velocity,
            *effect_stack.settings(obj),
            *object_properties.settings(obj),
        )
        for obj in objects
    )


def fingerprint(scene) -> str:
    """Return a short text that changes with settings, participants, their meshes and regions, scales, drives and animation.

    A new name alone changes no number, so objects are called as in the scene's bake. Meshes are read again only when Blender
    has reported a change of geometry, or when other objects are part of the simulation.
    """
    objects, _ = participants.find_participants(scene)
    uids = tuple(obj.session_uid for obj in objects)
    key, changed = scene.session_uid, session_state.session.changed_geometry & {obj.name for obj in objects}
    if changed or _mesh_fingerprints.get(key, ((), ""))[0] != uids:
        _mesh_fingerprints[key] = uids, _digest(*(mesh_arrays.own_fingerprint(obj) for obj in objects))
        session_state.session.changed_geometry -= changed
    name_of = partial(stored_names.name_in_bake, scene)
    settings, animation = repr(settings_of(scene, objects, name_of)), fingerprint_of_animation(objects)
    constants = (constant(obj) for obj in objects for constant in (_constant_scales, _constant_drive_target))
    return _digest(settings, _mesh_fingerprints[key][1], *constants, animation)


def _constant_scales(obj) -> str:
    """Return the scales of an object and of its parents as text, unless they are animated."""
    is_animated, found = deforming_objects.has_animated_scale(obj), []
    while obj is not None and not is_animated:
        found.append((tuple(obj.scale), tuple(obj.delta_scale)))
        obj = obj.parent
    return repr(found)


def _constant_drive_target(obj) -> str:
    """Return the target of an object's drive as text; empty without a drive, and where the target is animated."""
    path = moved_bodies.target_path(obj)
    return "" if path is None or path in fcurves.animated_paths(obj) else repr((path, obj.path_resolve(path)))


def _digest(*parts: str) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        digest.update(part.encode("utf-8", "surrogatepass"))
    return digest.hexdigest()


def pack_fingerprints(fingerprints: dict[str, list[str]]) -> str:
    """Return fingerprints of meshes, frame by frame and by object name, as text that holds only the changes."""
    changes = {
        name: [[i, one] for i, one in enumerate(found) if i == 0 or one != found[i - 1]] for name, found in fingerprints.items()
    }
    return json.dumps(changes)


def fingerprints_at(text: str, index: int) -> dict[str, str]:
    """Return the fingerprints in a packed text at a frame, counted from the first, by object name."""
    packed = stored_names.unpacked(text).items()
    return {name: next(one for start, one in reversed(changes) if start <= index) for name, changes in packed}
