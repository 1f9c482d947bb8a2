# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a scene: objects, meshes and animation become a :class:`.Scenario`, and nothing in the scene changes.

:func:`.scene_reader.read_scene` reads a whole frame range in one pass; :func:`.scene_reader.read_start` reads the first frame,
and :meth:`.SceneReading.sample` one more frame at a time. Fingerprints tell whether a scene has changed since it was read.
:mod:`.moved_bodies` also converts poses back into properties of objects.
"""

__all__ = [
    "animation_fingerprint",
    "attached_objects",
    "baked_names",
    "body_poses",
    "channel_reader",
    "deforming_objects",
    "display_names",
    "drives",
    "mesh_arrays",
    "mesh_fingerprint",
    "moved_bodies",
    "participants",
    "rounding_warnings",
    "scene_fingerprint",
    "scene_reader",
    "scene_reading",
    "sensor_reader",
    "sensor_regions",
    "uv_layouts",
]
