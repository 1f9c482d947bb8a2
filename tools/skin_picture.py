# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw docs/images/skin-fingertip.jpg: a painted magnetic fingertip is pressed and sheared. python tools/skin_picture.py.

Above is what Blender renders, below the vector image of its magnetometers.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import bpy
import numpy as np

import palpate
from palpate.addon.bake.bake import bake
from palpate.core.figures.vector_image import vector_figure
from palpate.core.jobs.job_runner import run_job

RADIUS, BALL = 0.02, 0.009
PRESSED, SHEARED = 20, 40
WIDTH, HEIGHT = 420, 270
PICTURE = Path(__file__).resolve().parents[1] / "docs/images/skin-fingertip.jpg"


def material(name: str, color: tuple[float, float, float], alpha: float = 1.0, roughness: float = 0.5):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    surface = made.node_tree.nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (*color, 1.0)
    surface.inputs["Alpha"].default_value, surface.inputs["Roughness"].default_value = alpha, roughness
    return made


def fingertip():
    """Return an ellipsoid whose upper side is painted, with the magnets and magnetometers of a uskin below it."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=RADIUS, segments=80, ring_count=60)
    finger = bpy.context.object
    finger.name = "Fingertip"
    for vertex in finger.data.vertices:
        vertex.co.y *= 1.4
    for face in finger.data.polygons:
        face.use_smooth = True
    group = finger.vertex_groups.new(name="painted")
    painted = {vertex.index for vertex in finger.data.vertices if vertex.co.z > 0.75 * RADIUS}
    group.add(list(painted), 1.0, "REPLACE")
    own = finger.palpate
    own.role, own.region, own.vertex_group, own.k, own.cn = "SENSOR", "GROUP", "painted", 8.0, 0.05
    own.mus, own.mud, own.max_penetration = 1.5, 1.5, 0.004
    bpy.context.view_layer.update()
    bpy.ops.palpate.magnetic_skin_place(preset="uskin")
    finger.data.materials.append(material("Silicone", (0.75, 0.35, 0.25), alpha=0.16))
    finger.data.materials.append(material("Painted", (0.9, 0.1, 0.02), alpha=0.25))
    for face in finger.data.polygons:
        face.material_index = int(painted.issuperset(face.vertices))
    return finger


def show_parts(finger) -> None:
    """Put a cylinder where each magnet is and a plate where each magnetometer is: empties are not rendered."""
    steel, board = material("Magnet", (0.6, 0.62, 0.65), roughness=0.2), material("Chip", (0.02, 0.12, 0.05))
    for part in list(finger.palpate.readout.collection.objects):
        if part.palpate.magnetic.part == "MAGNET":
            bpy.ops.mesh.primitive_cylinder_add(radius=0.8e-3, depth=1.7e-3)
        else:
            bpy.ops.mesh.primitive_cube_add(size=1.0)
            bpy.context.object.scale = (3e-3, 3e-3, 6e-4)
        shown = bpy.context.object
        shown.data.materials.append(steel if part.palpate.magnetic.part == "MAGNET" else board)
        shown.parent = part


def scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if not hasattr(bpy.types.Object, "palpate"):
        palpate.register()
    made = bpy.context.scene
    made.frame_start, made.frame_end = 1, SHEARED
    finger = fingertip()
    bpy.ops.mesh.primitive_uv_sphere_add(radius=BALL, segments=48, ring_count=32)
    ball = bpy.context.object
    ball.palpate.role = "TARGET"
    ball.data.materials.append(material("Ball", (0.2, 0.35, 0.7), alpha=0.35))
    for face in ball.data.polygons:
        face.use_smooth = True
    for frame, x, depth in ((1, 0.0, -5e-4), (PRESSED, 0.0, 1.5e-3), (SHEARED, 1.5e-3, 1.5e-3)):
        ball.location = x, 0.0, RADIUS + BALL - depth
        ball.keyframe_insert("location", frame=frame)
    show_parts(finger)
    bpy.ops.object.camera_add(location=(0.045, -0.085, 0.042))
    made.camera = bpy.context.object
    aim = np.array([0.0, 0.0, 0.018]) - np.array(made.camera.location)
    made.camera.rotation_euler = (math.acos(-aim[2] / np.linalg.norm(aim)), 0.0, math.atan2(-aim[0], aim[1]))
    made.camera.data.lens, made.camera.data.clip_start = 62, 1e-3
    bpy.ops.object.light_add(type="AREA", location=(0.05, 0.02, 0.12))
    bpy.context.object.data.energy, bpy.context.object.data.size = 0.25, 0.1
    made.world = bpy.data.worlds.new("World")
    made.world.use_nodes = True
    made.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.9, 0.9, 0.9, 1.0)
    made.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.6
    return made, finger


def render(made, frame: int, path: Path) -> np.ndarray:
    from matplotlib.image import imread

    made.frame_set(frame)
    made.render.engine, made.cycles.samples = "CYCLES", 24
    made.render.resolution_x, made.render.resolution_y = WIDTH, HEIGHT
    made.view_settings.view_transform = "Standard"
    made.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return imread(path)[..., :3]


def main() -> None:
    from matplotlib.image import imread, imsave

    made, finger = scene()
    with tempfile.TemporaryDirectory() as folder:
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / "scene.blend"))
        result = run_job(bake(made, into_scene=False))  # a heat map would hide the magnets
        channels = result.recording.sensors["Fingertip"].channels
        chips = result.scenario.sensors[0].channels.skin.magnetometers
        frames = PRESSED, SHEARED
        top = np.concatenate([render(made, frame, Path(folder) / f"{frame}.png") for frame in frames], axis=1)
        along_body = np.einsum("kij,tki->tkj", chips.axes, channels.values)  # the chips lie aslant
        change = [1e3 * (along_body[frame - 1] - along_body[0]) for frame in frames]
        figure = vector_figure(chips.place[:, :2], change, ["pressed 1.5 mm", "then sheared 1.5 mm"], "mT")
        figure.savefig(Path(folder) / "vectors.png", dpi=2 * WIDTH / figure.get_size_inches()[0])
        below = imread(Path(folder) / "vectors.png")[:, : 2 * WIDTH, :3]
    below = np.pad(below, ((0, 0), (0, 2 * WIDTH - below.shape[1]), (0, 0)), constant_values=1.0)
    (drawn,) = np.nonzero((below < 1.0).any(axis=(1, 2)))
    both = np.concatenate([top, below[max(drawn[0] - 8, 0) : drawn[-1] + 8]])
    imsave(PICTURE, both, pil_kwargs={"quality": 82})


if __name__ == "__main__":
    main()
