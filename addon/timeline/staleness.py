# SPDX-License-Identifier: GPL-3.0-or-later
"""Does a bake still show what the scene would give now? Checked whenever a frame of the bake is shown, so it must be fast.

Three things are compared: the fingerprint of the scene (:mod:`.scene_fingerprint`), the poses of keyframed bodies with the
recording of the frame that is shown, and the shapes of deforming objects and curves with their fingerprints at that frame.
"""

from __future__ import annotations

import numpy as np

from ...core.errors import PalpateError
from ...core.io.bake_folder import UNCHANGED_NOTE
from ...core.model.recording import Recording
from ..properties import object_properties
from ..scene import mesh_arrays, moved_bodies, participants, scene_fingerprint, stored_names
from ..session import fcurves, transforms

SAME_POSE = 1e-6
"""Share of the largest length in a pose, and components of a quaternion, by which a recorded pose may differ: an evaluated
matrix has 32 bits."""


def is_stale(scene, depsgraph, recording: Recording | None) -> bool:
    """Return True when something from which the scene's bake was computed is different now.

    Parameters
    ----------
    scene : Scene
    depsgraph : Depsgraph
        Of the scene's present frame.
    recording : Recording or None
        Of the bake, when it can be read.
    """
    if scene_fingerprint.fingerprint(scene) != scene.palpate.baked_fingerprint or _has_deformed(scene, depsgraph):
        return True
    return recording is not None and _has_moved(scene, depsgraph, recording)


def note_unchanged(scene) -> None:
    """Note in a scene that is about to be saved whether it is as it was baked, for readers without Blender."""
    settings, note = scene.palpate, ""
    if settings.baked_id and scene_fingerprint.fingerprint(scene) == settings.baked_fingerprint:
        note = UNCHANGED_NOTE + settings.baked_id
    if settings.unchanged_note != note:
        settings.unchanged_note = note


def _has_deformed(scene, depsgraph) -> bool:
    """Return True when a mesh that may deform differs from the mesh that was baked at this frame."""
    number, part = fcurves.current_frame(scene)
    index = number - scene.palpate.baked_start
    if part or not 0 <= index <= scene.palpate.baked_end - scene.palpate.baked_start:
        return False
    fingerprints = scene_fingerprint.fingerprints_at(scene.palpate.baked_shapes, index)
    objects = stored_names.objects_of_bake(scene, fingerprints)
    for name, baked in fingerprints.items():
        obj = objects.get(name)
        if obj is None or obj.type not in participants.OBJECT_TYPES:
            return True
        try:
            if mesh_arrays.evaluated_fingerprint(obj, depsgraph) != baked:
                return True
        except PalpateError:
            return True
    return False


def _has_moved(scene, depsgraph, recording: Recording) -> bool:
    """Return True when a keyframed body is not where the recording has it at this frame."""
    number, part = fcurves.current_frame(scene)
    if number not in recording.frames or part:
        return False
    poses = recording.poses[int(np.searchsorted(recording.frames, number))]
    extent = float(np.abs(poses[:, :3]).max(initial=0.0))
    objects = stored_names.objects_of_bake(scene, recording.body_names)
    for name, pose in zip(recording.body_names, poses, strict=True):
        obj = objects.get(name)
        if obj is None:
            return True
        if obj.palpate.body in object_properties.MOVED_BY_FORCES:
            continue
        try:
            now = moved_bodies.body_pose(scene, obj, depsgraph)
        except PalpateError:
            return True
        size = max(extent, transforms.metres_per_unit(scene) * max(obj.dimensions))
        if np.abs(now[:3] - pose[:3]).max() > SAME_POSE * size:
            return True
        if min(np.abs(now[3:] - sign * pose[3:]).max() for sign in (1.0, -1.0)) > SAME_POSE:
            return True
    return False
