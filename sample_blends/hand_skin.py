# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin, nails and sleeve of the hand in :mod:`.hand`: bones of a left hand with flesh around them.

Fingers point towards -y, the back of the hand is at +x, and the index finger is on top. Lengths are millimetres.
"""

from __future__ import annotations

import math

import bpy
import numpy as np

from ..addon.display.materials import NodeAdder
from . import hand_surface, scene_builder
from .finger_tube import Tube

OVERLAP, PROUD = 8.0, 0.35
"""Length by which a sensor reaches into the skin, and height of the skin over it where it ends, as of a crease, mm."""
CURLED = (
    ((43, 86, -21), (45, 27, 21), 8.6, 32.0),
    ((40, 92, -41), (42, 25, 21), 8.2, 42.0),
    ((33, 100, -58), (33, 19, 18), 7.2, 48.0),
)
"""Middle, ring and little finger: place of the knuckle, lengths of its bones, radius (mm), angle at the knuckle (degrees)."""
BENDS = (92.0, 48.0)
"""Angles at the two outer joints of a curled finger, degrees."""
PALM = (
    ((38, 92, -1, 10.5), (24, 156, -16, 14)),  # metacarpals
    ((40, 90, -21, 10.5), (25, 156, -25, 14)),
    ((37, 95, -40, 10), (23, 156, -33, 14)),
    ((31, 102, -56, 9.5), (19, 156, -42, 13)),
    ((-20, 96, -1, 13), (2, 128, -12, 16), (16, 152, -18, 15)),  # ball of the thumb
    ((22, 114, -58, 10), (14, 150, -46, 13)),  # edge of the hand
    ((27, 104, -3, 7), (-4, 108, -2, 7)),  # web between thumb and index finger
    ((20, 160, -19, 15.5), (12, 214, -20, 18)),  # wrist
    ((20, 160, -37, 15.5), (12, 214, -41, 19)),
)
"""Bones of palm and wrist with the flesh around them: chains of x, y, z and radius."""
PALM_BLEND, FINGER_BLEND, TOUCH_BLEND = 12.0, 9.0, 1.0
"""Widths over which bones of the palm, palm and fingers, and fingers that touch run into one another, mm."""
LOW, HIGH = (-62.0, -2.0, -80.0), (66.0, 236.0, 22.0)
CELL = 2.8
"""Box around the skin, and width of its cells, mm."""
NAIL_ANGLE, NAIL_BACK, NAIL_AHEAD = 50.0, 1.25, 0.74
"""Half of a nail's width around the finger, degrees; its length behind and before the tip's centre, in radii of the tip."""
NAIL_HEIGHT, NAIL_SINK = 0.4, 0.25
"""Height of a nail over the skin in its middle, and depth of its edges, mm."""
SLEEVE = ((-1.0, 204.0), (0.5, 196.0), (2.0, 194.5), (3.2, 196.0), (3.6, 204.0), (3.6, 245.0), (-12.0, 246.0))
"""Profile of the sleeve: distance from the forearm, and y."""


def skin_material():
    """Return a material of skin: light goes into it, and its colour and height vary a little."""
    depth = {"Subsurface_Weight": 0.25, "Subsurface_Radius": (3.0, 1.0, 0.5), "Subsurface_Scale": 1.0}
    made = scene_builder.material("Skin", (0.55, 0.30, 0.20), roughness=0.5, **depth)
    add, shader = NodeAdder(made.node_tree), made.node_tree.nodes["Principled BSDF"]
    place = add("ShaderNodeTexCoord", output="Object")
    fine, coarse = (add("ShaderNodeTexNoise", {"Scale": scale, "Detail": 4.0, "Vector": place}) for scale in (1.6, 0.045))
    bump = add("ShaderNodeBump", {"Strength": 0.25, "Distance": 0.3, "Height": fine}, "Normal")
    color = add("ShaderNodeValToRGB", {"Fac": coarse}, "Color")
    colors = ((0.35, (0.47, 0.22, 0.15, 1.0)), (0.70, (0.60, 0.35, 0.25, 1.0)))
    for element, (share, value) in zip(color.node.color_ramp.elements, colors, strict=True):
        element.position, element.color = share, value
    add.feed(shader, {"Normal": bump, "Base Color": color})
    return made


def nail_material():
    """Return a material of nails."""
    return scene_builder.material("Nail", (0.66, 0.40, 0.33), roughness=0.2)


def add_hand(scene, fingers, bones, skin, nail):
    """Add the skin of the hand, with nails and a sleeve.

    Parameters
    ----------
    scene : Scene
    fingers : list of Object
        Index finger and thumb, which the skin follows.
    bones : list of (n, 4) float, mm
        Points and radii of each from its knuckle to where its own mesh begins.
    skin, nail : Material
    """
    curled = [_curled(*row) for row in CURLED]
    vertices, faces = hand_surface.surface_net(_field(bones, curled), LOW, HIGH, CELL)
    hand = scene_builder.mesh_object(scene, "Hand", vertices, faces, skin)
    bpy.context.view_layer.update()
    for finger, chain in zip(fingers, bones, strict=True):
        _follow(hand, finger, _weights(vertices, chain))
    smooth = hand.modifiers.new("Subdivide", "SUBSURF")
    smooth.levels, smooth.render_levels = 0, 1
    for name, (joints, inwards) in zip(("Middle finger", "Ring finger", "Little finger"), curled, strict=True):
        add_nail(scene, f"{name} nail", Tube(joints[-2:], inwards), hand, nail)
    _add_sleeve(scene, hand)


def add_nail(scene, name: str, tube: Tube, parent, nail) -> None:
    """Add the nail of a finger, as a part of an object in whose frame the tube is."""
    tip = float(tube.radii[-1])
    across, along = np.linspace(-1.0, 1.0, 17), np.linspace(0.0, 1.0, 15)
    vertices = []
    for share in along:
        centre, radius, heading, inner = tube.section(tip * (share * (NAIL_BACK + NAIL_AHEAD) - NAIL_BACK))
        side = np.cross(heading, inner)
        # its root is half round, its free edge less so, and it bends down a little ahead
        wide = math.sqrt(max(0.0, 1.0 - max(0.0, 1.0 - share / 0.4) ** 2)) * (1.0 if share < 0.9 else 0.985)
        fall = 0.25 * tip * max(0.0, share - 0.5) ** 2 / 0.25
        for place in across:
            height = NAIL_HEIGHT - (NAIL_HEIGHT + NAIL_SINK) * max(place**6, (1.0 - min(1.0, share / 0.25)) ** 2)
            angle = math.radians(NAIL_ANGLE) * place * wide
            out = -math.cos(angle) * inner + math.sin(angle) * side
            bow = 0.12 * tip * place**2 * max(0.0, share - 0.7) / 0.3
            vertices.append(centre + (radius + height - fall) * out - bow * heading)
    count = len(across)
    faces = [
        (i * count + j, i * count + j + 1, (i + 1) * count + j + 1, (i + 1) * count + j)
        for i in range(len(along) - 1)
        for j in range(count - 1)
    ]
    scene_builder.mesh_object(scene, name, vertices, faces, nail, parent=parent)


def _curled(knuckle, lengths, radius: float, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (4, 4) joints and radii of a finger that is bent towards the palm, and where the inner side of its tip faces."""
    turns = np.radians(np.cumsum([angle, *BENDS]))
    ways = np.column_stack([-np.sin(turns), -np.cos(turns), np.zeros(3)]) * np.array(lengths)[:, None]
    points = np.vstack([knuckle, np.array(knuckle) + np.cumsum(ways, axis=0)])
    joints = np.column_stack([points, radius * np.array([1.15, 1.06, 0.97, 0.84])])
    return joints, np.array([-math.cos(turns[-1]), math.sin(turns[-1]), 0.0])


