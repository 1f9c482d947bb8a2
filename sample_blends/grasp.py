# SPDX-License-Identifier: GPL-3.0-or-later
"""A grasp: two finger pads close on a steel cylinder that stands on a table, and lift it by friction alone.

Units are millimetres, as in the other samples.
"""

from __future__ import annotations

import math

from . import scene_builder

FPS = 24
FRAME_END = 60
PICTURE_FRAME = 52
"""The cylinder hangs between the fingers."""
ROWS, COLUMNS, PITCH = 12, 8, 2.5
THICKNESS = 6.0  # mm, of the pads
RADIUS, HEIGHT = 14.0, 60.0  # mm
MASS = 0.288  # kg: steel of 7,800 kg/m³
SQUEEZE = 1.6  # mm, by which each pad is pressed
OPEN, LIFT = 7.0, 32.0  # mm
MIDDLE = 42.0  # mm, height of the fingers' middle above the table
FOAM = {"k": 300.0, "cn": 3.0, "sigma0": 300.0, "sigma1": 3.0, "mus": 0.6, "mud": 0.5}
"""Of fingers and table; the bristles are as stiff as the foam."""
LEFT, RIGHT, CYLINDER, TABLE = "Left finger", "Right finger", "Cylinder", "Table"

TEXT = """\
A grasp of two fingers

Two finger pads close on a steel cylinder of 288 g, which stands on a table, and lift it by friction alone: each of them bears
half of its weight, 1.41 N, as shear. The cylinder is free; the table is a pad, which presses on it and is not read out.

Space plays; Bake writes the tactile images of both fingers and puts heat maps, net forces and shear on them.
"""


def build(scene) -> None:
    """Fill `scene`, which is emptied first; the add-on's classes must be registered."""
    scene_builder.prepare(scene, FRAME_END, FPS)
    rubber = scene_builder.material("Rubber", (0.035, 0.036, 0.04), roughness=0.55)
    grey = scene_builder.material("Grey anodised", (0.21, 0.22, 0.24), metallic=0.6, roughness=0.4)

    for name, side in ((LEFT, -1), (RIGHT, 1)):
        _finger(scene, name, side, rubber, grey)
    steel = scene_builder.see_through_steel("Steel, seen through", clear=0.8, edge=0.5)
    cylinder = scene_builder.cylinder(scene, CYLINDER, RADIUS, HEIGHT, look=steel, location=(0.0, 0.0, HEIGHT / 2))
    cylinder.modifiers.clear()  # its rim stays sharp: the lower one stands on the table
    scene_builder.pad(scene, TABLE, rubber, 9, 9, 5.0, 4.0, 4.0, role="PAD", **FOAM)
    cylinder.palpate.role, cylinder.palpate.body, cylinder.palpate.mass = "TARGET", "FREE", MASS
    scene.palpate.color_map = "VIRIDIS"
    scene.palpate.overlays = {"FORCE", "SHEARS"}

    scene_builder.add_stage(scene, aim=(0.0, 0.0, 50.0), camera=(190.0, -330.0, 130.0))
    scene.objects["Key"].visible_glossy = False  # else its reflection in the steel covers a pad
    scene.objects["Key"].data.specular_factor = 0.0
    scene.objects["Backdrop"].location.z = -4.0
    scene_builder.add_readme(TEXT)
    scene_builder.open_at(scene, scene.objects[LEFT], 20)


def _finger(scene, name: str, side: int, rubber, grey) -> None:
    """Add a finger at x < 0 (side −1) or x > 0 whose pad faces the middle; it closes and lifts."""
    pad = scene_builder.pad(scene, name, rubber, ROWS, COLUMNS, PITCH, 2.5, THICKNESS, **FOAM)
    pad.rotation_mode = "XYZ"
    # the pad's normal (its z) points to the middle, its rows (its y) run upwards
    pad.rotation_euler = (math.pi / 2, 0.0, -side * math.pi / 2)
    closed = RADIUS - SQUEEZE
    for frame, gap, height in ((1, OPEN, 0.0), (14, 0.0, 0.0), (20, 0.0, 0.0), (46, 0.0, LIFT), (60, 0.0, LIFT)):
        apart = side * (closed + gap + (SQUEEZE if frame == 1 else 0.0))
        scene_builder.keyframe(pad, frame, (apart, 0.0, MIDDLE + height))
    long = ROWS * PITCH + 5.0
    size, place = (COLUMNS * PITCH + 6.0, long + 30.0, 9.0), (0.0, 14.0, -THICKNESS - 4.0)
    scene_builder.box(scene, f"{name} back", size, bevel=2.2, look=grey, parent=pad, location=place)
