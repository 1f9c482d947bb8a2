# SPDX-License-Identifier: GPL-3.0-or-later
"""Open a baked .blend and look at it frame by frame; run by test_without_addon.py in a process of its own.

python without_addon.py SCENE.blend REPORT.json WITH_ADDON(0/1) FRAME...
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

scene_path, report_path, with_addon, *frames = sys.argv[1:]
if int(with_addon):
    import palpate

    palpate.register()
bpy.ops.wm.open_mainfile(filepath=scene_path)
scene = bpy.context.scene
render = scene.render
render.image_settings.file_format = "PNG"


def deepest(pad):
    """Return how far the lowest vertex of a pad is below its highest, metres."""
    heights = [vertex.co.z for vertex in pad.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices]
    return max(heights) - min(heights)


def shown(mesh, vertices):
    """Return what a material finds at each vertex, by quantity: the pixel at its texture coordinates in the packed image."""
    found = {}
    for item in mesh.attributes:
        image = bpy.data.images.get(f"Palpate Pad {item.name.removeprefix('palpate_')}")
        if item.data_type == "FLOAT_VECTOR" and image is not None:
            pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)[..., 0]
            places = np.array([value.vector for value in item.data][:vertices])[:, :2] * image.size
            column, row = np.minimum(places.astype(int), np.array(image.size) - 1).T
            found[item.name] = pixels[row, column].tolist()
    return found


report = {"has_addon": hasattr(bpy.types.Object, "palpate"), "frames": {}}
for frame in map(int, frames):
    scene.frame_set(frame)
    path = Path(report_path).with_name(f"{Path(report_path).stem}_{frame}.png")
    render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(str(path))
    pixels = np.empty(len(picture.pixels), dtype=np.float32)
    picture.pixels.foreach_get(pixels)
    corners = len(scene.objects["Tip"].data.vertices)
    tip = scene.objects["Tip"].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    pad_mesh = scene.objects["Pad"].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    report["frames"][frame] = {
        # the vertices of the mesh itself come first; those of the indented surface follow
        "tip": [item.value for item in getattr(tip.attributes.get("palpate_force"), "data", ())][:corners],
        "shown": shown(pad_mesh, len(scene.objects["Pad"].data.vertices)),
        "depth": deepest(scene.objects["Pad"]),
        "size": list(picture.size),
        "pixels": np.round(pixels, 4).tolist(),
        "arrows": {o.name: [list(row) for row in o.matrix_world] for o in scene.objects if o.name.startswith("Net Force")},
        "bodies": {o.name: [list(row) for row in o.matrix_world] for o in scene.objects if o.name in ("Ball", "Cube")},
    }
Path(report_path).write_text(json.dumps(report))
