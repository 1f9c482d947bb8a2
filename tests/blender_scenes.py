# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes for the tests, and what a scene consists of, as text that can be compared."""

from __future__ import annotations

import os
import re
from pathlib import Path

import bpy
import numpy as np
import pytest

from palpate.addon.authoring import sensor_report
from palpate.addon.bake.bake import bake
from palpate.addon.display import markers, materials
from palpate.addon.render import render
from palpate.addon.scene import participants, scene_reader
from palpate.addon.timeline import live_cache
from palpate.core.io.hidden_folder import PRIVATE_FOLDER
from palpate.core.jobs import run_job


def grid(name="Pad", location=(0.0, 0.0, 0.0), columns=6, rows=14, size=0.05):
    """Return a flat pad of columns × rows vertices."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=columns - 1, y_subdivisions=rows - 1, size=size, location=location)
    bpy.context.object.name = name
    return bpy.context.object


def pad_sensor(**options):
    """Return a flat pad that is a sensor all over, made by the button."""
    pad = grid(**options)
    bpy.ops.palpate.sensor_add(source="MESH")
    return pad


def ball(name="Ball", location=(0.0, 0.0, 0.01), radius=0.008, segments=24):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=location, segments=segments, ring_count=segments // 2)
    bpy.context.object.name = name
    return bpy.context.object


def cube(name="Cube", location=(0.2, 0.0, 0.0101), size=0.02, rotation=(0.0, 0.0, 0.0)):
    bpy.ops.mesh.primitive_cube_add(size=size, location=location, rotation=rotation)
    bpy.context.object.name = name
    return bpy.context.object


def scene_of(last):
    """Return the scene, whose frames are from 1 to the last."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, last
    return scene


def keyframe(owner, path, values):
    """Give a property keyframes: its values by their frames."""
    for frame, value in values.items():
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def play_to(scene, last):
    """Show the frames up to one, as playing does; return what is computed of them."""
    for frame in range(scene.frame_start, last + 1):
        scene.frame_set(frame)
    return live_cache.get(scene)


def choose(*objects):
    """Select some objects alone, the last of which is active."""
    for obj in bpy.context.scene.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[-1]


def select(obj, vertices):
    """Select vertices of a mesh, and what they span."""
    bpy.ops.object.mode_set(mode="OBJECT")
    chosen = np.zeros(len(obj.data.vertices), dtype=bool)
    chosen[list(vertices)] = True
    obj.data.vertices.foreach_set("select", chosen)
    for edge in obj.data.edges:
        edge.select = all(chosen[v] for v in edge.vertices)
    for face in obj.data.polygons:
        face.select = all(chosen[v] for v in face.vertices)


def press(frames=8):
    """A ball that is pressed into a pad, 2 mm deep at the last frame."""
    scene, pad, target = scene_of(frames), grid(), ball()
    pad.palpate.role, target.palpate.role = "SENSOR", "TARGET"
    keyframe(target, "location", {1: target.location[:], frames: (0.001, 0.0005, 0.006)})
    scene.frame_set(1)
    return scene, pad, target


def press_and_drop(frames=8):
    """The same, and beside it a free cube that falls on a second pad."""
    scene, pad, target = press(frames)
    second = grid("Pad 2", (0.2, 0.0, 0.0))
    second.palpate.role = "SENSOR"
    free = cube(rotation=(0.0, 0.0, 0.3))
    free.palpate.role, free.palpate.body, free.palpate.mass = "TARGET", "FREE", 0.05
    scene.frame_set(1)
    return scene, pad, target, second, free


def scene_with_readings(frames=8):
    """A slide over a pad that has every quantity: its reading falls under load from 5 V, and a load cell has channels."""
    scene, pad, target = press(frames)
    pad.palpate.gain, pad.palpate.zero, pad.palpate.unit, pad.palpate.readout.kind = -2.0, 5.0, "V", "NET_FORCE"
    keyframe(target, "location", {frames: (0.005, 0.0005, 0.006)})
    scene.frame_set(1)
    return scene


def baked(scene, folder=None, **options):
    """Bake a scene, which is saved in a folder first if one is given; return what the bake gives."""
    if folder is not None:
        save(folder)
    return run_job(bake(scene, **options))


def baked_file(scene, folder, name="scene.blend"):
    """Bake a scene and save it in a folder with its bake; return the path of the .blend and what the bake gives."""
    save(folder, name)
    result = baked(scene)
    return save(folder, name), result


def reading_of(scene):
    """Read a scene at all of its frames, as a bake does."""
    return run_job(scene_reader.read_scene(scene))


def scenario_of(scene):
    """Return the scenario that a bake of a scene solves."""
    return reading_of(scene).scenario


def start_of(scene):
    """Read a scene at the present frame alone, as playing does."""
    return scene_reader.read_start(scene, participants.depsgraph_of(scene))


def report_of(obj):
    """Return what the panel says about a sensor as it is now."""
    bpy.context.view_layer.update()
    return sensor_report.fresh_report(obj, bpy.context.scene)


def problems_of(obj):
    """Return the kinds of the problems that a sensor has."""
    return [problem.kind for problem in report_of(obj).problems]


def node_of(obj, kind):
    """Return the only node of a kind in the material of an object's heat map."""
    (node,) = (node for node in obj.material_slots[-1].material.node_tree.nodes if node.bl_idname == kind)
    return node


