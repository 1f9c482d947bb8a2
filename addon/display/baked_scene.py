# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene holds of its bake: which objects show it, where its files are, and how it is taken out again."""

from __future__ import annotations

import os
from pathlib import Path

import bpy

from ..scene import moved_bodies
from ..session import identity
from . import heat_map, markers, materials


def baked_objects(scene) -> list:
    """Return the objects that hold a part of the scene's bake."""
    return [obj for obj in scene.objects if obj.palpate.is_baked]


def bake_folder(obj) -> Path | None:
    """Return the folder of a sensor's bake; None when it shows none.

    It is where the images are: their path follows when the .blend is saved somewhere else, the text in our settings does not.
    """
    image = materials.find_block(bpy.data.images, obj.palpate.uid) if obj.palpate.bake_folder else None
    return None if image is None else Path(os.path.abspath(bpy.path.abspath(image.filepath))).parent


def bake_folders(scene) -> dict:
    """Return the folders of the scene's bake by the sensors' objects."""
    return {obj: place for obj in baked_objects(scene) if (place := bake_folder(obj)) is not None}


def clear_scene(scene) -> None:
    """Take a bake out of its scene; its files stay."""
    for obj in baked_objects(scene):
        clear_object(scene, obj)
    remove_orphans()
    scene.palpate.baked_digest = ""


def remove_orphans() -> None:
    """Remove markers, materials, nodes and images of sensors that were deleted."""
    uids = {obj.palpate.uid for obj in bpy.data.objects}
    markers.remove_orphans(uids)
    materials.remove_orphans(uids)


def has_bake(scene) -> bool:
    """Whether there is anything for :func:`clear_scene`: an object's part of a bake, or the arrow of a deleted sensor."""
    if baked_objects(scene):
        return True
    return bool(scene.palpate.baked_digest) and bool(markers.orphans(scene.objects))


def clear_object(scene, obj) -> None:
    """Take one object's part of a bake away: keyframes, heat map, arrow; a free body is put back to its start."""
    identity.ensure(obj)
    moved_bodies.clear(obj)
    if obj.palpate.bake_folder:
        heat_map.clear(obj)
        markers.clear(scene, obj.palpate.uid)
        obj.palpate.bake_folder = ""
