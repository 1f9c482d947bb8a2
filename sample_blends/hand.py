# SPDX-License-Identifier: GPL-3.0-or-later
"""Index finger and thumb of a scripted hand hold a cylinder between their tips (paper, section 5.3, Fig. 13).

The hand lies flat: palm at +y, finger tips at the origin, the cylinder upright between them.
"""

from __future__ import annotations

import math

import numpy as np

from . import gripper, scene_builder

FPS = 24
FRAME_END = 72
TABLE_STARTS, TABLE_GONE = 36, 54  # frames
INDEX, THUMB, CYLINDER = "Index finger", "Thumb", "Cylinder"
RADIUS, HEIGHT = 12.0, 60.0  # mm, of the cylinder
GAP = 4.0  # mm, between finger tips and cylinder at the first frame
SIDES, STEP = 28, 2.0  # texels around a finger; mm between rings of texels
PAD_LENGTH = 24.0  # mm of the tip that feel

# Joints of a finger from the knuckle to the tip's centre: x, y (mm) and the radius there.
INDEX_JOINTS = ((40, 88, 10.5), (46, 62, 9.3), (41, 36, 9.2), (26, 12, 8.0), (20.5, -8, 7.2))
THUMB_JOINTS = ((2, 100, 14.0), (-33, 76, 12.5), (-42, 48, 11.2), (-29, 14, 9.8), (-22.5, -9, 8.6))
# The three others, curled out of the way, only to be looked at: x, y, z, radius.
CURLED = (
    ((24, 92, 2, 10.0), (30, 62, 12, 9.2), (28, 44, -8, 8.8), (22, 62, -26, 8.0), (20, 78, -24, 7.0)),
    ((8, 92, 2, 9.6), (12, 64, 13, 8.8), (11, 47, -7, 8.4), (8, 64, -25, 7.6), (7, 79, -23, 6.6)),
    ((-8, 90, 1, 8.6), (-6, 68, 11, 7.8), (-6, 54, -6, 7.4), (-6, 68, -22, 6.6), (-6, 80, -20, 5.8)),
)


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
    for finger in (index, thumb):
        settings = finger.palpate
        settings.role, settings.region, settings.vertex_group = "SENSOR", "GROUP", "tactile"
        settings.max_penetration = 0.006
        settings.k, settings.cn, settings.sigma0, settings.sigma1 = K, CN, SIGMA0, SIGMA1
    gripper.drive((index, thumb), FORCE, SPEED, MAX_FORCE, ("-X", "X"))
    cylinder.palpate.role, cylinder.palpate.body, cylinder.palpate.mass = "TARGET", "FREE", MASS
    table = gripper.table(scene, "Support", -HEIGHT / 2)
    for frame, drop in ((1, 0.0), (TABLE_STARTS, 0.0), (TABLE_GONE, 45.0)):
        table.location.z = -HEIGHT / 2 - drop
        table.keyframe_insert("location", frame=frame)
    scene.palpate.use_auto_dt, scene.palpate.dt = False, 5e-4
    scene.palpate.color_map = "MAGMA"
    paper = scene_builder.material("Backdrop", (0.30, 0.32, 0.35), roughness=0.85)
    scene_builder.add_stage(scene, paper, aim=(0.0, 0.0, 0.0), camera=(-150.0, -210.0, 150.0), size=0.8)
    scene.objects["Backdrop"].location.z = -90.0
    scene.frame_set(scene.frame_start)
    scene_builder.frame_objects(scene, (index, thumb, cylinder), (0.05, 0.05, 0.95, 0.95))
    scene_builder.add_readme(TEXT)


