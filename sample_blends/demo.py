# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo: a steel ball slides over one finger pad until it slips, and a cube of 1 kg comes to rest on another.

Units are millimetres (``scale_length`` 0.001), so that view, snapping and clipping suit the size of a fingertip.
"""

from __future__ import annotations

import math

from ..addon.render import render
from . import scene_builder

FPS = 24
FRAME_END = 112
PICTURE_FRAME = 78
"""Frame of the picture: the ball slips, the cube is at rest."""
STRIP_FRAMES = (1, 17, 35, 53, 71, 89)
"""Frames of the tactile strip: before contact, pressed, and four while the ball slides."""

PAD_ROWS, PAD_COLUMNS = 14, 6
PITCH_A, PITCH_B = 3.4, 4.5  # mm; the paper's pad, and one a little longer than the cube
BALL_RADIUS = 16.0  # mm
PRESS_DEPTH = 2.2  # mm
CUBE_EDGE = 50.0  # mm, stainless steel: 8,000 kg/m³ make it 1 kg
CUBE_MASS = 1.0  # kg
DROP = 0.5  # mm
RANGE = 0.15  # N, end of the heat maps' common scale
PAD_HEIGHT = 16.0  # mm, upper side of the pads above the table

BALL, CUBE, PAD_A, PAD_B = "Steel ball", "Cube 1 kg", "Finger A", "Finger B"

TEXT = """\
Two finger pads

A steel ball is pressed on finger A and slides along it, while it turns, until it slips. A cube of 1 kg is let go half a
millimetre above finger B and comes to rest on its stiffer foam: 9.81 N, shared by the 70 texels under it.

Select a finger and look at Physics > Palpate. Space plays; Bake writes tactile images and shows them, with the net force, on
the pads. Palpate > Figures makes pictures of the bake; the pads' colours have one scale, 0 to 0.15 N.
"""


def build(scene) -> None:
    """Fill `scene`, which is emptied first, with the demo; the add-on's classes must be registered."""
    scene_builder.prepare(scene, FRAME_END, FPS)
    rubber = scene_builder.material("Rubber", (0.035, 0.036, 0.04), roughness=0.55)
    black = scene_builder.material("Black anodised", (0.012, 0.012, 0.014), metallic=0.6, roughness=0.32)
    screw = scene_builder.material("Screw", (0.55, 0.56, 0.58), metallic=1.0, roughness=0.25)

    pad_a = _finger(scene, PAD_A, PITCH_A, (-44.0, -22.0), math.radians(24), rubber, black, screw)
    pad_b = _finger(scene, PAD_B, PITCH_B, (26.0, 10.0), math.radians(24), rubber, black, screw)

    steel = scene_builder.see_through_steel("Steel, seen through (ball)", clear=0.85, groove=0.45)
    ball = scene_builder.ball(scene, BALL, BALL_RADIUS, look=steel)
    _slide(ball, pad_a)

    cube = scene_builder.box(scene, CUBE, (CUBE_EDGE,) * 3, bevel=1.2, flat_bottom=True)
    scene_builder.clear_sides(cube, "Steel", scene_builder.STEEL, metallic=1.0, roughness=0.16)
    cube.location = (pad_b.location.x, pad_b.location.y, PAD_HEIGHT + CUBE_EDGE / 2 + DROP)
    cube.rotation_euler = (0.0, 0.0, pad_b.rotation_euler.z + math.radians(18))

    _author(scene, pad_b, ball, cube)
    scene_builder.add_stage(scene, aim=(0.0, 0.0, 20.0), camera=(60.0, -300.0, 190.0))
    frame_picture(scene, (1280, 720))
    scene_builder.add_readme(TEXT)
    scene_builder.open_at(scene, pad_a, STRIP_FRAMES[3])


def _finger(scene, name: str, pitch: float, location, turn: float, rubber, black, screw):
    """Return the pad of a gripper finger, with its base as a child. The vertex group "tactile" holds the texels."""
    margin, thickness = 0.9 * pitch + 0.6, 6.0
    pad = scene_builder.pad(scene, name, rubber, PAD_ROWS, PAD_COLUMNS, pitch, margin, thickness)
    pad.location, pad.rotation_euler = (*location, PAD_HEIGHT), (0.0, 0.0, turn)

    wide = (PAD_COLUMNS - 1) * pitch + 2 * margin
    long = (PAD_ROWS - 1) * pitch + 2 * margin
    height = PAD_HEIGHT - thickness + 1.0
    size, place = (wide + 5, long + 22, height), (0.0, 6.0, 0.5 * height - PAD_HEIGHT)
    scene_builder.box(scene, f"{name} base", size, bevel=2.2, look=black, parent=pad, location=place)
    for side in (-1, 1):
        place = (side * (wide / 2 - 3.2), long / 2 + 11, height - PAD_HEIGHT + 0.4)
        scene_builder.cylinder(scene, f"{name} screw", 1.9, 1.4, bevel=0.3, look=screw, parent=pad, location=place)
    return pad


def _slide(ball, pad) -> None:
    """Keyframe the ball: down, hold, along the rows while it rotates against the slide, lift slowly, away.

    One rotation of the ball moves ten centimetres of steel over the texels while it travels along the pad. The bristles of the
    paper's pad are soft (``sigma0`` = 1 N/m): a texel under 0.1 N sticks for ``mus · fn / sigma0`` ≈ 4 cm before it slips.
    """
    ball.rotation_mode = "XYZ"
    up = PAD_HEIGHT + BALL_RADIUS
    direction = pad.matrix_basis.to_3x3().col[1]  # +y of the pad, along its rows
    for frame, along, depth, turn in (
        (1, -7.0, -5.0, 0.0),
        (14, -7.0, PRESS_DEPTH, 0.0),
        (20, -7.0, PRESS_DEPTH, 0.0),
        (62, 4.0, PRESS_DEPTH, 250.0),
        (88, 7.0, PRESS_DEPTH, 620.0),
        (96, 8.5, -0.2, 680.0),
        (108, 8.5, -9.0, 690.0),
    ):
        place = (pad.location.x + along * direction.x, pad.location.y + along * direction.y, up - depth)
        scene_builder.keyframe(ball, frame, place, (math.radians(turn), 0.0, pad.rotation_euler.z))


def _author(scene, pad_b, ball, cube) -> None:
    """Give the objects their roles and parameters, as the panel in the Physics tab would."""
    pad_b.palpate.k, pad_b.palpate.cn = 1000.0, 10.0
    for target in (ball, cube):
        target.palpate.role = "TARGET"
    cube.palpate.body = "FREE"
    cube.palpate.mass = CUBE_MASS
    settings = scene.palpate
    settings.color_map = "MAGMA"
    settings.use_auto_range, settings.range_max = False, RANGE  # one scale for both pads


def frame_picture(scene, size) -> None:
    """Frame pads and objects for a picture of `size` pixels, with space for the tactile images on the right."""
    scene.render.resolution_x, scene.render.resolution_y = size
    names = (PAD_A, PAD_B, BALL, CUBE, f"{PAD_A} base", f"{PAD_B} base")
    scene.frame_set(PICTURE_FRAME)
    render.fit_camera(scene, render.bounding_box_corners([scene.objects[name] for name in names]), (0.05, 0.06, 0.78, 0.88))
    scene.frame_set(scene.frame_start)
