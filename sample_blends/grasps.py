# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's Fig. 10: a sphere, a box, a cylinder and a spray bottle between two tactile fingers.

The object stands on a table that gives a little. The fingers close until each feels the wanted force, the table sinks away,
and the object stays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from . import gripper, scene_builder

FPS = 24
FRAME_END = 72
TABLE_STARTS, TABLE_GONE = 36, 54  # frames
FORCE = 3.0  # N, of each finger
SPEED, MAX_FORCE = 0.03, 20.0  # m/s, N
TABLE = "Table"
HEIGHT = 60.0  # mm, of the pads' middle
START = 10.0  # mm, between object and pads at the first frame
STEEL = ("Steel, seen through", 0.8, 0.6)


@dataclass(frozen=True)
class Object:
    """An object to grasp: how it is built, its half width between the fingers and its lowest point (mm), its mass (kg), and
    by how much longer the fingers are so that it does not touch the gripper (mm).
    """

    name: str
    make: Callable
    reach: float
    foot: float
    mass: float
    room: float = 0.0


def _sphere(scene, name):
    return scene_builder.ball(scene, name, 20.0, look=scene_builder.see_through_steel(*STEEL))


def _box(scene, name):
    return scene_builder.wooden_box(scene, name, (30.0, 44.0, 64.0), bevel=1.2)


def _cylinder(scene, name):
    return scene_builder.cylinder(scene, name, 16.0, 70.0, bevel=0.8, look=scene_builder.see_through_steel(*STEEL))


OBJECTS = {
    "sphere": Object("Sphere", _sphere, 20.0, -20.0, 0.10),
    "box": Object("Box", _box, 15.0, -32.0, 0.16),
    "cylinder": Object("Cylinder", _cylinder, 16.0, -35.0, 0.14),
    "bottle": Object("Spray bottle", gripper.spray_bottle, 16.5, -48.0, 0.15, 22.0),
}

TEXT = """\
Grasping {what} (paper, section 5.2.1, Fig. 10)

Two fingers with a 14 x 6 pad each close on the object until each feels 3 N, by force control on the sum of its texels. The
table then sinks away, and friction alone holds the object.
"""


def build(scene, kind: str) -> None:
    """Fill `scene`, which is emptied first, with the grasp of one of `OBJECTS`; the add-on's classes must be registered."""
    scene_builder.prepare(scene, FRAME_END, FPS)
    look = gripper.materials()
    thing = OBJECTS[kind]
    fingers = [gripper.finger(scene, side, thing.reach + START, HEIGHT, look, thing.room) for side in (-1, 1)]
    gripper.close(fingers, FORCE, SPEED, MAX_FORCE)
    gripper.housing(scene, HEIGHT + thing.room, look)
    obj = thing.make(scene, thing.name)
    obj.location = (0.0, 0.0, HEIGHT)
    obj.palpate.role, obj.palpate.body, obj.palpate.mass = "TARGET", "FREE", thing.mass
    gripper.table(scene, TABLE, HEIGHT + thing.foot, sinks=(TABLE_STARTS, TABLE_GONE))
    scene.palpate.use_auto_dt, scene.palpate.dt = False, 5e-4
    scene.palpate.color_map = "MAGMA"
    scene_builder.add_stage(scene, aim=(0.0, 0.0, HEIGHT), camera=(150.0, -270.0, 150.0), size=0.8)
    scene.frame_set(scene.frame_start)
    shown = [obj, *obj.children, *fingers, *(part for pad in fingers for part in pad.children)]
    scene_builder.frame_objects(scene, shown, (0.04, 0.04, 0.96, 0.96))
    scene_builder.add_readme(TEXT.format(what=f"a {thing.name.lower()}"))
    scene_builder.open_at(scene, fingers[0], TABLE_STARTS)
