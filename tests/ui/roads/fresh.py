# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects, Plan Experiment and Study from a fresh file, as a new user comes to them; Find Gap is the road `gap`."""

import bpy
from tutorial import add


def pad():
    return bpy.data.objects["Tactile Pad"]


def road(ui):
    rig, view = ui.out.parent / "sample-rig" / "rig.toml", ui.area("VIEW_3D")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("DEL")
    yield from add(ui, "tactile pad")
    yield from ui.move(*ui.centre(view))
    yield from ui.key("NUMPAD_PERIOD")

    # 1. Effects
    yield from ui.search("add effect creep")
    ui.check([effect.kind for effect in pad().palpate.effects] == ["creep"], "F3 adds an effect")

    # 2. Study: what is missing is said
    yield from ui.search("run study")
    ui.check(not ui.works("palpate.study_run"), "a study of a scene without a file does not start")
    yield from ui.screenshot("study")
    yield from ui.move(*ui.centre(ui.area("OUTLINER")))  # the message closes when the mouse leaves it

    # 3. Plan Experiment
    yield from ui.tab("PHYSICS")
    yield from ui.filter("Measured Data")
    yield from ui.fill("palpate.measured", str(rig))
    yield from ui.press("palpate.gap_plan()")
    yield from ui.wait_until(lambda: "Planned Probe" in bpy.data.objects, "a probe follows the plan", timeout=300)
    yield from ui.wait_until(lambda: not ui.works("palpate.gap_plan"), "the plan is done")
    from bl_ext.user_default.palpate.addon.measured import planned_probe

    ui.value("planned", planned_probe.sentence_of(pad()))
    ui.value("role", bpy.data.objects["Planned Probe"].palpate.role)
    yield 1.0
    yield from ui.screenshot("planned")
