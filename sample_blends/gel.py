# SPDX-License-Identifier: GPL-3.0-or-later
"""A soft gel, of the kind that a camera watches from behind: a hexagon nut is pressed on it, turned and drawn aside."""

from __future__ import annotations

import math

import numpy as np

from . import scene_builder

FPS = 24
FRAME_END = 48
ROWS, COLUMNS = 34, 44
PITCH = 0.5  # mm
THICKNESS = 4.0  # mm
HEIGHT = 12.0  # mm, of the gel's upper side above the table
STIFFNESS, DAMPING = 10.0, 0.1
"""Of one texel, N/m and N·s/m. Over its quarter of a square millimetre, 4 mm of a gel with a Young's modulus of 0.16 MPa."""
BRISTLES = 4.0
"""N/m of one texel: about a third of the stiffness, as the shear modulus of rubber is of Young's modulus."""
FLATS, HOLE, NUT_HEIGHT = 10.0, 5.0, 4.0  # mm: a nut M6 is 10 mm across flats, and 5 mm inside its thread
ROUNDING = 0.7  # mm, of the nut's edges
DEPTH = 0.9  # mm
GEL, NUT = "Gel", "Nut"

TEXT = """\
A gel before a camera

A nut is pressed on a soft gel, turned and drawn aside. 'palpate render --only gel', or the figure Gel under Physics > Palpate >
Figures, shows the camera image behind the gel: its surface in the light of a red, a green and a blue lamp, with printed
markers that the shear carries along. It is a picture of baked penetration, not a calibrated model of a camera and its lamps.

Press Space to play, or Bake for tactile images and keyframes.
"""


def build(scene) -> None:
    """Fill `scene`, which is emptied first; the add-on's classes must be registered."""
    scene_builder.prepare(scene, FRAME_END, FPS)
    gel = _gel(scene)
    steel = scene_builder.material("Steel", scene_builder.STEEL, metallic=1.0, roughness=0.25)
    nut = scene_builder.mesh_object(scene, NUT, *nut_mesh(), steel, smooth=False)
    bevel = nut.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments, bevel.limit_method, bevel.angle_limit = ROUNDING, 4, "ANGLE", math.radians(45.0)
    nut.rotation_mode = "XYZ"
    for frame, x, depth, turn in (
        (1, -2.5, -1.5, 0.0),
        (12, -2.5, DEPTH, 0.0),
        (16, -2.5, DEPTH, 0.0),
        (28, -2.5, DEPTH, 14.0),
        (40, -0.5, DEPTH, 14.0),
        (48, -0.5, -1.5, 14.0),
    ):
        turned = (math.radians(2.0), 0.0, math.radians(8.0 + turn))
        scene_builder.keyframe(nut, frame, (x, 0.3, HEIGHT - depth), turned)

    nut.palpate.role = "TARGET"
    scene.palpate.overlays = {"FORCE"}
    scene.palpate.figures.kinds = {"SCENE", "STRIP", "CURVES", "GEL"}

    scene_builder.add_stage(scene, aim=(0.0, 0.0, HEIGHT), camera=(35.0, -55.0, 55.0), size=0.2)
    scene.frame_set(28)
    scene_builder.frame_objects(scene, (gel, nut, scene.objects["Housing"]))
    scene_builder.add_readme(TEXT)
    scene_builder.open_at(scene, gel, 28)


def _gel(scene):
    """Return the gel on its housing; the vertex group "tactile" holds the texels."""
    look = scene_builder.material("Gel", (0.45, 0.46, 0.48), roughness=0.45)
    foam = {"k": STIFFNESS, "cn": DAMPING, "max_penetration": 0.75e-3 * THICKNESS}
    friction = {"sigma0": BRISTLES, "sigma1": 0.01 * BRISTLES, "mus": 0.9, "mud": 0.7}
    gel = scene_builder.pad(scene, GEL, look, ROWS, COLUMNS, PITCH, 1.5, THICKNESS, rounding=0.8, **foam, **friction)
    gel.location = (0.0, 0.0, HEIGHT)
    height = HEIGHT - THICKNESS + 0.5
    sides = ((count - 1) * PITCH + 2 * 1.5 + 3.0 for count in (COLUMNS, ROWS))
    black = scene_builder.material("Black anodised", (0.012, 0.012, 0.014), metallic=0.6, roughness=0.32)
    place = (0.0, 0.0, 0.5 * height - HEIGHT)
    scene_builder.box(scene, "Housing", (*sides, height), bevel=1.0, look=black, parent=gel, location=place)
    return gel


def nut_mesh():
    """Return vertices and faces of a hexagon nut whose lower side lies in z = 0; its hole is round, without a thread."""
    sides = 24
    angle = np.arange(sides) * 2.0 * math.pi / sides
    # A point of the hexagon at each angle: half the flats over the cosine to the nearest flat's middle.
    turn = (angle + math.pi / 6) % (math.pi / 3) - math.pi / 6
    outer = 0.5 * FLATS / np.cos(turn)
    rings = [
        np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides, z)], axis=1)
        for radius, z in ((outer, 0.0), (outer, NUT_HEIGHT), (0.5 * HOLE, NUT_HEIGHT), (0.5 * HOLE, 0.0))
    ]
    return np.concatenate(rings), scene_builder.tube_faces(len(rings), sides, closed=True)
