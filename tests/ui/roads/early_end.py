# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender is closed while the solver is being compiled."""

import bpy
import first_use
import press


def road(ui):
    press.build(ui.out, sensors=False)
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.sensor_add()")
    yield 3.0
    ui.check(first_use.preparing().progress() is not None, "the compiler runs")
    ui.check(bpy.app.timers.is_registered(first_use.preparing()._poll), "and is looked at")
