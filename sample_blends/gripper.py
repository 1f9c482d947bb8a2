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
    vertices, faces, texels = scene_builder.pad_mesh(ROWS, COLUMNS, PITCH, MARGIN, THICKNESS, rounding=0.8)
    pad = scene_builder.mesh_object(scene, name, vertices, faces)
    pad.data.materials.append(look["rubber"])
    pad.vertex_groups.new(name="tactile").add(texels, 1.0, "REPLACE")
    # Columns of the rotation: the pad's own x, y and z axis in the world. The pad faces inwards, and its rows run upwards.
    inwards = -float(side)
    turn = Matrix(((0.0, 0.0, inwards), (inwards, 0.0, 0.0), (0.0, 1.0, 0.0)))
    pad.rotation_euler = turn.to_euler()
    pad.location = (side * gap, 0.0, height)

    tall = PAD_TALL + 2 * MARGIN
    block = scene_builder.box(scene, f"{name} block", (PAD_WIDE + 2 * MARGIN + 3, tall + 34 + room, 9.0), bevel=1.6)
    block.parent, block.location = pad, (0.0, 15.0 + 0.5 * room, -THICKNESS - 4.0)
    block.data.materials.append(look["grey"])
    foot = scene_builder.box(scene, f"{name} foot", (PAD_WIDE + 2 * MARGIN + 3, 14.0, 26.0), bevel=1.6)
    foot.parent, foot.location = pad, (0.0, tall / 2 + 27.0 + room, -THICKNESS - 6.0)
    foot.data.materials.append(look["aluminium"])

    settings = pad.palpate
    settings.role, settings.region, settings.vertex_group = "SENSOR", "GROUP", "tactile"
    settings.k, settings.cn, settings.sigma0, settings.sigma1 = K, CN, SIGMA0, SIGMA1
    return pad


def housing(scene, height: float, look: dict):
    """Return the gripper's body, which carries both fingers; `height` (mm) is the height of the pads' centres."""
    z = height + (PAD_TALL + 2 * MARGIN) / 2 + 27.0 + 7.0 + 21.0
    body = scene_builder.box(scene, "Gripper", (150.0, 56.0, 42.0), bevel=4.0)
    body.location = (0.0, 0.0, z)
    body.data.materials.append(look["aluminium"])
    rail = scene_builder.box(scene, "Gripper rail", (140.0, 30.0, 8.0), bevel=1.0)
    rail.parent, rail.location = body, (0.0, 0.0, -20.0)
    rail.data.materials.append(look["grey"])
    flange = scene_builder.cylinder(scene, "Gripper flange", 24.0, 20.0, bevel=1.5)
    flange.parent, flange.location = body, (0.0, 0.0, 30.0)
    flange.data.materials.append(look["grey"])
    return body


def surface_of_revolution(profile, sides: int = 64):
    """Return vertices and faces of a body of revolution about z, closed at both ends.

    Parameters
    ----------
    profile : (m, 2) float, mm
        Radius and height, from the bottom up; radii above zero.
    """
    profile = np.asarray(profile, float)
    angle = np.arange(sides) * 2 * math.pi / sides
    rings = [np.stack([r * np.cos(angle), r * np.sin(angle), np.full(sides, z)], axis=1) for r, z in profile]
    faces = [
        (j * sides + i, j * sides + (i + 1) % sides, (j + 1) * sides + (i + 1) % sides, (j + 1) * sides + i)
        for j in range(len(profile) - 1)
        for i in range(sides)
    ]
    top = (len(profile) - 1) * sides
    faces += [tuple(range(sides - 1, -1, -1)), tuple(range(top, top + sides))]
    return np.concatenate(rings), faces


def spray_bottle(scene, name: str):
    """Return a spray bottle; its origin is in its waist, where the fingers grasp it; head and trigger are children."""
    t = np.linspace(0.0, 1.0, 33)
    body = [(21.0, -48.0), (23.5, -46.5), (24.0, -44.0)]
    # From the belly through the waist to the shoulder: one smooth wave, then a quarter turn up to the neck.
    body += [(24.0 - 6.5 * math.sin(math.pi * s) ** 2 - 2.0 * s, -44.0 + 78.0 * s) for s in t[1:]]
    body += [(8.0 + 14.0 * math.cos(a), 34.0 + 10.0 * math.sin(a)) for a in np.linspace(0.0, math.pi / 2, 9)[1:]]
    body += [(8.0, 52.0)]
    vertices, faces = surface_of_revolution(body)
    bottle = scene_builder.mesh_object(scene, name, vertices, faces)
    plastic = scene_builder.see_through_steel("Blue plastic, seen through", clear=0.75, edge=0.8)
    shader = plastic.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value, shader.inputs["Metallic"].default_value = (0.05, 0.22, 0.6, 1.0), 0.0
    bottle.data.materials.append(plastic)
    white = scene_builder.material("White plastic", (0.8, 0.8, 0.78), roughness=0.4)
    cap = scene_builder.cylinder(scene, f"{name} cap", 10.5, 12.0, (0.0, 0.0, 57.0), bevel=0.8)
    head = scene_builder.box(scene, f"{name} head", (13.0, 42.0, 13.0), bevel=3.0)
    head.location = (0.0, -9.0, 69.0)
    trigger = scene_builder.box(scene, f"{name} trigger", (6.0, 4.0, 24.0), bevel=1.2)
    trigger.location, trigger.rotation_euler = (0.0, -21.0, 54.0), (math.radians(-24), 0.0, 0.0)
    nozzle = scene_builder.cylinder(scene, f"{name} nozzle", 3.4, 7.0, (0.0, -32.5, 69.0), bevel=0.5)
    nozzle.rotation_euler = (math.pi / 2, 0.0, 0.0)
    for part in (cap, head, trigger, nozzle):
        part.parent = bottle
        part.data.materials.append(white)
    return bottle


def close(fingers, grip, speed: float, max_force: float) -> None:
    """Let two coupled fingers close along their own z axes, by control of the force on the first of them.

    Parameters
    ----------
    fingers : two objects
    grip : float or sequence of (frame, float), N
        Wanted tactile sum; zero opens the fingers.
    speed : float, m/s
        Until the first touch.
    max_force : float, N
        Of the motor, on each finger.
    """
    drive(fingers, grip, speed, max_force, ("Z", "Z"))


def drive(fingers, grip, speed: float, max_force: float, axes) -> None:
    """Let fingers close along axes of their own, the second one coupled to the first."""
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


def table(scene, name: str, height: float):
    """Return a table with its top at `height` (mm): a compliant pad that is not read out."""
    vertices, faces, texels = scene_builder.pad_mesh(15, 15, 4.0, 8.0, 8.0, rounding=1.0)
    made = scene_builder.mesh_object(scene, name, vertices, faces)
    made.location = (0.0, 0.0, height)
    made.vertex_groups.new(name="top").add(texels, 1.0, "REPLACE")
    made.data.materials.append(scene_builder.material("Table", (0.2, 0.21, 0.23), roughness=0.6))
    settings = made.palpate
    settings.role, settings.region, settings.vertex_group = "PAD", "GROUP", "top"
    settings.k, settings.cn, settings.sigma0, settings.sigma1 = 300.0, 6.0, 150.0, 1.5
    return made
