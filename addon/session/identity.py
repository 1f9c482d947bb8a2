# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects by a name that lasts: Blender's pointers go stale with undo, deletion and loading, names with renaming."""

from __future__ import annotations

import uuid

_owners: dict[str, int] = {}
"""Session uid of the object that first had a uid in this session; Shift D copies the uid, but not this."""


def ensure(obj) -> None:
    """Give an object a uid of its own: a new one when it has none, or has one as the copy of another object."""
    settings = obj.palpate
    if not obj.is_editable:
        return
    is_copy = _owners.get(settings.uid, obj.session_uid) != obj.session_uid
    if is_copy and not settings.is_baked:
        settings.property_unset("has_start")  # the original's; a copy starts where the user has put it
    if not settings.uid or is_copy:
        settings.uid = uuid.uuid4().hex
    _owners[settings.uid] = obj.session_uid


def key(obj) -> str:
    """Return the uid; a linked object that never got one answers to its library and name."""
    return obj.palpate.uid or f"name:{obj.name_full}"


def find(scene, keys) -> dict:
    """Return the objects of a scene that go by `keys`, by key; deleted ones are left out."""
    wanted = set(keys)
    return {found: obj for obj in scene.objects if (found := key(obj)) in wanted}


def claim(objects) -> None:
    """As a file is opened, take the first object with a uid for its owner: by name, copies come after their originals."""
    for obj in sorted(objects, key=lambda obj: obj.name_full):
        if obj.palpate.uid:
            _owners.setdefault(obj.palpate.uid, obj.session_uid)


def forget() -> None:
    """Start over, because another file is open and session uids are new."""
    _owners.clear()
