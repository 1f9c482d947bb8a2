# SPDX-License-Identifier: GPL-3.0-or-later
"""A cube becomes a sensor by a button, gets a stiffness typed into a closed panel, and stops being one by Ctrl Z."""

import bpy


def cube():
    return bpy.data.objects["Cube"]  # looked up each time: undo makes a new one


def road(ui):
    yield from ui.tab("PHYSICS")
    yield from ui.screenshot("no-role")
    yield from ui.press("palpate.sensor_add()")
    ui.check(cube().palpate.role == "SENSOR", "Make Sensor makes the cube a sensor")
    yield from ui.screenshot("sensor")

    yield from ui.filter("Stiffness k")
    yield from ui.screenshot("filtered")
    yield from ui.fill("palpate.k", "1234.5")
    ui.value("k", cube().palpate.k)
    yield from ui.screenshot("stiffness")
    yield from ui.filter("")

    # A wide editor has the names beside the fields
    yield from ui.maximize(ui.area("PROPERTIES"))
    yield from ui.filter("e")  # opens the panels
    ui.check(ui.region(ui.area("PROPERTIES")).width > 1000, "the editor is wide")
    yield from ui.screenshot("wide")
    yield from ui.filter("")
    yield from ui.maximize(ui.area("PROPERTIES"))

    yield from ui.move(*ui.centre(ui.area("VIEW_3D")))
    yield from ui.key("Z", ctrl=True)
    ui.check(cube().palpate.role == "SENSOR", "the first Ctrl Z takes back the stiffness only")
    ui.value("k after undo", cube().palpate.k)
    yield from ui.key("Z", ctrl=True)
    ui.check(cube().palpate.role == "NONE", "the second Ctrl Z takes back the sensor")
    yield from ui.screenshot("undone")
