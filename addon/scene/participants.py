# SPDX-License-Identifier: GPL-3.0-or-later
"""The participants of a simulation, and the dependency graph from which they are read.

Every object with a role that the view layer shows is a participant. Hidden and disabled objects are left out, with a warning.
Instances of collections never are.
"""

from __future__ import annotations

OBJECT_TYPES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Types of objects that have a mesh or can be converted to one."""


def view_layer_of(scene):
    """Return the view layer that decides which objects participate: the window's, else the scene's first."""
    import bpy

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
    found, warnings = [], []
    for obj in scene.objects:
        if obj.palpate.role == "NONE" or obj.type not in OBJECT_TYPES:
            continue
        if obj.visible_get(view_layer=layer):
            found.append(obj)
        else:
            warnings.append(f"'{obj.name}' is hidden and is not part of the simulation.")
    return found, warnings
