# SPDX-License-Identifier: GPL-3.0-or-later
"""The participants of a simulation, and the dependency graph from which they are read.

Every object with a role that the view layer shows is a participant. Hidden and disabled objects are left out, with a warning.
Instances of collections never are.
"""

from __future__ import annotations

import bpy

from ...core.errors import SceneError

OBJECT_TYPES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Types of objects that have a mesh or can be converted to one."""


def view_layer_of(scene):
    """Return the view layer that decides which objects participate: the window's, else the scene's first."""
    context = bpy.context
    return context.view_layer if context.scene == scene and context.view_layer else scene.view_layers[0]


def depsgraph_of(scene):
    """Return the up-to-date dependency graph of a scene's present frame."""
    layer = view_layer_of(scene)
    layer.update()
    return layer.depsgraph


def find_participants(scene) -> tuple[list, list[str]]:
    """Return the participants, in the scene's order, and a warning for each object that is hidden."""
    layer = view_layer_of(scene)
    found, hidden = [], []
    for obj in scene.objects:
        if obj.palpate.role != "NONE" and obj.type in OBJECT_TYPES:
            (found if obj.visible_get(view_layer=layer) else hidden).append(obj)
    return found, [f"'{obj.name}' is hidden and is not part of the simulation." for obj in hidden]


def sensors_called(scene, names, *other_roles: str) -> list:
    """Return the sensors of some names, or objects of `other_roles`; raises SceneError for a name that none of them has."""
    found = {obj.name: obj for obj in scene.objects if obj.palpate.role in ("SENSOR", *other_roles)}
    for name in names:
        if name not in found:
            known = ", ".join(f"'{known}'" for known in found) or "none"
            raise SceneError(f"There is no sensor '{name}' in '{scene.name}': choose from {known}.")
    return [found[name] for name in names]


def why_left_out(scene) -> str:
    """Return sentences on the objects with a role that are not part of the simulation: hidden ones and those in instances."""
    sentences = find_participants(scene)[1]
    for obj in scene.objects:
        collection = obj.instance_collection if obj.instance_type == "COLLECTION" else None
        found = [other.name for other in collection.all_objects if other.palpate.role != "NONE"] if collection else []
        if found:
            sentences.append(
                f"'{obj.name}' shows an instance of '{found[0]}', which is not part of the simulation: "
                "use Object › Apply › Make Instances Real."
            )
    return " ".join(sentences)


def show_hidden(scene) -> None:
    """Show all hidden objects with a role in the view layer that decides, and the collections that hold them."""
    layer = view_layer_of(scene)
    for obj in scene.objects:
        if obj.palpate.role == "NONE" or obj.type not in OBJECT_TYPES or obj.visible_get(view_layer=layer):
            continue
        waiting = [layer.layer_collection]
        while waiting:
            holder = waiting.pop()
            if obj.name in holder.collection.all_objects:
                holder.exclude = holder.hide_viewport = holder.collection.hide_viewport = False
                waiting += holder.children
        obj.hide_viewport = False
        obj.hide_set(False, view_layer=layer)
