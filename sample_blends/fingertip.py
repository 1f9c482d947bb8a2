# SPDX-License-Identifier: GPL-3.0-or-later
"""A steel rod rolls over a curved fingertip, whose texels form no grid: flattened tactile images."""

from __future__ import annotations

import math

import numpy as np

from . import scene_builder

FPS = 24
FRAME_END = 48
RADIUS, LENGTH = 8.0, 20.0  # mm: a capsule
ROD_RADIUS = 5.0  # mm
FINGER, ROD = "Fingertip", "Rod"

TEXT = """\
A curved fingertip

A steel rod rolls across a rubber fingertip. The sensor is a vertex group of a capsule; its texels form no grid, so the tactile
image is their surface, flattened.

Space plays; Bake writes the tactile images and puts heat map, net force and an arrow of shear at every texel on the fingertip.
"""


def build(scene) -> None:
    """Fill `scene`, which is emptied first; the add-on's classes must be registered."""
    scene_builder.prepare(scene, FRAME_END, FPS)
    vertices, faces = capsule()
    finger = scene_builder.mesh_object(scene, FINGER, vertices, faces)
    finger.data.materials.append(scene_builder.material("Rubber", (0.035, 0.036, 0.04), roughness=0.55))
    # The upper side, down to 60 degrees from the top, without the rim of the flat end: its face would belong to the sensor.
    group = finger.vertex_groups.new(name="tactile")
    group.add([int(i) for i in np.flatnonzero((vertices[:, 2] > 0.5 * RADIUS) & (vertices[:, 1] > -LENGTH))], 1.0, "REPLACE")
    finger.location = (0.0, 0.0, 30.0)

    finger.palpate.max_penetration = 0.006  # less than the radius, or the texels' segments would end on the other side

    rod = scene_builder.cylinder(scene, ROD, ROD_RADIUS, 40.0)
    rod.data.materials.append(scene_builder.see_through_steel("Steel, seen through", clear=0.8, edge=0.6))
    rod.rotation_mode = "XYZ"
    top = 30.0 + RADIUS + ROD_RADIUS
    for frame, y, depth in ((1, -4.0, -2.0), (12, -4.0, 1.5), (36, 6.0, 1.5), (48, 6.0, -3.0)):
        rod.location = (0.0, y, top - depth)
        # It lies across the finger and rolls without slipping.
        rod.rotation_euler = (-(y + 4.0) / ROD_RADIUS, math.pi / 2, 0.0)
        rod.keyframe_insert("location", frame=frame)
        rod.keyframe_insert("rotation_euler", frame=frame)

    finger.palpate.role = "SENSOR"
    finger.palpate.region = "GROUP"
    finger.palpate.vertex_group = "tactile"
    finger.palpate.k, finger.palpate.cn = 20.0, 0.2
    rod.palpate.role = "TARGET"
    scene.palpate.overlays = {"FORCE", "SHEARS"}

    paper = scene_builder.material("Backdrop", (0.30, 0.32, 0.35), roughness=0.85)
    scene_builder.add_stage(scene, paper, aim=(0.0, -3.0, 32.0), camera=(95.0, 90.0, 85.0), size=0.3)
    scene_builder.add_readme(TEXT)
    scene_builder.open_at(scene, finger, 24)


def capsule():
    """Return vertices and faces of a capsule along y, rounded at its far end and flat at the near one."""
    sides, caps, straight = 32, 8, 12
    profile = [(-LENGTH + LENGTH * i / straight, RADIUS) for i in range(straight + 1)]
    profile += [(RADIUS * math.sin(a), RADIUS * math.cos(a)) for a in np.linspace(0, math.pi / 2, caps + 1)[1:-1]]
    angle = np.arange(sides) * 2 * math.pi / sides
    rings = [np.stack([r * np.sin(angle), np.full(sides, y), r * np.cos(angle)], axis=1) for y, r in profile]
    vertices = np.concatenate([*rings, [[0.0, RADIUS, 0.0]]])
    tip, count = len(vertices) - 1, len(profile)
    faces = [
        (j * sides + i, j * sides + (i + 1) % sides, (j + 1) * sides + (i + 1) % sides, (j + 1) * sides + i)
        for j in range(count - 1)
        for i in range(sides)
    ]
    last = (count - 1) * sides
    faces += [(last + i, last + (i + 1) % sides, tip) for i in range(sides)]
    faces.append(tuple(range(sides - 1, -1, -1)))
    return vertices, faces
