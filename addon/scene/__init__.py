# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a scene: objects, meshes and animation become a :class:`.Scenario`, and nothing in the scene changes.

:func:`.scene_reader.read_scene` reads a whole frame range in one pass; :func:`.scene_reader.read_start` reads the first frame,
and :meth:`.SceneReading.sample` one more frame at a time. Fingerprints tell whether a scene has changed since it was read.
:mod:`.moved_bodies` also converts poses back into properties of objects.
"""

__all__ = [
    "deforming_objects",
    "mesh_arrays",
    "moved_bodies",
    "participants",
    "scene_fingerprint",
    "scene_reader",
    "scene_reading",
    "sensor_reader",
    "sensor_regions",
    "stored_names",
    "uv_layouts",
]