def find_marker(objects, uid, kind):
    """The marker of a sensor among some objects; None if there is none."""
    own = (obj for obj in objects if obj.get(materials.SENSOR_KEY) == uid)
    return next((obj for obj in own if obj.get(markers.KIND_KEY) == kind), None)


def evaluated_vertices(obj):
    """Return the vertices of an object with its modifiers, (n, 3) in its own frame, not by the add-on's reader of meshes."""
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return np.array([vertex.co for vertex in mesh.vertices])


def surface(obj):
    """Return the vertices of an object as Blender shows them, (n, 3) in world coordinates."""
    matrix = np.array(obj.matrix_world)
    return evaluated_vertices(obj) @ matrix[:3, :3].T + matrix[:3, 3]


def raw_settings(block):
    """Return the settings of a data-block as its file has them: another program could have written what it likes."""
    system = block.bl_system_properties_get() if hasattr(block, "bl_system_properties_get") else block
    return system["palpate"]


def places_of(scene, points):
    """Return where points are in the picture of the camera, (n, 2) from 0 to 1."""
    return np.array([render.image_position(scene, point) for point in points])


def refusal(operator, **settings) -> str:
    """Press a button that has to refuse; return the one sentence that it says."""
    with pytest.raises(RuntimeError) as caught:
        operator(**settings)
    (line,) = str(caught.value).strip().splitlines()
    sentence = line.removeprefix("Error: ")
    assert re.fullmatch(r"\S.*[^.]\.", sentence) and "Traceback" not in sentence, sentence
    return sentence


def save(folder, name="scene.blend"):
    path = folder / name
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def reopen(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.context.scene


def contents(folder) -> dict[str, bytes]:
    """Return the content of all files in a folder by their paths in it, without the hidden folder of a bake folder."""
    files = []
    for root, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name != PRIVATE_FOLDER]
        files += [Path(root, name) for name in names]
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(files)}


def visible(folder) -> list[str]:
    """Return the sorted names in a bake folder, without the hidden folder."""
    return sorted(path.name for path in folder.iterdir() if path.name != PRIVATE_FOLDER)


def dump(uids=True) -> dict[str, str]:
    """Return everything about the file's data that the add-on could have changed, by a name for each piece."""
    pieces = {kind: str(sorted(block.name for block in getattr(bpy.data, kind))) for kind in KINDS}
    for scene in bpy.data.scenes:
        pieces[f"{scene.name}: frame"] = str((scene.frame_current, scene.frame_subframe, scene.frame_start, scene.frame_end))
        pieces[f"{scene.name}: settings"] = settings(scene.palpate)
    for obj in bpy.data.objects:
        pieces |= {f"{obj.name}: {what}": text for what, text in _object(obj, uids).items()}
    for mesh in bpy.data.meshes:
        pieces |= {f"{mesh.name}: {what}": text for what, text in _mesh(mesh).items()}
    return pieces


KINDS = ("objects", "meshes", "materials", "images", "actions", "node_groups", "collections", "curves")
KINDS += ("worlds", "lights", "cameras", "scenes")


def settings(group, uids=True) -> str:
    names = [item.identifier for item in group.bl_rna.properties]
    names = [name for name in names if name not in ("rna_type", "name") and (uids or name != "uid")]
    return str({name: _plain(getattr(group, name)) for name in names})


def _plain(value):
    if isinstance(value, bpy.types.PropertyGroup):
        return settings(value)
    if isinstance(value, bpy.types.bpy_prop_collection):
        return [settings(item) for item in value]
    if isinstance(value, bpy.types.ID):
        return value.name
    return value if value is None or isinstance(value, str | int | float) else tuple(value)


def _object(obj, uids) -> dict[str, str]:
    found = {
        "matrix": str([tuple(row) for row in obj.matrix_basis]),
        "channels": str((tuple(obj.location), tuple(obj.rotation_euler), tuple(obj.rotation_quaternion), tuple(obj.scale))),
        "settings": settings(obj.palpate, uids),
        "custom": str({key: str(value) for key, value in obj.items() if key != "palpate"}),
        "groups": str([group.name for group in obj.vertex_groups]),
        "modifiers": str([modifier.name for modifier in obj.modifiers]),
        "slots": str([(slot.link, slot.material and slot.material.name) for slot in obj.material_slots]),
        "action": str(obj.animation_data and obj.animation_data.action and obj.animation_data.action.name),
    }
    if obj.type == "MESH":
        found["weights"] = str([[(g.group, g.weight) for g in vertex.groups] for vertex in obj.data.vertices])
    return found


def _mesh(mesh) -> dict[str, str]:
    points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", points)
    return {
        "points": points.tobytes().hex(),
        "uv": str([layer.name for layer in mesh.uv_layers]),
        "active uv": str(mesh.uv_layers.active_index),
        "attributes": str(sorted(item.name for item in mesh.attributes if not item.is_internal)),
        "materials": str([material and material.name for material in mesh.materials]),
        "material indices": str([face.material_index for face in mesh.polygons]),
    }


def changes(before: dict[str, str], after: dict[str, str]) -> list[str]:
    """Say what differs between two dumps."""
    return [
        f"{key}: {before.get(key)} → {after.get(key)}"
        for key in sorted(before.keys() | after.keys())
        if before.get(key) != after.get(key)
    ]
