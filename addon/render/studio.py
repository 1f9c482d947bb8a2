# SPDX-License-Identifier: GPL-3.0-or-later
"""Studio light for pictures: three lamps around the camera, a soft world, a plain background that the subject stands out from.

The scene's own lamps, world, floor and backdrop are left out meanwhile, because they are made for working, if at all.
"""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from ...core.io.hidden_folder import temporary_folder
from ..display import materials
from . import render

LAMPS = (((-35.0, 50.0), 1.15, (1.0, 0.97, 0.93)), ((70.0, 30.0), 0.5, (0.9, 0.95, 1.0)), ((170.0, 45.0), 0.8, (1.0, 1.0, 1.0)))
"""Sun lamps: azimuth relative to the camera and elevation, degrees; strength; colour. With :data:`WORLD_STRENGTH` they light a
white surface with 1 at most, so that nothing dull is burnt out, and one that faces the camera with 0.7 to 0.9."""
WORLD_COLOR, WORLD_STRENGTH = (0.95, 0.97, 1.0), 0.45
LIGHT_BACKGROUND, DARK_BACKGROUND = 0.9, 0.035
"""Scene-linear grey of the two backgrounds: 0.95 and 0.21 of white as displayed."""
BRIGHT_SUBJECT = 0.6
"""Mean displayed brightness of the subject above which it stands before the dark background: in the middle between the two."""
PREVIEW_SIZE, PREVIEW_SAMPLES = (96, 72), 4
"""Size and samples of the render by which the subject's brightness is told."""
FLOOR_ELEVATION = 3.0
"""Elevation of the camera, degrees, from which there is a floor below the subject."""
FLOOR_FADE, FLOOR_END = 0.6, 3.0
"""Distances from the middle at which the floor begins to fade and is gone, in sizes of the subject."""
FLOOR_LIGHT = sum(strength * math.sin(math.radians(angle)) for (_, angle), strength, _ in LAMPS) / math.pi + WORLD_STRENGTH
"""Brightness of a white floor in studio light."""


def add_lamps(scene, changes) -> None:
    """Add three sun lamps around the direction of the camera."""
    back = scene.camera.matrix_world.to_3x3() @ Vector((0.0, 0.0, 1.0))
    heading = math.atan2(back.y, back.x)
    for (azimuth, elevation), strength, color in LAMPS:
        lamp = bpy.data.lights.new("Palpate Light", "SUN")
        lamp.energy, lamp.color, lamp.angle = strength, color, math.radians(15.0)
        obj = bpy.data.objects.new("Palpate Light", lamp)
        scene.collection.objects.link(changes.add(obj))
        obj.rotation_euler = (math.pi / 2 - math.radians(elevation), 0.0, heading + math.radians(azimuth) + math.pi / 2)


def set_studio(scene, changes, backdrops, frame: int, bottom: np.ndarray, transparent: bool) -> None:
    """Replace lamps, world and backdrops of a scene by those of a studio.

    Parameters
    ----------
    scene : Scene
        Its camera stands.
    changes : render.TemporaryChanges
    backdrops : list of Object
        Are not rendered.
    frame : int
        Frame at which the brightness of the subject is told.
    bottom : (4,) float, Blender units
        Middle and height of the lowest point of what is seen, and its size.
    transparent : bool
        There is no background.
    """
    for obj in [*backdrops, *(obj for obj in scene.objects if obj.type == "LIGHT")]:
        if not obj.hide_render:
            changes.set(obj, hide_render=True)
    add_lamps(scene, changes)
    world = changes.add(bpy.data.worlds.new("Palpate World"))
    changes.set(scene, world=world)
    set_background = _fill_world(world)
    if transparent:
        return
    grey = LIGHT_BACKGROUND if _brightness(scene, frame) < BRIGHT_SUBJECT else DARK_BACKGROUND
    set_background(grey)
    back = scene.camera.matrix_world.to_3x3() @ Vector((0.0, 0.0, 1.0))
    if scene.render.engine != "BLENDER_WORKBENCH" and back.z > math.sin(math.radians(FLOOR_ELEVATION)):
        _add_floor(scene, changes, bottom, grey)


def bright_world():
    """Return a new world that lights softly and is seen as it lights."""
    world = bpy.data.worlds.new("Palpate World")
    background = next(node for node in materials.tree_of(world).nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.86, 0.88, 0.92, 1.0)
    background.inputs["Strength"].default_value = 0.7
    return world


def _fill_world(world):
    """Make a world that lights softly and shows a plain background; return the function that sets its grey."""
    tree = materials.tree_of(world)
    tree.nodes.clear()
    add = materials.NodeAdder(tree)
    light = add("ShaderNodeBackground", {"Color": (*WORLD_COLOR, 1.0), "Strength": WORLD_STRENGTH})
    plain = add("ShaderNodeBackground")
    mix = add("ShaderNodeMixShader", {0: add("ShaderNodeLightPath", output="Is Camera Ray"), 1: light, 2: plain})
    add.end("ShaderNodeOutputWorld", {"Surface": mix})

    def set_background(grey: float) -> None:
        plain.node.inputs["Color"].default_value = (grey, grey, grey, 1.0)
        world.color = (grey, grey, grey)  # Workbench shows this one

    set_background(LIGHT_BACKGROUND)
    return set_background


def _brightness(scene, frame: int) -> float:
    """Return the mean displayed brightness of what is not background, 0 to 1, in a small render; 0 where nothing is seen."""
    from matplotlib.image import imread

    with render.TemporaryChanges() as changes, temporary_folder(Path(bpy.app.tempdir), "studio") as folder:
        changes.set(scene.render, film_transparent=True)
        picture = imread(render.render_frame(scene, folder / "small.png", frame, samples=PREVIEW_SAMPLES, size=PREVIEW_SIZE))
    seen = picture[..., 3] > 0.5
    return float(picture[seen][:, :3].mean()) if seen.any() else 0.0


def _add_floor(scene, changes, bottom: np.ndarray, grey: float) -> None:
    """Add a floor below the subject, on which its shadow falls, and which fades into the background."""
    x, y, z, size = bottom
    side = FLOOR_END * size
    mesh = bpy.data.meshes.new("Palpate Floor")
    mesh.from_pydata([(-side, -side, 0.0), (side, -side, 0.0), (side, side, 0.0), (-side, side, 0.0)], [], [(0, 1, 2, 3)])
    mesh.materials.append(changes.add(_floor_material(grey, size)))
    floor = changes.add(bpy.data.objects.new("Palpate Floor", mesh))
    floor.location = (x, y, z - 1e-3 * size)
    scene.collection.objects.link(floor)


def _floor_material(grey: float, size: float):
    """Return a dull material that is as bright as the background in studio light and transparent far from the middle."""
    material = bpy.data.materials.new("Palpate Floor")
    tree = materials.tree_of(material)
    tree.nodes.clear()
    add = materials.NodeAdder(tree)
    distance = add.vector("LENGTH", add("ShaderNodeTexCoord", output="Object"), output="Value")
    ends = {"From Min": FLOOR_FADE * size, "From Max": FLOOR_END * size}
    fade = add("ShaderNodeMapRange", {"Value": distance, **ends}, interpolation_type="SMOOTHSTEP")
    dull = add("ShaderNodeBsdfDiffuse", {"Color": (*(grey / FLOOR_LIGHT,) * 3, 1.0)})
    mix = add("ShaderNodeMixShader", {0: fade, 1: dull, 2: add("ShaderNodeBsdfTransparent")})
    add.end("ShaderNodeOutputMaterial", {"Surface": mix})
    return material
