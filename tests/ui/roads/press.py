# SPDX-License-Identifier: GPL-3.0-or-later
"""A ball is pressed on a pad: Space plays and shows it, scrubbing shows it again, Bake bakes it, ESC stops a bake."""

from pathlib import Path

import bpy
import solver
from tutorial import timeline


def build(folder: Path, sensors: bool = True) -> None:
    """The scene: everything but the role of one sensor, which the road gives by hand, or of both."""
    for obj in list(bpy.data.objects):
        if obj.type == "MESH":
            bpy.data.objects.remove(obj)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 40
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.8, location=(0.0, 0.0, 0.9))
    ball = bpy.context.object
    ball.name, ball.palpate.role = "Ball", "TARGET"
    ball.keyframe_insert("location", frame=1)
    ball.location = (0.5, 0.0, 0.4)
    ball.keyframe_insert("location", frame=30)
    ball.display_type = "WIRE"
    bpy.ops.mesh.primitive_cube_add(size=0.8, location=(-2.5, 0.0, 0.5))
    cube = bpy.context.object
    cube.name, cube.palpate.role, cube.palpate.body = "Cube", "TARGET", "FREE"
    cube.palpate.mass = 0.02
    for name, x in (("Pad 2", -2.5), ("Pad", 0.0)):
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20, size=2.4, location=(x, 0.0, 0.0))
        bpy.context.object.name = name
        bpy.context.object.palpate.max_penetration = 1.0
    if sensors:
        bpy.data.objects["Pad 2"].palpate.role = "SENSOR"
    scene.unit_settings.scale_length = 0.01
    scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "press.blend"))


def obj(name):
    return bpy.data.objects[name]  # looked up each time: undo makes new ones


def road(ui):
    build(ui.out)
    scene = bpy.context.scene
    view = ui.area("VIEW_3D")
    for thing in scene.objects:
        thing.select_set(thing.type == "MESH")
    with ui.context(view):
        bpy.ops.view3d.view_selected()
    for thing in scene.objects:
        thing.select_set(thing.name == "Pad")
    yield 0.5
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.sensor_add()")
    ui.check(obj("Pad").palpate.role == "SENSOR", "Make Sensor makes the pad a sensor")

    yield from solver.wait(ui)
    scene.frame_end = 100_000  # however slow or fast the machine is, playing does not start again, nor ends a bake before ESC
    yield from ui.move(*ui.centre(view))
    yield from ui.key("SPACE")
    yield from ui.wait_until(lambda: scene.frame_current >= 25, "the timeline played to frame 25", timeout=120.0)
    yield from ui.key("SPACE")
    frame = scene.frame_current
    attribute = obj("Pad").data.attributes.get("palpate_force")
    largest = max((item.value for item in attribute.data), default=0.0) if attribute else 0.0
    ui.value("largest while playing", largest)
    ui.check(largest > 0.0, f"playing computed forces (frame {frame})")
    ui.check(obj("Cube").location.z < 0.45, "playing moved the free body")
    yield from ui.screenshot("played")

    yield from ui.filter("unit")
    yield from ui.screenshot("readout")
    yield from ui.filter("")
    yield from ui.filter("Indentation")
    yield from ui.screenshot("display")
    yield from ui.filter("")

    height = obj("Cube").location.z
    yield from ui.key("LEFT_ARROW")
    ui.check(scene.frame_current == frame - 1, "an arrow key goes one frame back")
    yield from ui.key("RIGHT_ARROW")
    ui.check(obj("Cube").location.z == height, "and forward again shows the same")

    # A jump computes what is missing, and a key ends that and does what it always does
    yield from timeline(ui, "frame_current", 90_000)
    yield from ui.wait_until(lambda: ui.works("palpate.catch_up"), "the frames up to the jump are computed")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("G")
    ui.check(ui.works("transform.translate"), "G moves the pad meanwhile")
    ui.check(not ui.works("palpate.catch_up"), "and ends the computation")
    ui.check(scene.frame_current == 90_000, "at the frame that was jumped to")
    yield from ui.key("ESC")
    scene.frame_set(frame)

    yield from ui.press("palpate.bake()")
    yield from ui.stop("palpate.bake")
    ui.check(not obj("Pad").palpate.is_baked, "nothing is baked")
    yield from ui.becomes(lambda: not list((ui.out / "palpate-bake").glob("*")), "and no files are left")

    scene.frame_end = 40
    yield from ui.press("palpate.bake()")
    yield from ui.wait_until(lambda: obj("Pad").palpate.is_baked, "the bake is done", timeout=120.0)
    ui.value("files", sorted(path.name for path in (ui.out / "palpate-bake" / "Pad").iterdir()))
    arrow = next((o for o in scene.objects if o.name == "Net Force Pad"), None)
    ui.check(arrow is not None, "there is a force arrow")
    view.spaces.active.shading.type = "MATERIAL"
    scene.frame_set(30)
    yield 3.0
    yield from ui.screenshot("baked")
    ui.value("arrow", list(arrow.scale))

    yield from ui.move(*ui.centre(view))
    yield from ui.key("Z", ctrl=True)
    yield from ui.becomes(lambda: not obj("Pad").palpate.is_baked, "Ctrl Z takes the bake out of the scene")
    ui.check("Net Force Pad" not in bpy.data.objects, "with its arrow")
    yield from ui.screenshot("undone")
