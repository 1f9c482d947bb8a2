# SPDX-License-Identifier: GPL-3.0-or-later
"""Identify objects by a unique id that lasts.

Blender's pointers become invalid after undo, deletion and loading; names change when the user renames an object.
"""

from __future__ import annotations

import uuid

_owners: dict[str, int] = {}
"""By uid: the session uid of the object that had it first. Duplicating an object copies the uid, but not the session uid."""


def ensure_uid(obj) -> None:
    """Give an object its own uid: a new one when it has none, or when it is a copy of another object."""
    settings = obj.palpate
    if not obj.is_editable:
        return
    is_copy = _owners.get(settings.uid, obj.session_uid) != obj.session_uid
    if is_copy and not settings.is_baked:
        settings.property_unset("has_start")  # this belongs to the original; a copy starts where the user puts it
    if not settings.uid or is_copy:
        settings.uid = uuid.uuid4().hex
    _owners[settings.uid] = obj.session_uid


def key(obj) -> str:
    """Return the uid of an object; for a linked object without one, a key made of its library and name."""
    return obj.palpate.uid or f"name:{obj.name_full}"


def find_objects(scene, keys) -> dict:
    """Return the objects of a scene that have one of `keys`, by key; deleted objects are left out."""
    wanted = set(keys)
    return {found: obj for obj in scene.objects if (found := key(obj)) in wanted}


def register_owners(objects) -> None:
    """When a file is opened, let the first object by name own each uid: a copy's name sorts after its original's."""
    for obj in sorted(objects, key=lambda obj: obj.name_full):
        if obj.palpate.uid:
            _owners.setdefault(obj.palpate.uid, obj.session_uid)


def forget() -> None:
    """Forget all owners, because another file is open and session uids are new."""
    _owners.clear()
