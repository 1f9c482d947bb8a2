# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a bake in its scene: the objects that show it, the folders of its files, and its removal."""

from __future__ import annotations

import os
from pathlib import Path

import bpy

from ..scene import moved_bodies
from ..session import identity
from . import heat_map, indentation, markers, materials


def baked_objects(scene) -> list:
    """Return the objects that show a part of the scene's bake."""
    return [obj for obj in scene.objects if obj.palpate.is_baked]


def bake_folder(obj) -> Path | None:
    """Return the folder of a sensor's bake; None if the sensor shows none.

    The path is taken from the image sequence: Blender adapts it when the .blend is saved elsewhere, but not our own property.
    """
    image = materials.find_block(bpy.data.images, obj.palpate.uid) if obj.palpate.bake_folder else None
    return None if image is None else Path(os.path.abspath(bpy.path.abspath(image.filepath))).parent


def bake_folders(scene) -> dict:
    """Return the folder of each sensor's bake by the sensor's object."""
    return {obj: place for obj in baked_objects(scene) if (place := bake_folder(obj)) is not None}


def clear_scene(scene) -> None:
    """Remove a bake from its scene; its files stay."""
    for obj in baked_objects(scene):
        clear_object(scene, obj)
    remove_orphans()
    settings = scene.palpate
    settings.baked_digest = settings.baked_id = settings.baked_names = settings.unchanged_note = ""


def clear_copies(scene) -> None:
    """Remove the bake from duplicates of baked objects: it is that of their originals. Those that share a mesh keep it."""
    for obj in baked_objects(scene):
        if identity.is_copy(obj) and obj.is_editable and (obj.data is None or obj.data.users == 1):
            clear_object(scene, obj)


def remove_orphans() -> None:
    """Remove the markers, materials, nodes and images of sensors that were deleted, and copied markers in copied scenes."""
    markers.remove_orphans()
    materials.remove_orphans({obj.palpate.uid for obj in bpy.data.objects})


def has_bake(scene) -> bool:
    """Return True if :func:`clear_scene` has something to remove: a part of a bake, or markers of a deleted sensor."""
    if baked_objects(scene):
        return True
    return bool(scene.palpate.baked_digest) and bool(markers.orphans(scene.objects))


def clear_object(scene, obj) -> None:
    """Remove one object's part of a bake: keyframes, heat map and markers; a free body returns to its start."""
    identity.ensure_uid(obj)
    moved_bodies.remove_motion(obj)
    if obj.palpate.bake_folder:
        indentation.clear(obj)
        heat_map.clear(obj)
        markers.clear(scene, obj.palpate.uid)
        obj.palpate.bake_folder = ""
        obj.palpate.property_unset("tactile_images")
