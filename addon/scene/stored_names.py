# SPDX-License-Identifier: GPL-3.0-or-later
"""Names, stored in .blend files, of what a bake puts on a sensor to be seen: reading a scene must leave these things out."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache

from ..session import identity

UV_MAP = "Palpate"
"""Texture coordinates of the heat map."""
HEAT_MAP_MODIFIER = "Palpate Heat Map"
"""Geometry nodes that store the baked force on the vertices."""
INDENTATION_MODIFIER = "Palpate Indentation"
"""Geometry nodes that move the surface of a sensor inwards by the baked penetration."""
FORCE = "palpate_force"
"""Vertex attribute with the texels' normal force, which geometry nodes write, and the timeline while it plays."""
ARROWS_MODIFIER = "Palpate Arrows"
"""Geometry nodes that draw an arrow at every texel."""
MODIFIERS = {HEAT_MAP_MODIFIER, INDENTATION_MODIFIER}
REST_POSITION = "palpate_rest"
"""Vertex attribute of an indented mesh: where its vertices are without indentation; those of its own mesh come first."""
STATED_NORMAL = "palpate_normal"
"""Vertex attribute of an imported sensor: normals that its file states, where they are not those of the surface."""
GAP_COLORS = "Palpate Gap"
"""Colour attribute of a sensor: the errors of its texels in measurements."""
OLD_MATERIAL = ".palpate_old_material"
"""Face attribute of a baked sensor: the material index before the heat map; −1 on faces that kept theirs."""


@lru_cache(maxsize=8)
def unpacked(text: str) -> dict:
    """Return what a text in the settings of a scene holds."""
    return json.loads(text) if text else {}


def name_in_bake(scene, obj) -> str:
    """Return the name of an object in its scene's bake; its own name where it is not part of one, as for a duplicate."""
    if identity.is_copy(obj):
        return obj.name
    return unpacked(scene.palpate.baked_names).get(identity.key(obj), obj.name)


def objects_of_bake(scene, names) -> dict:
    """Return the objects of a scene that its bake calls by `names`, by these names; deleted objects are left out."""
    keys = {name: key for key, name in unpacked(scene.palpate.baked_names).items()}
    found = identity.find_objects(scene, [keys[name] for name in names if name in keys])
    objects = {name: found.get(keys[name]) if name in keys else scene.objects.get(name) for name in names}
    return {name: obj for name, obj in objects.items() if obj is not None}


@contextmanager
def hidden_display(scene) -> Iterator[None]:
    """Hide arrows and indentations inside the ``with`` block, where their nodes would read the previous bake at every frame."""
    shown = [
        (obj.name, modifier.name)
        for obj in scene.objects
        if obj.library is None
        for modifier in obj.modifiers
        if modifier.name in (ARROWS_MODIFIER, INDENTATION_MODIFIER) and modifier.show_viewport
    ]
    try:
        _show_modifiers(scene, shown, False)
        yield
    finally:
        with suppress(ReferenceError):  # the scene was removed meanwhile
            _show_modifiers(scene, shown, True)


def _show_modifiers(scene, modifiers, shown: bool) -> None:
    for name, modifier_name in modifiers:
        obj = scene.objects.get(name)  # the user may have deleted it meanwhile
        if obj is not None and (modifier := obj.modifiers.get(modifier_name)) is not None:
            modifier.show_viewport = shown