def _field(bones, curled) -> hand_surface.Field:
    """Return the field of the whole hand; index finger and thumb end where their own meshes begin."""
    palm = hand_surface.union([hand_surface.tapered(np.array(chain, float)) for chain in PALM], PALM_BLEND)
    parts = [hand_surface.tapered(joints) for joints, _ in curled]
    for chain in bones:
        ahead = chain[-1, :3] - chain[-2, :3]
        longer = np.vstack([chain, chain[-1] + (*ahead, 0.0)]) + (0.0, 0.0, 0.0, PROUD)
        parts.append(hand_surface.cut_off(hand_surface.tapered(longer), chain[-1, :3], ahead / np.linalg.norm(ahead)))
    return hand_surface.union([hand_surface.union([palm, part], FINGER_BLEND) for part in parts], TOUCH_BLEND)


def _weights(vertices: np.ndarray, chain: np.ndarray) -> np.ndarray:
    """Return how far vertices of the skin follow a finger, (n,): not at its knuckle, wholly where its own mesh begins."""
    apart = np.linalg.norm(vertices[:, None] - chain[None, :, :3], axis=2) - chain[:, 3]
    nearest = apart.argmin(axis=1)
    share = np.clip((nearest / (len(chain) - 1) - 0.1) / 0.7, 0.0, 1.0)
    close = np.clip(1.5 - apart.min(axis=1) / 4.0, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share) * close


def _follow(hand, finger, weights: np.ndarray) -> None:
    """Let vertices of the hand move with a finger, by weights."""
    group = hand.vertex_groups.new(name=finger.name)
    for level in np.unique(np.round(weights, 2)):
        if level > 0.0:
            group.add([int(i) for i in np.flatnonzero(np.round(weights, 2) == level)], float(level), "REPLACE")
    hook = hand.modifiers.new(finger.name, "HOOK")
    hook.object, hook.vertex_group, hook.falloff_type = finger, group.name, "NONE"
    hook.matrix_inverse = finger.matrix_world.inverted()


def _add_sleeve(scene, hand) -> None:
    """Add the end of a sleeve around the forearm, as a part of the hand."""
    (x0, y0, top, *_), (x1, y1, high, radius) = PALM[-2]
    low = PALM[-1][1][2]
    angle = np.arange(48) * 2 * math.pi / 48
    vertices = []
    for out, y in SLEEVE:
        middle = x0 + (x1 - x0) * (y - y0) / (y1 - y0)
        wide, tall = radius + 2.5 + out, 0.5 * (high - low) + radius + 2.5 + out
        z = 0.5 * (high + low) + 1.5
        vertices += [(middle + wide * math.cos(a), y, z + tall * math.sin(a)) for a in angle]
    faces = [(a, d, c, b) for a, b, c, d in scene_builder.tube_faces(len(SLEEVE), 48)]
    faces.append(tuple((len(SLEEVE) - 1) * 48 + i for i in range(48)))
    cloth = scene_builder.material("Cloth", (0.05, 0.09, 0.16), roughness=0.9)
    scene_builder.mesh_object(scene, "Sleeve", vertices, faces, cloth, parent=hand)