def bodies(scene):
    """Model hand and cylinder; return the two fingers that are sensors, and the cylinder."""
    skin = scene_builder.material("Skin", (0.72, 0.42, 0.30), roughness=0.45)
    fingers = []
    for name, joints, side in ((INDEX, INDEX_JOINTS, 1.0), (THUMB, THUMB_JOINTS, -1.0)):
        spine = np.array([(x, y, 0.0, r) for x, y, r in joints])
        vertices, faces, pad = sweep(spine, inwards=(-side, 0.0, 0.0))
        # The origin of a finger is in its tip, so that its place is where it touches.
        vertices = vertices - np.array([spine[-1, 0], 0.0, 0.0])
        finger = scene_builder.mesh_object(scene, name, vertices, faces)
        finger.location = (spine[-1, 0] + side * GAP, 0.0, 0.0)
        finger.data.materials.append(skin)
        finger.vertex_groups.new(name="tactile").add([int(i) for i in pad], 1.0, "REPLACE")
        fingers.append(finger)
    for number, joints in enumerate(CURLED):
        vertices, faces, _ = sweep(np.array(joints, float), inwards=(0.0, 0.0, -1.0))
        scene_builder.mesh_object(scene, f"Finger {number + 3}", vertices, faces).data.materials.append(skin)
    palm = scene_builder.box(scene, "Palm", (70.0, 88.0, 27.0), bevel=12.0)
    palm.location, palm.rotation_euler = (14.0, 130.0, -2.0), (0.0, 0.0, math.radians(6))
    palm.data.materials.append(skin)
    cylinder = scene_builder.cylinder(scene, CYLINDER, RADIUS, HEIGHT, bevel=0.6)
    cylinder.data.materials.append(scene_builder.see_through_steel("Steel, seen through", clear=0.8, edge=0.6))
    return *fingers, cylinder


def sweep(spine: np.ndarray, inwards) -> tuple[np.ndarray, list, np.ndarray]:
    """Return a rounded tube along a smooth spine: vertices, faces, and the vertices of its tip's inner side.

    Parameters
    ----------
    spine : (m, 4) float, mm
        Points and radii from the root to the centre of the tip's round end.
    inwards : (3,) float
        Direction that the tip's inner side faces.
    """
    points, radii, along = _smooth(spine)
    frames = _frames(points, np.asarray(inwards, float))
    # Past the spine's end the radius falls like a circle's, so the tip is round.
    tip = radii[-1]
    cap = np.arange(1, 6) / 6 * math.pi / 2
    heading = frames[-1][0]
    centres = np.vstack([points, points[-1] + tip * np.sin(cap)[:, None] * heading])
    sizes = np.concatenate([radii, tip * np.cos(cap)])
    turns = [*frames, *[frames[-1]] * len(cap)]
    angle = np.arange(SIDES) * 2 * math.pi / SIDES
    rings = [
        centre + size * (np.cos(angle)[:, None] * inner + np.sin(angle)[:, None] * np.cross(ahead, inner))
        for centre, size, (ahead, inner) in zip(centres, sizes, turns, strict=True)
    ]
    vertices = np.vstack([*rings, centres[-1] + heading * (tip - tip * math.sin(cap[-1]))])
    last = len(rings) - 1
    faces = [
        (j * SIDES + i, j * SIDES + (i + 1) % SIDES, (j + 1) * SIDES + (i + 1) % SIDES, (j + 1) * SIDES + i)
        for j in range(last)
        for i in range(SIDES)
    ]
    faces += [(last * SIDES + i, last * SIDES + (i + 1) % SIDES, len(vertices) - 1) for i in range(SIDES)]
    faces.append(tuple(range(SIDES - 1, -1, -1)))
    feels = np.flatnonzero(np.concatenate([along, np.full(len(cap) - 2, along[-1])]) > along[-1] - PAD_LENGTH)
    near = np.flatnonzero(np.cos(angle) > math.cos(math.radians(80)))
    return vertices, faces, (feels[:, None] * SIDES + near).ravel()


def _smooth(spine: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points, radii and arc lengths every `STEP` mm along a curve through the joints."""
    from scipy.interpolate import CubicSpline

    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(spine[:, :3], axis=0), axis=1))])
    curve = CubicSpline(chord, spine)
    fine = curve(np.linspace(0.0, chord[-1], 400))
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine[:, :3], axis=0), axis=1))])
    wanted = np.linspace(0.0, length[-1], round(length[-1] / STEP) + 1)
    found = np.stack([np.interp(wanted, length, fine[:, i]) for i in range(4)], axis=1)
    return found[:, :3], found[:, 3], wanted


def _frames(points: np.ndarray, inwards: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return tangent and inner direction at each point; the latter is transported from the tip to the root without twist."""
    ahead = np.gradient(points, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    frames, inner = [], inwards
    for heading in ahead[::-1]:
        inner = inner - (inner @ heading) * heading
        inner = inner / np.linalg.norm(inner)
        frames.append((heading, inner))
    return frames[::-1]
