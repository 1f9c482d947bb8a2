# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways of making a sensor: the Add menu, the sidebar, a problem and its button, F3, fields and undo."""

import bpy
from steps import add, adjust, empty, key_over_view, obj, palpate, undo


def road(ui):
    # A pad, its texels numbered in the view, a stiffness in a closed panel
    yield from key_over_view(ui, "DEL")
    yield from add(ui, "tactile pad")
    ui.check(obj("Tactile Pad").palpate.role == "SENSOR", "Add › Mesh › Tactile Pad makes a sensor")
    yield from adjust(ui, 10, 8, None, None, 0.02)  # rows, columns, and the radius of the bend
    ui.check(len(obj("Tactile Pad").data.vertices) == 80, "rows and columns can be changed in the box")
    yield from ui.tab("PHYSICS")
    yield from key_over_view(ui, "NUMPAD_PERIOD")
    yield from ui.press("palpate.show_numbers")
    yield 1.0
    yield from ui.screenshot("pad")
    yield from ui.press("palpate.show_numbers")
    yield from ui.filter("Stiffness k")
    yield from ui.fill("palpate.k", "1234.5")
    ui.check(abs(obj("Tactile Pad").palpate.k - 1234.5) < 1e-3, "a field takes a number")
    yield from ui.filter("e")  # opens the panels
    yield from ui.screenshot("panels")
    yield from ui.filter("")
    yield from undo(ui)
    ui.check(obj("Tactile Pad").palpate.role == "SENSOR", "the first Ctrl Z takes back the stiffness only")
    ui.check(abs(obj("Tactile Pad").palpate.k - 1234.5) > 1.0, "which is as before")
    yield from ui.search("preset weiss")
    ui.check(obj("Tactile Pad").palpate.k == 1000.0, "F3 finds presets")

    # Texels on a fingertip, from the sidebar
    empty()
    view, finger = ui.area("VIEW_3D"), fingertip()
    yield from key_over_view(ui, "NUMPAD_PERIOD")
    yield from ui.key("N")
    yield 0.5
    ui.region(view, "UI").active_panel_category = "Palpate"
    yield 1.0
    yield from ui.press("palpate.skin_add()", view, "UI")
    skin = bpy.context.object
    ui.check(skin.parent == finger and skin.palpate.role == "SENSOR", "Lay Texels in the sidebar lays them")
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


def kinds(thing):
    report = palpate("addon.authoring.sensor_report").known_report(thing, bpy.context.scene)
    return [problem.kind for problem in report.problems] if report else None


def fingertip():
    """A capsule of 16 mm, its upper part painted."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.008, segments=48, ring_count=32)
    finger = bpy.context.object
    finger.name = "Fingertip"
    for vertex in finger.data.vertices:
        if vertex.co.x < 0:
            vertex.co.x *= 2.5
    group = finger.vertex_groups.new(name="Tip")
    group.add([v.index for v in finger.data.vertices if v.co.z > 0.001 and v.co.x > -0.012], 1.0, "REPLACE")
    finger.palpate.role, finger.palpate.region, finger.palpate.vertex_group = "SENSOR", "GROUP", "Tip"
    finger.palpate.max_penetration = 0.004
    return finger
