# SPDX-License-Identifier: GPL-3.0-or-later
"""More ways of making a sensor in the window: Edit Mode, material, face set, copying, a painted soft spot, files."""

import importlib

import bpy
from tutorial import timeline


def pad(name="Pad"):
    return bpy.data.objects[name]  # looked up each time: undo makes new ones


def addon(name):
    return importlib.import_module(f"bl_ext.user_default.palpate.addon.{name}")


def texels():
    report = addon("authoring.sensor_report").fresh_report(pad(), bpy.context.scene)
    return len(report.texels) if report.texels is not None else 0


def build(folder):
    """Two sheets of 40 mm with 2 mm from vertex to vertex; on the first, some faces wear a material and a face set."""
    for obj in list(bpy.data.objects):
        if obj.type == "MESH":
            bpy.data.objects.remove(obj)
    for name, x in (("Other", 0.05), ("Pad", 0.0)):
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20, size=0.04, location=(x, 0.0, 0.0))
        bpy.context.object.name = name
    pad("Other").palpate.role = "SENSOR"
    mesh = pad().data
    for name in ("Back", "Tip"):
        mesh.materials.append(bpy.data.materials.new(name))
    right = [face.center.x > 0.005 for face in mesh.polygons]
    mesh.polygons.foreach_set("material_index", [int(value) for value in right])
    sets = mesh.attributes.new(".sculpt_face_set", "INT", "FACE")
    sets.data.foreach_set("value", [3 if face.center.y > 0.005 else 1 for face in mesh.polygons])
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shaping.blend"))


def wheel(ui, name, notches):
    """Turn the wheel over a list with Ctrl held: the next choice."""
    yield from ui.find(name)
    for _ in range(notches):
        ui.event("WHEELDOWNMOUSE", ctrl=True)
        yield 0.2


def felt(ui, frame):
    """Go to the start and to a frame; return what the sensor feels there."""
    yield from timeline(ui, "frame_current", 1)
    yield from timeline(ui, "frame_current", frame)
    frame_status = addon("session.frame_status")

    def known():
        status = frame_status.status_of(bpy.context.scene)
        return status.frame is not None and status.frame.frame == frame

    yield from ui.wait_until(known, f"frame {frame} is computed", timeout=120)
    return frame_status.status_of(bpy.context.scene).frame.sensors["Pad"]


def road(ui):
    build(ui.out)
    view = ui.area("VIEW_3D")
    with ui.context(view):
        bpy.ops.view3d.view_axis(type="TOP")
    yield 1.0
    yield from ui.move(*ui.centre(view))
    yield from ui.key("NUMPAD_PERIOD")
    yield 1.5
    yield from ui.tab("PHYSICS")

    # The selection in Edit Mode
    yield from ui.move(*ui.centre(view))
    yield from ui.key("TAB")
    yield 0.5
    ui.check(pad().mode == "EDIT", "Tab enters Edit Mode")
    yield from ui.key("A", alt=True)
    yield from ui.key("B")
    yield from ui.drag(ui.at((-0.0005, -0.0215, 0)), ui.at((0.0215, 0.0215, 0)))
    yield 0.5
    yield from ui.screenshot("edit-selection")
    yield from ui.press("palpate.sensor_add()")
    ui.check((pad().mode, pad().palpate.region) == ("OBJECT", "GROUP"), "Make Sensor takes the selection, as a group")
    ui.value("selected", texels())
    yield from ui.screenshot("edit-sensor")

    # A material, a face set
    yield from wheel(ui, "palpate.region", 1)
    ui.check(pad().palpate.region == "MATERIAL", "the region goes by material")
    yield from ui.fill("palpate.material", "Tip")
    ui.value("material", texels())
    yield from ui.screenshot("material")
    yield from wheel(ui, "palpate.region", 1)
    ui.check(pad().palpate.region == "FACE_SET", "the region goes by face set")
    yield from ui.fill("palpate.face_set", "3")
    ui.value("face set", texels())
    yield from ui.screenshot("face-set")
    pad().palpate.region = "MESH"

    # Copied to another sensor
    pad().palpate.k = 100.0
    for obj in bpy.context.scene.objects:
        obj.select_set(obj.name in {"Pad", "Other"})
    bpy.context.view_layer.objects.active = pad()
    yield from ui.press("palpate.parameters_copy()")
    ui.check(pad("Other").palpate.k == 100.0, "Copy to Selected copies")

    # A soft spot is painted
    pad("Other").palpate.role = "NONE"
    pad("Other").select_set(False)
    with ui.context(view):
        bpy.ops.palpate.probe_add()
        bpy.context.view_layer.objects.active = pad()
        pad().select_set(True)
    preparing = addon("session.first_use")
    yield from ui.wait_until(preparing.is_ready, "the solver is ready", timeout=900)
    stiff = yield from felt(ui, 20)
    ui.value("before", float(stiff.normal_force.sum()))
    with ui.context(view):
        pad().vertex_groups.new(name="Soft")
        bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
        addon("authoring.sensors").set_full_weight_brush(bpy.context.scene.tool_settings)
    yield 1.0
    x, y = ui.at((0.0, 0.0, 0.0))
    for dy in (20, -10):
        yield from ui.drag((x - 60, y + dy), (x + 60, y + dy), steps=12)
    yield from ui.screenshot("soft-spot")
    with ui.context(view):
        bpy.ops.object.mode_set(mode="OBJECT")
    yield from ui.filter("stiffness")
    yield from ui.fill("palpate.k_map", "Soft")
    ui.check(pad().palpate.k_map == "Soft", "the painted group is chosen")
    yield from ui.screenshot("soft-spot-chosen")
    yield from ui.filter("")
    soft = yield from felt(ui, 20)
    ui.value("after", float(soft.normal_force.sum()))
    yield from ui.screenshot("soft-spot-felt")

    # Out and in again, through the file browser
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    for name, suffix in (("openrave", "xml"), ("sensor_toml", "toml")):
        path = ui.out / f"sensor.{suffix}"
        with ui.context(ui.area("VIEW_3D")):
            getattr(bpy.ops.palpate, f"{name}_export")("INVOKE_DEFAULT", filepath=str(path))
        yield 1.5
        yield from ui.screenshot(f"export-{suffix}")
        yield from ui.key("RET")
        yield from ui.wait_until(path.exists, f"the .{suffix} is written")
        pad().palpate.k = 7.0
        with ui.context(ui.area("VIEW_3D")):
            getattr(bpy.ops.palpate, f"{name}_import")("INVOKE_DEFAULT", filepath=str(path))
        yield 1.5
        yield from ui.screenshot(f"import-{suffix}")
        yield from ui.key("RET")
        yield from ui.wait_until(lambda: pad().palpate.k == 100.0, f"the .{suffix} is read back")
