# SPDX-License-Identifier: GPL-3.0-or-later
"""A parallel gripper like a Schunk PG70 with a 14 × 6 tactile pad on each finger, and objects to grasp.

The fingers close along x; the rows of the pads run upwards. Lengths are millimetres.
"""

from __future__ import annotations

import math

import numpy as np

from . import scene_builder

ROWS, COLUMNS, PITCH = 14, 6, 3.4
FINGER_MASS = 0.3  # kg
FINGER_DAMPING = 60.0
"""N·s/m: about 2 √(m k) of a finger on its foam, so that the force of a grasp settles quickly without oscillation."""
PAD_WIDE, PAD_TALL = (COLUMNS - 1) * PITCH, (ROWS - 1) * PITCH
MARGIN, THICKNESS = 0.5 * PITCH + 1.0, 6.0
LEFT, RIGHT = "Left finger", "Right finger"

K, CN, SIGMA0, SIGMA1 = 58.5, 0.585, 30.0, 0.3
"""The paper's foam, with 1 % damping and bristles half as stiff as the foam: with Table 2's 1 N/m a grasped object would sink
by a centimetre before friction holds it."""


def materials() -> dict:
    """Return the gripper's materials by name."""
    return {
        "rubber": scene_builder.material("Rubber", (0.035, 0.036, 0.04), roughness=0.55),
        "grey": scene_builder.material("Grey anodised", (0.21, 0.22, 0.24), metallic=0.6, roughness=0.4),
        "aluminium": scene_builder.material("Aluminium", (0.55, 0.57, 0.6), metallic=1.0, roughness=0.34),
    }


def finger(scene, side: int, gap: float, height: float, look: dict, room: float = 0.0):
    """Return one finger's pad, a sensor, with its block as a child.

    Parameters
    ----------
    side : {-1, 1}
        The left finger stands at x < 0 and faces +x.
    gap : float, mm
        Distance from the pad's surface to the middle plane.
    height : float, mm
        Height of the pad's centre.
    room : float, mm
        By which the finger is longer, for an object that is high above the pads.
    """
    from mathutils import Matrix

    name = LEFT if side < 0 else RIGHT
    grid = (ROWS, COLUMNS, PITCH, MARGIN, THICKNESS)
    pad = scene_builder.pad(scene, name, look["rubber"], *grid, rounding=0.8, k=K, cn=CN, sigma0=SIGMA0, sigma1=SIGMA1)
    # Columns of the rotation: the pad's own x, y and z axis in the world. The pad faces inwards, and its rows run upwards.
    inwards = -float(side)
    turn = Matrix(((0.0, 0.0, inwards), (inwards, 0.0, 0.0), (0.0, 1.0, 0.0)))
    pad.rotation_euler = turn.to_euler()
    pad.location = (side * gap, 0.0, height)

    tall = PAD_TALL + 2 * MARGIN
    wide = PAD_WIDE + 2 * MARGIN + 3
    for part, kind, size, place in (
        ("block", "grey", (wide, tall + 34 + room, 9.0), (0.0, 15.0 + 0.5 * room, -THICKNESS - 4.0)),
        ("foot", "aluminium", (wide, 14.0, 26.0), (0.0, tall / 2 + 27.0 + room, -THICKNESS - 6.0)),
    ):
        scene_builder.box(scene, f"{name} {part}", size, bevel=1.6, look=look[kind], parent=pad, location=place)
    return pad


def housing(scene, height: float, look: dict):
    """Return the gripper's body, which carries both fingers; `height` (mm) is the height of the pads' centres."""
    z = height + (PAD_TALL + 2 * MARGIN) / 2 + 27.0 + 7.0 + 21.0
    body = scene_builder.box(scene, "Gripper", (150.0, 56.0, 42.0), bevel=4.0, look=look["aluminium"], location=(0.0, 0.0, z))
    below, above = ({"look": look["grey"], "parent": body, "location": (0.0, 0.0, height)} for height in (-20.0, 30.0))
    scene_builder.box(scene, "Gripper rail", (140.0, 30.0, 8.0), bevel=1.0, **below)
    scene_builder.cylinder(scene, "Gripper flange", 24.0, 20.0, bevel=1.5, **above)
    return body


