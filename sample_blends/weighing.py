# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's section 5.1: a cube of steel that comes to rest on a finger's pad, level (Table 3) or tilted (Fig. 9)."""

from __future__ import annotations

import math

from . import scene_builder

FPS = 24
FRAME_END = 48
EDGE = 50.0  # mm: 1 kg of steel
PITCH = 3.4  # mm
ROWS, COLUMNS = 14, 6
HEIGHT = 16.0  # mm, of the pad's upper side above the table
PAD, CUBE = "Finger", "Cube"
K, CN = 1000.0, 10.0
"""Stiffness (N/m) and damping (N·s/m) of one texel in section 5.1."""
SIGMA0, SIGMA1 = 1000.0, 10.0
"""Bristles as stiff as the foam. Table 2's 1 N/m would let 1 kg at 10 degrees travel 20 mm before it is held."""

TEXT = """\
Weighing (paper, section 5.1.1, Table 3)

A 14 x 6 pad (k = 1000 N/m, cn = 10 N s/m per texel, as in the paper) carries a cube of steel. Once it has come to rest the
normal forces of all texels add up to its weight. Change the cube's mass under Physics > Palpate to weigh something else.

Press Space to play, or Bake for tactile images and keyframes.
"""


def build(scene) -> None:
    """Fill `scene`, which is emptied first; the add-on's classes must be registered."""
    weigh(scene, 1.0, 0.0)
    scene_builder.add_readme(TEXT)


def weigh(scene, mass: float, tilt: float, frame_end: int = FRAME_END, fps: int = FPS) -> None:
    """Put a cube of `mass` (kg) on a pad that is tilted by `tilt` degrees about x, so along its rows."""
    scene_builder.prepare(scene, frame_end, fps)
    rubber = scene_builder.material("Rubber", (0.035, 0.036, 0.04), roughness=0.55)
    foam = {"k": K, "cn": CN, "sigma0": SIGMA0, "sigma1": SIGMA1}
    pad = scene_builder.pad(scene, PAD, rubber, ROWS, COLUMNS, PITCH, 0.9 * PITCH + 0.6, 6.0, **foam)
    turn = math.radians(tilt)
    pad.location, pad.rotation_euler = (0.0, 0.0, HEIGHT), (turn, 0.0, 0.0)

    cube = scene_builder.box(scene, CUBE, (EDGE,) * 3, bevel=1.2, flat_bottom=True)
    scene_builder.clear_sides(cube, "Steel", scene_builder.STEEL, metallic=1.0, roughness=0.16)
    up = EDGE / 2 + 0.1
    cube.location = (0.0, -up * math.sin(turn), HEIGHT + up * math.cos(turn))
    cube.rotation_euler = (turn, 0.0, 0.0)

    cube.palpate.role, cube.palpate.body, cube.palpate.mass = "TARGET", "FREE", mass
    scene.palpate.use_auto_dt, scene.palpate.dt = False, 1e-4  # the paper's step
    scene.palpate.color_map = "MAGMA"

    scene_builder.add_stage(scene, aim=(0.0, 0.0, 25.0), camera=(190.0, -170.0, 110.0), size=0.5)
    scene_builder.frame_objects(scene, (pad, cube))
    scene_builder.open_at(scene, pad, min(24, frame_end))
