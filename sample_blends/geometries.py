# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's Fig. 1 to 3: sensors from a grid, a sphere and a fingertip, with needles that show the texels' normals."""

from __future__ import annotations

import math

import numpy as np

from . import fingertip, scene_builder

FPS = 24
FRAME_END = 24
GRID, SPHERE, TIP = "Grid", "Sphere", "Fingertip"
SPHERE_RADIUS, BALL_RADIUS = 12.0, 7.0  # mm
NEEDLE = 5.0  # mm, as long as the deepest penetration
FOAM = {"max_penetration": 1e-3 * NEEDLE, "k": 30.0, "cn": 0.3}

TEXT = """\
Any mesh is a sensor (paper, section 3.1, Fig. 1 to 3)

A grid, a sphere and a fingertip. Each vertex is a texel; the needles are the texels' normals, the sum of the unit normals of
the triangles around the vertex, as long as the maximum penetration. A ball is pressed on each.
"""


def build(scene) -> None:
    """Fill `scene`, which is emptied first; the add-on's classes must be registered."""
    scene_builder.prepare(scene, FRAME_END, FPS)
    rubber = scene_builder.material("Rubber", (0.10, 0.16, 0.22), roughness=0.6)
    needle = scene_builder.material("Normals", (0.85, 0.35, 0.06), roughness=0.5)
    sensors = [_grid(scene, rubber), _sphere(scene, rubber), _tip(scene, rubber)]
    steel = scene_builder.see_through_steel("Steel, seen through", clear=0.75, edge=0.8)
    for sensor, top in sensors:
        scene_builder.add_normal_needles(scene, sensor, NEEDLE, needle)
        ball = scene_builder.ball(scene, f"Ball on {sensor.name}", BALL_RADIUS, look=steel)
        ball.palpate.role = "TARGET"
        for frame, depth in ((1, -16.0), (14, 2.0), (24, 2.0)):
            scene_builder.keyframe(ball, frame, (sensor.location.x, sensor.location.y, top + BALL_RADIUS - depth))
    scene_builder.add_stage(scene, aim=(0.0, 0.0, 15.0), camera=(60.0, -230.0, 150.0), size=0.6)
    scene.frame_set(scene.frame_start)
    scene_builder.frame_objects(scene, [sensor for sensor, _ in sensors], region=(0.06, 0.06, 0.94, 0.70), size=(1100, 600))
    scene_builder.add_readme(TEXT)
    scene_builder.open_at(scene, scene.objects[GRID], FRAME_END)


def _grid(scene, rubber):
    sensor = scene_builder.pad(scene, GRID, rubber, 10, 10, 3.0, 4.0, 6.0, **FOAM)
    sensor.location = (-26.0, 16.0, 14.0)
    return sensor, 14.0


def _sphere(scene, rubber):
    import bmesh

    made = bmesh.new()
    bmesh.ops.create_icosphere(made, subdivisions=3, radius=SPHERE_RADIUS)
    vertices, faces = [v.co for v in made.verts], [[v.index for v in f.verts] for f in made.faces]
    sensor = scene_builder.mesh_object(scene, SPHERE, vertices, faces, rubber, location=(25.0, 20.0, 14.0))
    made.free()
    up = [v.index for v in sensor.data.vertices if v.co.z > -0.2 * SPHERE_RADIUS]
    scene_builder.make_tactile(sensor, up, **FOAM)
    return sensor, 14.0 + SPHERE_RADIUS


def _tip(scene, rubber):
    vertices, faces = fingertip.capsule()
    sensor = scene_builder.mesh_object(scene, TIP, vertices, faces, rubber, location=(10.0, -26.0, 14.0))
    sensor.rotation_euler = (0.0, 0.0, math.radians(-110.0))
    feels = np.flatnonzero((vertices[:, 2] > 0.2 * fingertip.RADIUS) & (vertices[:, 1] > -14.0))
    scene_builder.make_tactile(sensor, feels, **FOAM)
    return sensor, 14.0 + fingertip.RADIUS
