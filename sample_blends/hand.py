# SPDX-License-Identifier: GPL-3.0-or-later
"""Index finger and thumb of a scripted hand hold a cylinder between their tips (paper, section 5.3, Fig. 13).

It is a left hand: fingers towards -y, back of the hand at +x, index finger on top, the cylinder upright at the origin. The
outer parts of index finger and thumb are the sensors; all else is skin (:mod:`.hand_skin`), which follows them.
"""

from __future__ import annotations

import numpy as np

from . import finger_tube, gripper, hand_skin, scene_builder

FPS = 24
FRAME_END = 72
TABLE_STARTS, TABLE_GONE = 36, 54  # frames
INDEX, THUMB, CYLINDER = "Index finger", "Thumb", "Cylinder"
RADIUS, HEIGHT = 12.0, 60.0  # mm, of the cylinder
GAP = 4.0  # mm, between finger tips and cylinder at the first frame
PAD_LENGTH = 24.0  # mm of the tip that feel

# Joints of a finger from the knuckle to the tip's centre: x, y (mm) and the radius there.
INDEX_JOINTS = ((40, 88, 10.5), (46, 62, 9.3), (41, 36, 9.2), (26, 12, 8.0), (20.5, -8, 7.2))
THUMB_JOINTS = ((2, 100, 14.0), (-33, 76, 12.5), (-42, 48, 11.2), (-29, 14, 9.8), (-22.5, -9, 8.6))
INDEX_CUT, THUMB_CUT = 47.0, 33.0
"""Length from the tip's centre, mm, from which a finger is skin of the hand: at the middle joint, of the thumb at the last."""
FORCE, SPEED, MAX_FORCE = 2.0, 0.02, 10.0  # N on the index finger, m/s, N
MASS = 0.08  # kg, of the cylinder
K, CN, SIGMA0, SIGMA1 = 40.0, 0.4, 20.0, 0.2  # per texel

TEXT = """\
Index finger and thumb (paper, section 5.3, Fig. 13)

Both finger tips are sensors, made of the very meshes of the fingers: any shape will do. They close on a cylinder until the
index finger feels 2 N; then the support under the cylinder sinks away, and friction alone holds it.
"""


def build(scene) -> None:
    """Fill `scene`, which is emptied first; the add-on's classes must be registered."""
    scene_builder.prepare(scene, FRAME_END, FPS)
    index, thumb, cylinder = bodies(scene)
    gripper.close((index, thumb), FORCE, SPEED, MAX_FORCE, ("-X", "X"))
    cylinder.palpate.role, cylinder.palpate.body, cylinder.palpate.mass = "TARGET", "FREE", MASS
    gripper.table(scene, "Support", -HEIGHT / 2, sinks=(TABLE_STARTS, TABLE_GONE))
    scene.palpate.use_auto_dt, scene.palpate.dt = False, 5e-4
    scene.palpate.color_map = "MAGMA"
    scene_builder.add_stage(scene, aim=(0.0, 0.0, 0.0), camera=(-150.0, -210.0, 150.0), size=0.8)
    scene.objects["Backdrop"].location.z = -90.0
    scene.frame_set(scene.frame_start)
    scene_builder.frame_objects(scene, (index, thumb, cylinder), (0.05, 0.05, 0.95, 0.95))
    scene_builder.add_readme(TEXT)
    scene_builder.open_at(scene, index, TABLE_STARTS)


def bodies(scene):
    """Model hand and cylinder; return the two fingers that are sensors, and the cylinder."""
    skin, nail = hand_skin.skin_material(), hand_skin.nail_material()
    fingers, bones = [], []
    for name, joints, side, cut in ((INDEX, INDEX_JOINTS, 1.0, INDEX_CUT), (THUMB, THUMB_JOINTS, -1.0, THUMB_CUT)):
        # The origin of a finger is in its tip, so that its place is where it touches.
        spine = np.array([(x - joints[-1][0], y, 0.0, r) for x, y, r in joints])
        tube = finger_tube.Tube(spine, inwards=(-side, 0.0, 0.0))
        vertices, faces, pad = tube.mesh(PAD_LENGTH, cut + hand_skin.OVERLAP)
        place = (joints[-1][0] + side * GAP, 0.0, 0.0)
        finger = scene_builder.mesh_object(scene, name, vertices, faces, skin, location=place)
        scene_builder.make_tactile(finger, pad, max_penetration=0.006, k=K, cn=CN, sigma0=SIGMA0, sigma1=SIGMA1)
        hand_skin.add_nail(scene, f"{name} nail", tube, finger, nail)
        fingers.append(finger)
        bones.append(tube.bones(cut) + (*finger.location, 0.0))
    hand_skin.add_hand(scene, fingers, bones, skin, nail)
    steel = scene_builder.see_through_steel("Steel, seen through", clear=0.8, edge=0.6)
    return *fingers, scene_builder.cylinder(scene, CYLINDER, RADIUS, HEIGHT, bevel=0.6, look=steel)
