# SPDX-License-Identifier: GPL-3.0-or-later
"""One plays, scrubs, changes a number, bakes, undoes and saves, again and again; the memory of Blender is written down."""

import gc
import os
import time
from pathlib import Path

import bpy
from steps import key_over_view, obj, press_scene, solver, undo

LEAST_ROUNDS = 5
"""In Solid view and Material Preview in turn: two of each can be compared after Material Preview was first shown."""
KINDS = "objects", "meshes", "images", "materials", "node_groups", "curves", "texts"


def resident():
    """MB of memory that the process holds."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def play_a_while(ui, seconds):
    yield from key_over_view(ui, "SPACE")
    yield seconds
    yield from ui.key("SPACE")
    for _ in range(5):
        yield from ui.key("LEFT_ARROW")


def bake_and_undo(ui):
    yield from ui.wait_until(bpy.ops.palpate.bake.poll, "frames are computed again, and Bake is no longer grey")
    yield from ui.press("palpate.bake()")
    yield from ui.wait_until(lambda: obj("Pad").palpate.is_baked, "the bake is done")
    yield from undo(ui)
    yield from ui.wait_until(lambda: not obj("Pad").palpate.is_baked, "Ctrl Z takes the bake away")
    yield from undo(ui, shift=True)
    yield from ui.wait_until(lambda: obj("Pad").palpate.is_baked, "Ctrl Shift Z brings it back")
    yield from play_a_while(ui, 1.0)
    yield from ui.press("palpate.bake_clear")
    yield from ui.wait_until(lambda: not obj("Pad").palpate.is_baked, "Clear Bake clears it")


def road(ui):
    minutes = float(os.environ["PALPATE_MINUTES"])
    yield from press_scene(ui)
    obj("Pad").palpate.role = "SENSOR"
    yield from ui.tab("PHYSICS")
    yield from solver(ui)
    end = time.monotonic() + 60 * minutes
    began, rounds = time.monotonic(), []
    while time.monotonic() < end or len(rounds) < LEAST_ROUNDS:
        yield from play_a_while(ui, 2.0)
        obj("Pad").palpate.k = 900.0 + 10 * (len(rounds) % 20)
        bpy.ops.ed.undo_push(message="Stiffness")
        yield 1.0
        shading = ("SOLID", "MATERIAL")[len(rounds) % 2]
        ui.area("VIEW_3D").spaces.active.shading.type = shading
        with ui.context(ui.area("PROPERTIES")):  # what a click leaves active
            bpy.context.view_layer.objects.active = obj("Pad")
        yield from bake_and_undo(ui)
        yield from key_over_view(ui, "S", ctrl=True)
        blocks = {kind: len(getattr(bpy.data, kind)) for kind in KINDS}
        gc.collect()
        now = {"shading": shading, "minutes": (time.monotonic() - began) / 60, "MB": resident()}
        rounds.append(now | {"Python objects": len(gc.get_objects())} | blocks)
        ui.value("rounds", rounds)
        ui.say(f"round {len(rounds)}: {resident():.0f} MB")
    ui.check({kind: rounds[-1][kind] for kind in KINDS} == {kind: rounds[0][kind] for kind in KINDS}, "no data is left behind")
