# SPDX-License-Identifier: GPL-3.0-or-later
"""Drive a real Blender window: runs inside Blender, plays roads (scripts of steps) one by one and writes down what it saw.

    blender --enable-event-simulate --python driver.py -- OUT_FOLDER ROAD.py …

A road is a file with `def road(ui)`, a generator. Blender's own loop runs between its `yield`s: `yield 0.5` waits half
a second, `yield from ui.click(x, y)` plays real mouse events. Each begins in an empty file of its own. See README.md.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import re
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import bpy

Steps = Generator[float | None, None, Any]

TICK = 0.05  # seconds between two events, so that Blender handles and draws each
GLIDE = 0.02  # where only the last of many counts
PATIENCE = 180.0  # seconds for what a slow machine may take long for; nothing waits longer than it has to
KEY_NAMES = {" ": "SPACE", ".": "PERIOD", ",": "COMMA", "-": "MINUS", "/": "SLASH", "=": "EQUAL", "\\": "BACK_SLASH"}
KEY_NAMES |= {"_": "MINUS", ":": "SEMI_COLON", ";": "SEMI_COLON", "'": "QUOTE", '"': "QUOTE", "+": "EQUAL"}
DIGITS = ["ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE"]
KEY_NAMES |= {str(digit): name for digit, name in enumerate(DIGITS)}


class UIError(Exception):
    """Something a road waited for or looked for was not there."""


class UI:
    """The hands and eyes of a road. Coordinates are pixels of the window, from its lower left corner."""

    def __init__(self, out: Path) -> None:
        out.mkdir()
        self.out = out
        self.result: dict[str, Any] = {
            "finished": False,
            "error": None,
            "checks": [],
            "values": {},
            "screenshots": [],
            "steps": [],
        }
        self.started = time.monotonic()
        self.x = self.y = 0
        self.places: dict[str, tuple[int, int]] = {}  # where buttons were found last

    # --- what it writes down

    def save(self) -> None:
        """Write the results so far; a crash loses nothing."""
        partial = self.out / "results.json.partial"
        partial.write_text(json.dumps(self.result, indent=1), encoding="utf-8")
        partial.replace(self.out / "results.json")

    def say(self, text: str) -> None:
        """Note a step."""
        self.result["steps"].append(f"{time.monotonic() - self.started:6.1f} s  {text}")
        print(self.result["steps"][-1], flush=True)
        self.save()

    def check(self, passed: object, what: str) -> None:
        """Note whether something holds; the test fails at the end if it did not."""
        self.result["checks"].append({"what": what, "passed": bool(passed)})
        self.say(f"{'ok  ' if passed else 'FAIL'} {what}")

    def value(self, name: str, value: object) -> None:
        """Note a value for the test to judge (numbers, text, lists and dictionaries of them)."""
        self.result["values"][name] = value
        self.save()

    def screenshot(self, name: str) -> Steps:
        """Take a picture of the whole screen."""
        self.redraw()
        yield 0.3
        self.redraw()
        path = self.out / f"{name}.png"
        subprocess.run(["import", "-window", "root", str(path)], check=True)
        self.result["screenshots"].append(path.name)
        self.say(f"screenshot {path.name}")

    # --- where things are

    @property
    def window(self) -> bpy.types.Window:
        """The first window; looked up each time, because loading a file makes a new one."""
        return bpy.context.window_manager.windows[0]

    def area(self, kind: str) -> bpy.types.Area:
        """Return the largest area of a kind, as in "PROPERTIES" or "VIEW_3D"."""
        areas = [area for area in self.window.screen.areas if area.type == kind]
        if not areas:
            raise UIError(f"There is no {kind} area; there are {[a.type for a in self.window.screen.areas]}.")
        return max(areas, key=lambda area: area.width * area.height)

    @staticmethod
    def region(area: bpy.types.Area, kind: str = "WINDOW") -> bpy.types.Region:
        """Return a region of an area, as in "WINDOW", "HEADER" or "UI"."""
        return next(region for region in area.regions if region.type == kind)

    def centre(self, area: bpy.types.Area, kind: str = "WINDOW") -> tuple[int, int]:
        """Return the middle of a region."""
        region = self.region(area, kind)
        return region.x + region.width // 2, region.y + region.height // 2

    def at(self, point: Any, area: bpy.types.Area | None = None) -> tuple[int, int]:
        """Return where a point of the scene, in world coordinates, is on the screen."""
        from bpy_extras.view3d_utils import location_3d_to_region_2d
        from mathutils import Vector

        area = area or self.area("VIEW_3D")
        region = self.region(area)
        spot = location_3d_to_region_2d(region, area.spaces.active.region_3d, Vector(point))
        if spot is None:
            raise UIError(f"The point {tuple(point)} is behind the view.")
        return round(region.x + spot.x), round(region.y + spot.y)

    @contextlib.contextmanager
    def context(self, area: bpy.types.Area, kind: str = "WINDOW") -> Iterator[None]:
        """Give operators and `bpy.context` this area, as if the mouse were in it."""
        with bpy.context.temp_override(window=self.window, area=area, region=self.region(area, kind)):
            yield

    # --- hands

    def redraw(self) -> None:
        """Ask every area to draw itself again."""
        for area in self.window.screen.areas:
            area.tag_redraw()

    def event(self, kind: str, value: str = "PRESS", **modifiers: Any) -> None:
        """Send one event to where the mouse is."""
        self.window.event_simulate(type=kind, value=value, x=self.x, y=self.y, **modifiers)

    def move(self, x: float, y: float) -> Steps:
        """Move the mouse; in two moves, because Blender wakes a button when the mouse comes in from outside."""
        for dx in (1, 0):
            self.x, self.y = round(x) + dx, round(y)
            self.event("MOUSEMOVE", "NOTHING")
            yield TICK

    def glide(self, x: float, y: float) -> Steps:
        """Move the mouse on, in passing."""
        self.x, self.y = round(x), round(y)
        self.event("MOUSEMOVE", "NOTHING")
        yield GLIDE

    def click(self, x: float, y: float, button: str = "LEFTMOUSE", **modifiers: bool) -> Steps:
        """Click a mouse button; `shift=True` and the like hold a key meanwhile."""
        yield from self.move(x, y)
        for value in ("PRESS", "RELEASE"):
            self.event(button, value, **modifiers)
            yield TICK
        yield 2 * TICK

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 12, **modifiers: bool) -> Steps:
        """Drag with the left button from one place to another, as in painting."""
        yield from self.move(*start)
        self.event("LEFTMOUSE", "PRESS", **modifiers)
        yield TICK
        for i in range(1, steps + 1):
            self.x = round(start[0] + (end[0] - start[0]) * i / steps)
            self.y = round(start[1] + (end[1] - start[1]) * i / steps)
            self.event("MOUSEMOVE", "NOTHING", **modifiers)
            yield TICK
        self.event("LEFTMOUSE", "RELEASE", **modifiers)
        yield 2 * TICK

    def key(self, kind: str, **modifiers: bool) -> Steps:
        """Press and release a key, as in `ui.key("Z", ctrl=True)` or `ui.key("RET")`."""
        for value in ("PRESS", "RELEASE"):
            self.event(kind, value, **modifiers)
            yield TICK
        yield 2 * TICK

    def type(self, text: str) -> Steps:
        """Type text into the field or search box that has the keyboard."""
        for letter in text:
            kind = KEY_NAMES.get(letter, letter.upper())
            self.event(kind, "PRESS", unicode=letter)
            yield TICK / 2
            self.event(kind, "RELEASE")
            yield TICK / 2
        yield 2 * TICK

    def scroll(self, x: float, y: float, notches: int) -> Steps:
        """Turn the wheel; positive notches go down the page."""
        yield from self.move(x, y)
        for _ in range(abs(notches)):
            self.event("WHEELDOWNMOUSE" if notches > 0 else "WHEELUPMOUSE")
            yield GLIDE
        yield 0.2

    def wait_until(self, holds: Callable[[], object], what: str, timeout: float = PATIENCE) -> Steps:
        """Wait until something holds; an error if it does not in time."""
        end = time.monotonic() + timeout
        while not (seen := holds()):
            if time.monotonic() > end:
                raise UIError(f"Waited {timeout:g} s in vain until {what}.")
            yield 0.1
        self.say(f"{what}")
        return seen

    def becomes(self, holds: Callable[[], object], what: str, timeout: float = PATIENCE) -> Steps:
        """Check that something comes to hold, however slow the machine is."""
        end = time.monotonic() + timeout
        while not holds() and time.monotonic() < end:
            yield 0.1
        self.check(holds(), what)

    def works(self, operator: str) -> bool:
        """Whether an operator, as in "palpate.bake", is at work behind the window."""
        group, _, name = operator.partition(".")
        return any(modal.bl_idname == f"{group.upper()}_OT_{name}" for modal in self.window.modal_operators)

    def stop(self, operator: str) -> Steps:
        """Press ESC while an operator is at work. Give it work that no machine can finish before."""
        yield from self.wait_until(lambda: self.works(operator), f"{operator} is at work")
        yield from self.key("ESC")
        yield from self.becomes(lambda: not self.works(operator), f"ESC stops {operator}")

    # --- words for what users do

    def search(self, words: str, area: bpy.types.Area | None = None) -> Steps:
        """Run a command through the F3 search, the mouse over an area (by default the 3D view)."""
        self.say(f"F3 search: {words}")
        yield from self.move(*self.centre(area or self.area("VIEW_3D")))
        yield from self.key("F3")
        yield 0.5
        yield from self.type(words)
        yield 0.5
        yield from self.key("RET")
        yield 0.5

    def tab(self, name: str) -> Steps:
        """Show a tab of the Properties editor, as in "PHYSICS"; how a tab is clicked is Blender's own matter."""
        self.area("PROPERTIES").spaces.active.context = name
        self.say(f"tab {name}")
        yield 0.5

    def filter(self, words: str) -> Steps:
        """Search the Properties editor: shows only what matches and opens closed panels for it; "" ends it."""
        self.area("PROPERTIES").spaces.active.search_filter = words
        self.redraw()
        yield 1.0

    def button_here(self, area: bpy.types.Area, kind: str = "WINDOW") -> str:
        """Return what the button under the mouse does, or "" if there is none.

        A button that runs an operator is named by its call, as in "palpate.sensor_add(role='PAD')", a field by
        its property's path, as in "palpate.k" or "location[0]".
        """
        clipboard = bpy.context.window_manager
        clipboard.clipboard = ""
        with self.context(area, kind):
            if bpy.context.property is not None and bpy.ops.ui.copy_data_path_button.poll():
                # its own path lacks the groups the property is in; the one for the clipboard has them
                bpy.ops.ui.copy_data_path_button(full_path=True)
                return re.sub(r'^bpy\.data\.\w+\["(?:[^"\\]|\\.)*"\]\.', "", clipboard.clipboard)
            if bpy.ops.ui.copy_python_command_button.poll():
                bpy.ops.ui.copy_python_command_button()
        return clipboard.clipboard.removeprefix("bpy.ops.")

    def find(self, name: str, area: bpy.types.Area | None = None, kind: str = "WINDOW") -> Steps:
        """Feel the way down a panel until the mouse is on a button; scrolls as far as the panel goes.

        Parameters
        ----------
        name : str
            What the button does, as `button_here` says it; an operator's id alone stands for any call of it.
        area : Area, optional
            Where to look; by default the Properties editor.
        kind : str
            Which region of it.

        Returns
        -------
        (int, int)
            Where the button is.

        Raises
        ------
        UIError
            If there is none; the message lists the buttons there are.
        """
        area = area or self.area("PROPERTIES")
        region = self.region(area, kind)
        seen: dict[str, None] = {}
        yield from self.move(*self.places.get(name, self.centre(area, kind)))
        here = self.button_here(area, kind) if name in self.places else ""
        if name in (here, here.partition("(")[0]):
            self.say(f"found {here} where it was")
            return self.x, self.y
        unscrolled = True
        while True:
            for share in (0.6, 0.3, 0.85, 0.9):
                # A row is 20 pixels high, and a button wakes at the second event in it.
                for y in range(region.y + region.height - 8, region.y + 4, -11):
                    yield from self.glide(region.x + region.width * share, y)
                    here = self.button_here(area, kind)
                    seen[here] = None
                    if name not in (here, here.partition("(")[0]):
                        continue
                    yield from self.move(self.x, self.y)  # the button under a gliding mouse wakes late: look again
                    if self.button_here(area, kind) == here:
                        self.say(f"found {here} at {self.x}, {self.y}")
                        self.places[name] = self.x, self.y
                        return self.x, self.y
            before = region.view2d.region_to_view(0, 0)
            yield from self.scroll(*self.centre(area, kind), -60 if unscrolled else 8)
            if not unscrolled and region.view2d.region_to_view(0, 0) == before:
                raise UIError(f"No button {name!r} in {area.type}; there are: {', '.join(filter(None, seen))}.")
            unscrolled = False

    def press(self, name: str, area: bpy.types.Area | None = None, kind: str = "WINDOW") -> Steps:
        """Find a button and click it."""
        x, y = yield from self.find(name, area, kind)
        yield from self.click(x, y)
        yield 0.3

    def fill(self, name: str, text: str, area: bpy.types.Area | None = None, kind: str = "WINDOW") -> Steps:
        """Find a field and type a new value into it."""
        yield from self.find(name, area, kind)
        yield from self.key("RET")
        yield from self.key("A", ctrl=True)
        yield from self.type(text)
        yield from self.key("RET")
        yield 0.3


