# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's Fig. 11 and 12: approach, grasp, lift, move down, release, with a gripper under force control."""

from __future__ import annotations

from . import gripper, scene_builder

FPS = 24
FRAME_END = 168
CUBE, TABLE = "Cube", "Table"
EDGE, MASS = 30.0, 0.1  # mm, kg
FORCE = 3.0  # N, of each finger
SPEED, MAX_FORCE = 0.03, 20.0  # m/s, N
COVERED = 0.30
"""Share of the pad's area that the cube covers."""
OPEN = 9.0  # mm, between cube and pads while the fingers are open
ABOVE, LIFT = 45.0, 40.0  # mm, where the gripper comes from, and how high it lifts

STAGES = {"approach": 1, "grasp": 54, "lift": 90, "move down": 126, "release": 150}
"""Frame of the picture of each stage of the work cycle."""
ARM = ((1, ABOVE), (24, 0.0), (60, 0.0), (84, LIFT), (96, LIFT), (120, 0.0), (150, 0.0), (168, ABOVE))
"""Height of the gripper above its grasp over time: frame, mm."""
GRIP = ((1, 0.0), (28, FORCE), (130, 0.0))
"""Set point of the tactile sum over time: frame, N; zero opens the fingers."""

TEXT = """\
Pick and place (paper, section 5.2.2, Fig. 11 and 12)

The gripper comes down, closes at constant speed until its pads feel a touch, controls the force on the tactile sum (3 N),
lifts the cube, sets it down where it was, opens and leaves. The cube covers 30 % of each pad. Nothing but friction lifts it.

The arm and the wanted force are keyframed; the way of the fingers is the controller's.
"""


def build(scene) -> None:
    """Fill `scene`, which is emptied first; the add-on's classes must be registered."""
    scene_builder.prepare(scene, FRAME_END, FPS)
    look = gripper.materials()
    tall = gripper.ROWS * gripper.PITCH
    height = EDGE + tall / 2 - COVERED * tall  # of the pads' middle when the cube's top covers the wanted share
    fingers = [gripper.finger(scene, side, EDGE / 2 + OPEN, height, look) for side in (-1, 1)]
    arm = gripper.housing(scene, height, look)
    gripper.mount(arm, fingers)
    gripper.close(fingers, GRIP, SPEED, MAX_FORCE)
    rest = arm.location.z
    for frame, above in ARM:
        arm.location.z = rest + above
        arm.keyframe_insert("location", frame=frame)

    cube = scene_builder.wooden_box(scene, CUBE, (EDGE,) * 3, bevel=0.6)
    cube.location = (0.0, 0.0, EDGE / 2)
    cube.palpate.role, cube.palpate.body, cube.palpate.mass = "TARGET", "FREE", MASS
    table = gripper.table(scene, TABLE, 0.0)
    scene.palpate.use_auto_dt, scene.palpate.dt = False, 5e-4
    scene.palpate.color_map = "MAGMA"

    scene_builder.add_stage(scene, aim=(0.0, 0.0, 60.0), camera=(190.0, -330.0, 190.0), size=0.9)
    scene.objects["Backdrop"].location.z = -8.0
    scene.frame_set(scene.frame_start)
    scene_builder.frame_objects(scene, [*fingers, arm, table], (0.04, 0.04, 0.96, 0.96), size=(720, 720))
    scene_builder.add_readme(TEXT)
    scene_builder.open_at(scene, fingers[0], STAGES["grasp"])
