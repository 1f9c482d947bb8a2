# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways of making a sensor in the window: a pad from the Add menu, texels laid on a surface, a problem and its button."""

import bpy
from tutorial import add, adjust


def sensor_of(name):
    return bpy.data.objects[name]


def road(ui):
    view = ui.area("VIEW_3D")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("DEL")
    # A pad
    yield from add(ui, "tactile pad")
    pad = bpy.context.object
    ui.check(
        pad.palpate.role == "SENSOR" and len(pad.data.vertices) == 84, "Add › Mesh › Tactile Pad makes a sensor of 84 texels"
    )
    yield from adjust(ui, 10, 8, None, None, 0.02)  # rows, columns, and the radius of the bend
    ui.check(len(bpy.context.object.data.vertices) == 80, "rows and columns can be changed in the box")
    yield from ui.tab("PHYSICS")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("NUMPAD_PERIOD")
    yield from ui.press("palpate.show_numbers")
    yield 1.0
    yield from ui.screenshot("pad")
    yield from ui.press("palpate.show_numbers")

    # Texels on a fingertip, from the sidebar
    with ui.context(view):
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.object.delete()
        finger = fingertip()
    yield from ui.move(*ui.centre(view))
    yield from ui.key("NUMPAD_PERIOD")
    yield from ui.key("N")
    yield 0.5
    ui.region(view, "UI").active_panel_category = "Palpate"
    yield 1.0
    yield from ui.screenshot("sidebar")
    yield from ui.press("palpate.skin_add()", view, "UI")
    skin = bpy.context.object
    ui.check(skin.parent == finger and skin.palpate.role == "SENSOR", "Lay Texels in the sidebar lays them")
    ui.value("texels", len(skin.data.vertices))
    yield 1.0
    yield from ui.screenshot("laid")

    # A problem, and its button
    for face in skin.data.polygons:
        face.flip()
    skin.data.update()
    yield from ui.wait_until(lambda: kinds(skin) == ["FLIPPED"], "the flipped normals are noticed")
    yield 0.5
    yield from ui.screenshot("problem")
    yield from ui.press("palpate.fix", view, "UI")
    yield from ui.wait_until(lambda: kinds(skin) == [], "one click puts them right")

    # F3 finds it, undo takes it back
    yield from ui.search("add probe")
    ui.check("Probe" in bpy.data.objects, "F3 finds Add Probe")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("Z", ctrl=True)
    yield 0.5
    ui.check("Probe" not in bpy.data.objects, "Ctrl Z takes the probe away")

    # Effects
    with ui.context(view):
        bpy.context.view_layer.objects.active = bpy.data.objects["Fingertip Skin"]
        for effect in ("creep", "crosstalk"):
            bpy.ops.palpate.effect_add(effect=effect)
    yield from ui.filter("Creep")
    yield from ui.screenshot("effects")
    yield from ui.filter("")


def kinds(obj):
    from bl_ext.user_default.palpate.addon.authoring import sensor_report

    report = sensor_report.known_report(obj, bpy.context.scene)
    return [problem.kind for problem in report.problems] if report else None


def fingertip():
    """A capsule of 16 mm, its upper part painted."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.008, segments=48, ring_count=32)
    obj = bpy.context.object
    obj.name = "Fingertip"
    for vertex in obj.data.vertices:
        if vertex.co.x < 0:
            vertex.co.x *= 2.5
    group = obj.vertex_groups.new(name="Tip")
    group.add([v.index for v in obj.data.vertices if v.co.z > 0.001 and v.co.x > -0.012], 1.0, "REPLACE")
    obj.palpate.role, obj.palpate.region, obj.palpate.vertex_group = "SENSOR", "GROUP", "Tip"
    obj.palpate.max_penetration = 0.004
    return obj
