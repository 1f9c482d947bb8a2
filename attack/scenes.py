# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes, bakes and measurements that the attack works on. Everything here runs in a worker with Blender."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

SENSORS = ("Pad", "Pad.old")
"""Names of the sensors; the second is one that Palpate itself might once have used for a backup of the first."""


def make_scene(path: str, frames: int = 6, k: float = 60.0) -> None:
    """Save a scene in which a ball is pressed into two pads, one after the other."""
    import bpy

    from palpate.commands import blender

    blender.start_blender()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender.start_blender()  # factory settings disable every add-on
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, frames
    scene.palpate.use_auto_dt, scene.palpate.dt = False, 1e-3
    for i, name in enumerate(SENSORS):
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=3, y_subdivisions=2, size=0.03, location=(0.1 * i, 0, 0))
        pad = bpy.context.object
        pad.name = name
        pad.palpate.role, pad.palpate.k = "SENSOR", k
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.02, segments=12, ring_count=8, location=(0.1 * i, 0, 0.021))
        ball = bpy.context.object
        ball.palpate.role = "TARGET"
        ball.keyframe_insert("location", frame=1)
        ball.location = (0.1 * i + 0.001, 0.0005, 0.018)
        ball.keyframe_insert("location", frame=frames)
    scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=path, compress=True)


def change_scene(path: str, frames: int, k: float) -> None:
    """Change the stiffness and the frames of a scene, as a user does before the next bake."""
    import bpy

    from palpate.commands import blender

    scene = blender.open_scene(path)
    scene.frame_end = frames
    for name in SENSORS:
        bpy.data.objects[name].palpate.k = k
    blender.save_blend(path, backup=False)


def describe_blend(path: str) -> str:
    """Return a hash of what a .blend shows: motion, heat maps' keys, and the bake it names. The bytes hold memory addresses."""
    import bpy

    from palpate.commands import blender

    scene = blender.open_scene(path)
    found: list = [scene.frame_start, scene.frame_end]
    for obj in sorted(scene.objects, key=lambda one: one.name):
        animation = obj.animation_data
        curves = animation.action.fcurves if animation and animation.action and hasattr(animation.action, "fcurves") else ()
        keys = [(curve.data_path, curve.array_index, [tuple(point.co) for point in curve.keyframe_points]) for curve in curves]
        found.append((obj.name, obj.palpate.role, obj.palpate.k, bpy.path.abspath(obj.palpate.bake_folder), keys))
    found.append(sorted(image.name for image in bpy.data.images))
    return hashlib.sha256(json.dumps(found).encode()).hexdigest()


def describe_bake(folder: str) -> str:
    """Return the digest of the present bake of a folder, once all its files are checked."""
    from palpate.core.io.bake_reader import read_bake

    bake = read_bake(folder)
    names = sorted(bake.manifests)
    if names != sorted(SENSORS):
        raise ValueError(f"the sensors are {names}")
    return bake.manifests[names[0]].digest


def make_rig(folder: str) -> None:
    """Write measurements of a sensor of two texels."""
    place = Path(folder)
    (place / "rig.toml").write_text(
        'format = "palpate-rig/1"\nname = "small"\n[sensor]\ngrid = {rows = 1, columns = 2, pitch = 0.003}\nk = 80.0\n'
        "thickness = 0.006\n[indenter]\nshape = {box = [0.01, 0.01, 0.01]}\n"
        '[[trial]]\nfile = "a.csv"\n[[trial]]\nfile = "b.csv"\nuse = "check"\n'
    )
    for name, share in (("a", 1.0), ("b", 0.8)):
        lines = ["time,x,y,z,texel_0,texel_1,force_z"]
        for i in range(40):
            depth = share * 1e-3 * min(i, 40 - i) / 20
            lines.append(f"{0.02 * i:.2f},0,0,{0.005 - depth:.6f},{90 * depth:.6f},{88 * depth:.6f},{-178 * depth:.6f}")
        (place / f"{name}.csv").write_text("\n".join(lines) + "\n")


def make_measurements(folder: str) -> None:
    """Write what ``palpate fit`` reads: a press and a slide."""
    place = Path(folder)
    (place / "foam.csv").write_text("compression_mm,force_N\n" + "".join(f"{0.1 * i:.1f},{0.2 * i:.2f}\n" for i in range(1, 9)))


_diagnosis: dict[str, object] = {}


def remember_diagnosis() -> None:
    """Let ``palpate gap`` diagnose once and only write its report again: its fits read no files and write none."""
    from palpate.core.gap.selection import diagnosis

    if "original" in _diagnosis:
        return
    original = _diagnosis["original"] = diagnosis.diagnose

    def diagnose(rig, *arguments, **options):
        key = repr((rig.name, len(rig.trials)))
        if key not in _diagnosis:
            _diagnosis[key] = yield from original(rig, *arguments, **options)
        return _diagnosis[key]

    diagnosis.diagnose = diagnose
