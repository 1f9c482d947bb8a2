# SPDX-License-Identifier: GPL-3.0-or-later
"""Fingerprints of a scene's settings, meshes and animation, by which a change since a bake or a live run is noticed."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache, partial
from operator import attrgetter

from ...core.model.sensor_parameters import SENSOR_PARAMETERS
from ..properties import effect_stack, magnetic_properties, painted_maps
from ..session import session_state, units
from . import animation_fingerprint, baked_names, deforming_objects, drives, mesh_fingerprint, participants, uv_layouts

OBJECT_PROPERTIES = (
    *SENSOR_PARAMETERS,
    *(f"{key}_{part}" for key in painted_maps.PAINTED_PARAMETERS for part in ("map", "factor")),
    *("region", "vertex_group", "threshold", "material", "face_set"),
    *drives.DRIVE_PROPERTIES,
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
        units.frames_per_second(scene),
        units.metres_per_unit(scene),
        tuple(units.gravity(scene)),
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
            *magnetic_properties.settings(obj),
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
        _mesh_fingerprints[key] = uids, _digest(*(mesh_fingerprint.own_fingerprint(obj) for obj in objects))
        session_state.session.changed_geometry -= changed
    name_of = partial(baked_names.name_in_bake, scene)
    settings, animation = repr(settings_of(scene, objects, name_of)), animation_fingerprint.fingerprint(objects)
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
    path = drives.target_path(obj)
    return "" if path is None or path in animation_fingerprint.animated_paths(obj) else repr((path, obj.path_resolve(path)))


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


@lru_cache(maxsize=8)
def _unpacked(text: str) -> dict[str, list]:
    return json.loads(text) if text else {}


def fingerprints_at(text: str, index: int) -> dict[str, str]:
    """Return the fingerprints in a packed text at a frame, counted from the first, by object name."""
    return {name: next(one for start, one in reversed(changes) if start <= index) for name, changes in _unpacked(text).items()}
