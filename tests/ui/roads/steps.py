# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared by roads: parts of the extension, a scene, and what users do again and again."""

import importlib

import bpy

MODULE = "bl_ext.user_default.palpate"


def palpate(name=""):
    """Return a module of the installed extension, as in "addon.session.first_use"."""
    return importlib.import_module(f"{MODULE}.{name}".rstrip("."))


def status():
    """Return what is known of the present frame."""
    return palpate("addon.session.frame_status").status_of(bpy.context.scene)


def solver(ui):
    """Wait until the solver is compiled: the first road of a run takes half a minute for it."""
    yield from ui.wait_until(palpate("addon.session.first_use").is_ready, "the solver is ready", timeout=900)


def obj(name):
    """Return an object; looked up each time, because undo and opening a file make new ones."""
    return bpy.data.objects[name]


def forces(name):
    """Return the forces that playing has written to a sensor's mesh."""
    attribute = obj(name).data.attributes.get("palpate_force")
    return [item.value for item in attribute.data] if attribute else [0.0]


def empty():
    """Remove everything from the scene."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)


def press_scene(ui):
    """Build and save a ball that is pressed into a pad, and a free cube on a second one."""
    empty()
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 40
    scene.unit_settings.scale_length = 0.01
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.8, location=(0.0, 0.0, 0.9))
    ball = bpy.context.object
    ball.name, ball.palpate.role, ball.display_type = "Ball", "TARGET", "WIRE"
    ball.keyframe_insert("location", frame=1)
    ball.location = (0.5, 0.0, 0.4)
    ball.keyframe_insert("location", frame=30)
    bpy.ops.mesh.primitive_cube_add(size=0.8, location=(-2.5, 0.0, 0.5))
    cube = bpy.context.object
    cube.name, cube.palpate.role, cube.palpate.body, cube.palpate.mass = "Cube", "TARGET", "FREE", 0.02
    for name, x in (("Pad 2", -2.5), ("Pad", 0.0)):
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20, size=2.4, location=(x, 0.0, 0.0))
        bpy.context.object.name = name
        bpy.context.object.palpate.max_penetration = 1.0
    scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=str(ui.out / "press.blend"))
    with ui.context(ui.area("VIEW_3D")):
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.view3d.view_selected()
    for thing in scene.objects:
        thing.select_set(thing.name == "Pad")
    yield 0.5


def over_view(ui):
    """Move the mouse over the 3D view."""
    yield from ui.move(*ui.centre(ui.area("VIEW_3D")))


def key_over_view(ui, kind, **modifiers):
    """Press a key while the mouse is over the 3D view."""
    yield from over_view(ui)
    yield from ui.key(kind, **modifiers)


def undo(ui, **modifiers):
    """Press Ctrl Z over the 3D view."""
    yield from key_over_view(ui, "Z", ctrl=True, **modifiers)
    yield 0.5


def timeline(ui, name, value):
    """Type a value into a field of the timeline's header."""
    area = ui.area("DOPESHEET_EDITOR")
    header = ui.region(area, "HEADER")
    y = header.y + header.height // 2
    for x in range(header.x + header.width - 10, header.x, -24):
        yield from ui.move(x, y)
        if ui.button_here(area, "HEADER") == name:
            break
    yield from ui.move(x - 25, y)  # at its ends a number field has arrows, which Enter would press
    ui.check(ui.button_here(area, "HEADER") == name, f"the timeline has the field {name}")
    yield from ui.key("RET")
    yield from ui.key("A", ctrl=True)
    yield from ui.type(str(value))
    yield from ui.key("RET")
    yield 0.3


def add(ui, words):
    """Shift A over the 3D view, then type what to add."""
    yield from key_over_view(ui, "A", shift=True)
    yield 0.5
    yield from ui.type(words)
    yield 0.5
    yield from ui.key("RET")
    yield 0.5


def adjust(ui, *values):
    """Open the box at the lower left of the 3D view by its title, and type into its fields from the top; None: leave it."""
    area = ui.area("VIEW_3D")
    if ui.region(area, "HUD").height < 60:
        yield from ui.click(*ui.centre(area, "HUD"))
        yield 0.5
    box = ui.region(area, "HUD")
    yield from ui.move(box.x + 0.68 * box.width, box.y + box.height - 45)  # the first field; Tab leads to the next
    yield from ui.key("RET")
    for index, value in enumerate(values):
        if index > 0:
            yield from ui.key("TAB")
        if value is not None:
            yield from ui.key("A", ctrl=True)
            yield from ui.type(str(value))
    yield from ui.key("RET")
    yield 0.5


def choose_file(ui, folder, name=None):
    """Show a folder in the file browser, name a file, and click the button at the lower right."""
    yield from ui.wait_until(lambda: any(a.type == "FILE_BROWSER" for a in ui.window.screen.areas), "a file is asked for")
    browser = ui.area("FILE_BROWSER")
    yield 1.0
    browser.spaces.active.params.directory = str(folder).encode()
    if name is not None:
        browser.spaces.active.params.filename = name
    yield 1.0
    yield from ui.screenshot(f"choose-in-{folder.name}")
    buttons = ui.region(browser, "EXECUTE")
    yield from ui.click(buttons.x + buttons.width - 70, buttons.y + buttons.height // 2)
    yield 1.5


def close_plots():
    """Close the windows that plots were shown in."""
    while len(bpy.context.window_manager.windows) > 1:
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
            bpy.ops.wm.window_close()
        yield 1.0
