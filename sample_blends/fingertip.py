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
    rubber = scene_builder.material("Rubber", (0.035, 0.036, 0.04), roughness=0.55)
    finger = scene_builder.mesh_object(scene, FINGER, vertices, faces, rubber, location=(0.0, 0.0, 30.0))
    # The upper side, down to 60 degrees from the top, without the rim of the flat end: its face would belong to the sensor.
    feels = np.flatnonzero((vertices[:, 2] > 0.5 * RADIUS) & (vertices[:, 1] > -LENGTH))
    # the penetration is less than the radius, or the texels' segments would end on the other side
    scene_builder.make_tactile(finger, feels, max_penetration=0.006, k=20.0, cn=0.2)

    steel = scene_builder.see_through_steel("Steel, seen through", clear=0.8, edge=0.6)
    rod = scene_builder.cylinder(scene, ROD, ROD_RADIUS, 40.0, look=steel)
    rod.rotation_mode = "XYZ"
    top = 30.0 + RADIUS + ROD_RADIUS
    for frame, y, depth in ((1, -4.0, -2.0), (12, -4.0, 1.5), (36, 6.0, 1.5), (48, 6.0, -3.0)):
        # It lies across the finger and rolls without slipping.
        scene_builder.keyframe(rod, frame, (0.0, y, top - depth), (-(y + 4.0) / ROD_RADIUS, math.pi / 2, 0.0))
    rod.palpate.role = "TARGET"
    scene.palpate.overlays = {"FORCE", "SHEARS"}

    scene_builder.add_stage(scene, aim=(0.0, -3.0, 32.0), camera=(95.0, 90.0, 85.0), size=0.3)
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
    return vertices, scene_builder.finger_faces(len(profile), sides)