def load_road(path: Path) -> Callable[[UI], Steps]:
    """Return a road's generator function."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.road


def play(roads: list[Path], out: Path) -> Steps:
    """Play one road after another. One that breaks off is written down, and the next begins in a new file as ever."""
    for path in roads:
        print(f"road {path.stem}", flush=True)
        ui = UI(out / path.stem)
        ui.save()
        try:
            yield from ui.wait_until(lambda: bpy.context.window_manager.windows, "the window is up")
            bpy.context.scene.eevee.taa_samples = 1  # a processor draws
            yield 2.0  # the first drawing compiles shaders
            yield from load_road(path)(ui)
            ui.result["finished"] = True
            yield from ui.screenshot("end")
        except BaseException:  # whatever it is, it is written down and fails the test
            ui.result["error"] = traceback.format_exc()
            ui.say("the road broke off")
            with contextlib.suppress(subprocess.CalledProcessError):
                subprocess.run(["import", "-window", "root", str(ui.out / "broken-off.png")], check=True)
            for _ in range(3):
                yield from ui.key("ESC")
        ui.save()
        if path != roads[-1]:
            bpy.ops.wm.read_homefile()
            yield 1.0
    bpy.ops.wm.quit_blender()  # by script: asks nothing


def main() -> None:
    """Let Blender's timers pull the roads that are named on the command line."""
    out, *roads = (Path(argument) for argument in sys.argv[sys.argv.index("--") + 1 :])
    sys.path.insert(0, str(roads[0].parent))  # roads share what users do again and again
    steps = play(roads, out)
    bpy.app.timers.register(lambda: next(steps, None) or TICK, first_interval=0.5, persistent=True)


if __name__ == "__main__":
    main()
