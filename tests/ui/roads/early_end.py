# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender is closed while the solver is being compiled; nothing that it started outlives it, as the caller checks."""

import bpy
from steps import palpate, press_scene


def road(ui):
    yield from press_scene(ui)
    yield from ui.tab("PHYSICS")
    yield from ui.press("palpate.sensor_add()")
    yield 3.0
    preparing = palpate("addon.session.first_use")
    ui.check(preparing.progress() is not None, "the compiler runs")
    ui.check(bpy.app.timers.is_registered(preparing._poll), "and is looked at")
