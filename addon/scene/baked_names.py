# SPDX-License-Identifier: GPL-3.0-or-later
"""What objects were called when a scene was baked: a bake names its objects, and a user may rename them later."""

from __future__ import annotations

import json
from functools import lru_cache

from ..session import identity


def pack_names(objects) -> str:
    """Return the present names of objects by their lasting keys, as text for the scene."""
    return json.dumps({identity.key(obj): obj.name for obj in objects})


@lru_cache(maxsize=8)
def _unpacked(text: str) -> dict[str, str]:
    return json.loads(text) if text else {}


def name_in_bake(scene, obj) -> str:
    """Return what an object is called in its scene's bake; its own name where it is not part of one, as for a duplicate."""
    if identity.is_copy(obj):
        return obj.name
    return _unpacked(scene.palpate.baked_names).get(identity.key(obj), obj.name)


def objects_of_bake(scene, names) -> dict:
    """Return the objects of a scene that its bake calls by `names`, by these names; deleted objects are left out."""
    keys = {name: key for key, name in _unpacked(scene.palpate.baked_names).items()}
    found = identity.find_objects(scene, [keys[name] for name in names if name in keys])
    objects = {name: found.get(keys[name]) if name in keys else scene.objects.get(name) for name in names}
    return {name: obj for name, obj in objects.items() if obj is not None}
