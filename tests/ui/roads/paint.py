# SPDX-License-Identifier: GPL-3.0-or-later
"""A fingertip is painted with real strokes, pressed with a probe and played: from nothing to the first tactile image.

What a person does is counted, and timed as the keystroke-level model does (Card, Moran and Newell 1980): 0.28 s for a key,
1.1 s to point, 0.2 s for a click, 1.1 s for a stroke of the brush, 1.35 s to think before each new thing.
"""

import bpy
import solver
from tutorial import add, adjust

KEY, POINT, CLICK, STROKE, THINK = 0.28, 1.1, 0.2, 1.1, 1.35


class Person:
    """Counts what a person would have to do; the driver itself moves the mouse far more often, to feel its way."""

    def __init__(self, ui):
        self.ui, self.counts = ui, {"keys": 0, "clicks": 0, "strokes": 0, "thoughts": 0}
        send = ui.event

        def event(kind, value="PRESS", **modifiers):
            if value == "PRESS" and kind not in {"MOUSEMOVE", "WHEELDOWNMOUSE", "WHEELUPMOUSE"}:
                self.counts["clicks" if kind == "LEFTMOUSE" else "keys"] += 1
            send(kind, value, **modifiers)

        ui.event = event

    def thinks(self):
        self.counts["thoughts"] += 1

    @property
    def seconds(self):
        c = self.counts
        strokes = c["strokes"] * (POINT + STROKE)
        clicks = (c["clicks"] - c["strokes"]) * (POINT + CLICK)  # a stroke is a press, too
        return c["keys"] * KEY + clicks + strokes + c["thoughts"] * THINK


def road(ui):
    person = Person(ui)
    view = ui.area("VIEW_3D")
    # Nothing: the cube goes
    yield from ui.move(*ui.centre(view))
    yield from ui.key("DEL")
    person.thinks()
    # A fingertip
    yield from add(ui, "uv sphere")
    yield from adjust(ui, 64, 48, 0.01, None, None, None)
    person.thinks()
    yield from ui.move(*ui.centre(view))
    yield from ui.key("NUMPAD_PERIOD")
    yield 1.0
    finger = bpy.context.object
    ui.check(len(finger.data.vertices) > 1000, "a ball of 10 mm with enough vertices")
    # Paint it
    yield from ui.tab("PHYSICS")
    person.thinks()
    yield from ui.press("palpate.weight_paint")
    ui.check(finger.mode == "WEIGHT_PAINT", "Paint a Sensor enters Weight Paint")
    ui.check(finger.palpate.role == "SENSOR", "and it is a sensor")
    person.thinks()
    yield from ui.screenshot("weight-paint")
    x, y = ui.centre(view)
    for dy in (110, 65, 20, -25, -70, -115):
        yield from ui.drag((x - 130, y + dy), (x + 130, y + dy), steps=16)
        person.counts["strokes"] += 1
    painted = sum(1 for v in finger.data.vertices for g in v.groups if g.weight >= 0.5)
    ui.value("painted", painted)
    ui.check(painted > 40, f"six strokes painted {painted} vertices")
    yield 1.0
    yield from ui.screenshot("painted")
    # Press it
    person.thinks()
    yield from ui.press("palpate.probe_add")
    probe = bpy.data.objects.get("Probe")
    ui.check(probe is not None and probe.palpate.role == "TARGET", "Add Probe adds something that presses")
    ui.check(finger.mode == "OBJECT", "and leaves Weight Paint")
    yield 1.0
    yield from ui.screenshot("probe")
    person.thinks()
    yield from solver.wait(ui)
    yield from ui.move(*ui.centre(view))
    yield from ui.key("SPACE")
    yield from ui.wait_until(lambda: bpy.context.scene.frame_current >= 32, "frame 32 plays", timeout=120)
    ui.value("seconds", person.seconds)
    ui.value("counts", dict(person.counts))
    ui.say(f"{person.counts}: {person.seconds:.0f} s of a person's time")
    ui.check(person.seconds < 120, "from nothing to the first tactile image in less than two minutes")
    yield from ui.screenshot("first-tactile-image")
    yield from ui.key("SPACE")
    yield 0.5
    forces = [v.value for v in finger.data.attributes["palpate_force"].data]
    ui.value("largest", max(forces))
    ui.check(max(forces) > 0, "the finger feels it")
