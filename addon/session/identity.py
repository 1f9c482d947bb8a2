# SPDX-License-Identifier: GPL-3.0-or-later
"""Identify objects and scenes by a unique id that lasts.

Blender's pointers become invalid after undo, deletion and loading; names change when the user renames an object.
Scenes have ids as well, by which bakes are distinguished.
"""

from __future__ import annotations

import hashlib
import os
import uuid
from pathlib import Path

import bpy

_owners: dict[str, int] = {}
"""By uid: the session uid of the object that had it first. Duplicating an object copies the uid, but not the session uid."""

_last_names: dict[str, str] = {}
"""By key: the name under which an object was found last. Asking for it takes a twentieth of the time of asking each of 1,000
objects for its key."""


def ensure_uid(obj) -> None:
    """Give an object its own uid: a new one when it has none, or when it is a copy of another object."""
    settings = obj.palpate
    if not obj.is_editable:
        return
    copied = is_copy(obj)
    if copied and not settings.is_baked:
        settings.property_unset("has_start")  # this belongs to the original; a copy starts where the user puts it
    if not settings.uid or copied:
        settings.uid = uuid.uuid4().hex
    _owners[settings.uid] = obj.session_uid


def is_copy(obj) -> bool:
    """Return True for an object that still has the uid of the object of which it is a copy."""
    return _owners.get(obj.palpate.uid, obj.session_uid) != obj.session_uid


def key(obj) -> str:
    """Return the uid of an object; for a linked object without one, a key made of its library and name."""
    return obj.palpate.uid or f"name:{obj.name_full}"


def find_objects(scene, keys) -> dict:
    """Return the objects of a scene that have one of `keys`, by key; deleted objects are left out."""
    found, missing = {}, set()
    for one in keys:
        obj = scene.objects.get(_last_names.get(one, ""))
        if obj is not None and key(obj) == one:
            found[one] = obj
        else:
            missing.add(one)
    if missing:
        others = {own: obj for obj in scene.objects if (own := key(obj)) in missing}
        _last_names.update({own: obj.name for own, obj in others.items()})
        found |= others
    return found


def register_owners(objects) -> None:
    """When a file is opened, let the first object by name own each uid: a copy's name sorts after its original's."""
    for obj in sorted(objects, key=lambda obj: obj.name_full):
        if obj.palpate.uid:
            _owners.setdefault(obj.palpate.uid, obj.session_uid)


def forget() -> None:
    """Forget all owners, because another file is open and session uids are new."""
    _owners.clear()
    _last_names.clear()


def scene_id(scene) -> str:
    """Return the id that a scene stores; empty if it has none, or only that of the scene of which it is a copy."""
    own = scene.palpate.scene_id
    is_copy = any(other.palpate.scene_id == own and other.session_uid < scene.session_uid for other in bpy.data.scenes)
    return "" if is_copy else own


def new_scene_id(scene, blend: Path | None) -> str:
    """Return an id for a scene that has none, 32 hexadecimal digits.

    Made from the path of its .blend and its name, so that a bake that is killed and repeated gives the same bytes; random where
    the scene was never saved, or where a scene that has been renamed since has this id already.
    """
    if blend is None:
        return uuid.uuid4().hex
    text = f"{os.path.realpath(blend)}\n{scene.name_full}"
    made = hashlib.blake2b(text.encode("utf-8", "surrogatepass"), digest_size=16).hexdigest()
    return made if all(other.palpate.scene_id != made for other in bpy.data.scenes) else uuid.uuid4().hex


def separate_copied_scenes() -> None:
    """Take the ids of their originals from copied scenes: once a file is saved, nothing tells which of two is the copy."""
    for scene in [scene for scene in bpy.data.scenes if scene.is_editable and scene.palpate.scene_id and not scene_id(scene)]:
        scene.palpate.scene_id = ""