def spray_bottle(scene, name: str):
    """Return a spray bottle; its origin is in its waist, where the fingers grasp it; head and trigger are children."""
    t = np.linspace(0.0, 1.0, 33)
    body = [(21.0, -48.0), (23.5, -46.5), (24.0, -44.0)]
    # From the belly through the waist to the shoulder: one smooth wave, then a quarter turn up to the neck.
    body += [(24.0 - 6.5 * math.sin(math.pi * s) ** 2 - 2.0 * s, -44.0 + 78.0 * s) for s in t[1:]]
    body += [(8.0 + 14.0 * math.cos(a), 34.0 + 10.0 * math.sin(a)) for a in np.linspace(0.0, math.pi / 2, 9)[1:]]
    body += [(8.0, 52.0)]
    plastic = scene_builder.see_through_steel("Blue plastic, seen through", clear=0.75, edge=0.8)
    shader = plastic.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value, shader.inputs["Metallic"].default_value = (0.05, 0.22, 0.6, 1.0), 0.0
    bottle = scene_builder.mesh_object(scene, name, *scene_builder.surface_of_revolution(body), plastic)
    white = scene_builder.material("White plastic", (0.8, 0.8, 0.78), roughness=0.4)
    place = {"look": white, "parent": bottle}
    scene_builder.cylinder(scene, f"{name} cap", 10.5, 12.0, bevel=0.8, location=(0.0, 0.0, 57.0), **place)
    scene_builder.box(scene, f"{name} head", (13.0, 42.0, 13.0), bevel=3.0, location=(0.0, -9.0, 69.0), **place)
    trigger = scene_builder.box(scene, f"{name} trigger", (6.0, 4.0, 24.0), bevel=1.2, location=(0.0, -21.0, 54.0), **place)
    trigger.rotation_euler = (math.radians(-24), 0.0, 0.0)
    nozzle = scene_builder.cylinder(scene, f"{name} nozzle", 3.4, 7.0, bevel=0.5, location=(0.0, -32.5, 69.0), **place)
    nozzle.rotation_euler = (math.pi / 2, 0.0, 0.0)
    return bottle


def close(fingers, grip, speed: float, max_force: float, axes=("Z", "Z")) -> None:
    """Let two coupled fingers close along axes of their own, by control of the force on the first of them.

    Parameters
    ----------
    fingers : two objects
    grip : float or sequence of (frame, float), N
        Wanted tactile sum; zero opens the fingers.
    speed : float, m/s
        Until the first touch.
    max_force : float, N
        Of the motor, on each finger.
    axes : two of str
        Local axis of each finger, as "Z" or "-X".
    """
    first = fingers[0]
    for pad, axis in zip(fingers, axes, strict=True):
        settings = pad.palpate
        settings.body, settings.mass = "DRIVEN", FINGER_MASS
        settings.drive_control, settings.drive_axis, settings.drive_space = "FORCE", axis, "LOCAL"
        settings.drive_max_speed, settings.drive_max_force = speed, max_force
        settings.drive_damping = FINGER_DAMPING
        if pad != first:
            settings.drive_leader = first
    for frame, force in ((1, grip),) if isinstance(grip, float) else grip:
        first.palpate.drive_force = force
        if not isinstance(grip, float):
            first.keyframe_insert("palpate.drive_force", frame=frame)
    scene_builder.use_constant_interpolation(first)


def mount(arm, fingers) -> None:
    """Make fingers children of an arm without moving them."""
    import bpy

    bpy.context.view_layer.update()
    for pad in fingers:
        pad.parent = arm
        pad.matrix_parent_inverse = arm.matrix_world.inverted()


def table(scene, name: str, height: float, sinks: tuple[int, int] | None = None):
    """Return a table with its top at `height` (mm): a compliant pad that is not read out.

    `sinks` are the frames between which it sinks away.
    """
    look = scene_builder.material("Table", (0.2, 0.21, 0.23), roughness=0.6)
    given = {"role": "PAD", "group": "top", "k": 300.0, "cn": 6.0, "sigma0": 150.0, "sigma1": 1.5}
    made = scene_builder.pad(scene, name, look, 15, 15, 4.0, 8.0, 8.0, rounding=1.0, **given)
    made.location = (0.0, 0.0, height)
    for frame, drop in () if sinks is None else ((1, 0.0), (sinks[0], 0.0), (sinks[1], 45.0)):
        scene_builder.keyframe(made, frame, (0.0, 0.0, height - drop))
    return made
