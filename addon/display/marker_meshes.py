# SPDX-License-Identifier: GPL-3.0-or-later
"""The meshes of the markers: surfaces of revolution around z, of length or radius one, shared by all sensors."""

from __future__ import annotations

import math

import bpy

from . import materials

SHAPE_KEY = "palpate_arrow"
"""Custom property of a shared mesh: its name in :data:`PROFILES`."""
SHAFT, HEAD, HEAD_START = 0.025, 0.07, 0.75
"""Radii of an arrow's shaft and head, and where its head begins, as shares of its length."""
SIDES = 24

_ARROW = ((0.0, 0.0), (SHAFT, 0.0), (SHAFT, HEAD_START), (HEAD, HEAD_START), (0.0, 1.0))
_TWICE = ((0.0, 0.0), (SHAFT, 0.0), (SHAFT, 0.5), (HEAD, 0.5), (SHAFT, 0.75), (HEAD, 0.75), (0.0, 1.0))
_ARC = [math.pi * i / 12 for i in range(13)]
_BALL = tuple((math.sin(a) if 0 < i < 12 else 0.0, -math.cos(a)) for i, a in enumerate(_ARC))
_RING = tuple((1.0 + 0.1 * math.cos(2 * a), 0.1 * math.sin(2 * a)) for a in _ARC[:-1])

PROFILES = {"Arrow": _ARROW, "Torque Arrow": _TWICE, "Ball": _BALL, "Ring": _RING}
"""Radius and height of the points of each outline. An outline that does not end on the axis is closed."""
COLORS = {
    "Arrow": (1.0, 0.25, 0.02),
    "Torque Arrow": (0.1, 0.45, 1.0),
    "Ball": (1.0, 1.0, 1.0),
    "Ring": (0.9, 0.02, 0.12),
    "Normal Arrow": (0.95, 0.95, 0.95),
    "Shear Arrow": (1.0, 0.12, 0.4),
}
"""Scene-linear colours."""


def shared_mesh(name: str):
    """Return the mesh of a shape; create it if there is none yet."""
    # files of the first version, which had arrows only, have the value 1 in this property
    found = next((mesh for mesh in bpy.data.meshes if mesh.get(SHAPE_KEY) in ((name, 1) if name == "Arrow" else (name,))), None)
    if found is not None:
        return found
    mesh = bpy.data.meshes.new(f"Palpate {name}")
    mesh.from_pydata(*surface_of_revolution(PROFILES[name]))
    mesh[SHAPE_KEY] = name
    mesh.materials.append(marker_material(name))
    mesh.update()
    return mesh


def surface_of_revolution(profile) -> tuple[list, list, list]:
    """Return vertices, no edges, and faces of an outline rotated around z; a point on the axis becomes a single vertex."""
    vertices, rings, faces = [], [], []
    for radius, height in profile:
        start = len(vertices)
        if radius == 0.0:
            vertices.append((0.0, 0.0, height))
            rings.append([start] * SIDES)
            continue
        turns = (2 * math.pi * side / SIDES for side in range(SIDES))
        vertices += [(radius * math.cos(turn), radius * math.sin(turn), height) for turn in turns]
        rings.append(list(range(start, start + SIDES)))
    if profile[-1][0] > 0.0:
        rings.append(rings[0])
    for low, high in zip(rings, rings[1:]):
        for side in range(SIDES):
            after = (side + 1) % SIDES
            corners = (low[side], low[after], high[after], high[side])
            faces.append(tuple(dict.fromkeys(corners)))
    return vertices, [], faces


def marker_material(name: str):
    """Return the material of a shape, which emits some light of its own."""
    found = next((block for block in bpy.data.materials if block.get(SHAPE_KEY) == name), None)
    if found is not None:
        return found
    made = bpy.data.materials.new(f"Palpate {name}")
    made[SHAPE_KEY] = name
    color = (*COLORS[name], 1.0)
    made.diffuse_color = color
    surface = next(node for node in materials.tree_of(made).nodes if node.type == "BSDF_PRINCIPLED")
    surface.inputs["Base Color"].default_value = color
    surface.inputs["Emission Color"].default_value = color
    surface.inputs["Emission Strength"].default_value = 0.5
    return made
