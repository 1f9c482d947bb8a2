# SPDX-License-Identifier: GPL-3.0-or-later
"""Does a bake still show what the scene would give now? Looked at, cheaply, whenever a frame of it is shown.

Compared are: settings, participants, scales and the animation of everything they depend on (:mod:`.animation_fingerprint`); the
poses of keyframed bodies and the shapes of deforming objects and curves against the recording of the frame that is shown; and,
when Blender has reported a change of geometry, the objects' own meshes and regions.
"""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache

import numpy as np

from ...core.errors import PalpateError
from ...core.model.recording import Recording
from ..scene import animation_fingerprint, deforming_objects, meshes, moved_bodies, scene_reader
from ..session import clock, session_state
from . import live_cache

SAME_POSE = 1e-6
"""Metres, and components of a quaternion, by which a recorded pose may differ: an evaluated matrix has 32 bits."""

_geometry: dict[int, str] = {}
"""Last fingerprint of the meshes, by scene."""


def forget() -> None:
    """Look at every mesh anew."""
    _geometry.clear()


def fingerprint(scene) -> str:
    """Return a short text that changes when settings, meshes or regions do."""
    objects, _ = scene_reader.participants(scene)
    names = {obj.name for obj in objects}
    key, changed = scene.session_uid, session_state.session.changed_geometry & names
    if key not in _geometry or changed:
        _geometry[key] = _digest(*(meshes.own_fingerprint(obj) for obj in objects))
        session_state.session.changed_geometry -= changed
    scales = map(_scales, objects)
    return _digest(repr(live_cache.settings_of(scene, objects)), _geometry[key], *scales, animation_fingerprint.motion(objects))


def _scales(obj) -> str:
    """Return the scales of an object and of what carries it, where they are constant."""
    scaled, found = deforming_objects.has_animated_scale(obj), []
    while obj is not None and not scaled:
        found.append((tuple(obj.scale), tuple(obj.delta_scale)))
        obj = obj.parent
    return repr(found)


def pack(looks: dict[str, list[str]]) -> str:
    """Return fingerprints, frame by frame, as text: of each object only where they change."""
    changes = {
        name: [[i, look] for i, look in enumerate(found) if i == 0 or look != found[i - 1]] for name, found in looks.items()
    }
    return json.dumps(changes)


@lru_cache(maxsize=8)
def _unpacked(text: str) -> dict[str, list]:
    return json.loads(text) if text else {}


def _reshaped(scene, depsgraph) -> bool:
    """Whether something that may deform looks different from what it looked like when this frame was baked."""
    number, share = clock.moment(scene)
    index = number - scene.palpate.baked_start
    if share or not 0 <= index <= scene.palpate.baked_end - scene.palpate.baked_start:
        return False
    for name, changes in _unpacked(scene.palpate.baked_shapes).items():
        obj = scene.objects.get(name)
        then = next(look for i, look in reversed(changes) if i <= index)
        if obj is None or obj.type not in meshes.KINDS:
            return True
        try:
            if meshes.fingerprint(obj, depsgraph) != then:
                return True
        except PalpateError:
            return True
    return False


def _digest(*parts: str) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        digest.update(part.encode("utf-8", "surrogatepass"))
    return digest.hexdigest()


def is_stale(scene, depsgraph, recording: Recording | None) -> bool:
    """Whether something that the scene's bake was computed from is different now.

    Parameters
    ----------
    depsgraph : Depsgraph
        Of the scene's present frame.
    recording : Recording or None
        Of the bake, when it can be read.
    """
    if fingerprint(scene) != scene.palpate.baked_fingerprint or _reshaped(scene, depsgraph):
        return True
    return recording is not None and _moved(scene, depsgraph, recording)


def _moved(scene, depsgraph, recording: Recording) -> bool:
    number, share = clock.moment(scene)
    if number not in recording.frames or share:
        return False
    poses = recording.poses[int(np.searchsorted(recording.frames, number))]
    for name, pose in zip(recording.body_names, poses, strict=True):
        obj = scene.objects.get(name)
        if obj is None:
            return True
        if obj.palpate.body in moved_bodies.MOVED:
            continue
        try:
            now = scene_reader.pose(scene, obj, depsgraph)
        except PalpateError:
            return True
        if np.abs(now[:3] - pose[:3]).max() > SAME_POSE:
            return True
        if min(np.abs(now[3:] - sign * pose[3:]).max() for sign in (1.0, -1.0)) > SAME_POSE:
            return True
    return False
