# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes as a stranger might send them: odd names, numbers, links, drivers and meshes. Everything here runs in a worker."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

ODD_NAMES = (
    "A" * 63, "A.old", "project", ".palpate", "unfinished.partial", "baking.lock", "a/b", "..", "a\\b", "\u202e", "=cmd|x!A0",
    "con", " ", "%s{0}", "ä" * 30, "switch.json",
)  # fmt: skip
ODD_NUMBERS = (float("nan"), float("inf"), -1.0, 0.0, 1e-30, 1e30)
MARK_OF_SCRIPTS = "scripts-were-run"
"""Folder that the Python in a scene makes where the command runs."""
PROPERTIES = ("k", "cn", "sigma0", "mus", "gain", "max_penetration")


def _rename(name: str) -> Callable[[Any], None]:
    def change(scene: Any) -> None:
        scene.objects["Pad"].name = name

    return change


def _number(name: str, value: float) -> Callable[[Any], None]:
    def change(scene: Any) -> None:
        settings = scene.objects["Pad"].palpate
        if hasattr(settings, name):
            setattr(settings, name, value)

    return change


def _location(value: float) -> Callable[[Any], None]:
    def change(scene: Any) -> None:
        scene.objects["Pad"].location = (value, 0.0, 0.0)

    return change


def _scale(value: float) -> Callable[[Any], None]:
    def change(scene: Any) -> None:
        scene.objects["Pad"].scale = (value, value, value)

    return change


def _vertex(value: float) -> Callable[[Any], None]:
    def change(scene: Any) -> None:
        scene.objects["Pad"].data.vertices[0].co.z = value

    return change


def _gravity(value: float) -> Callable[[Any], None]:
    def change(scene: Any) -> None:
        scene.gravity = (0.0, 0.0, value)

    return change


def _driver(expression: str) -> Callable[[Any], None]:
    def change(scene: Any) -> None:
        scene.objects["Pad"].driver_add("location", 2).driver.expression = expression

    return change


def _folder(text: str) -> Callable[[Any], None]:
    def change(scene: Any) -> None:
        scene.palpate.folder = text

    return change


def _frames(first: int, last: int, fps: int = 24) -> Callable[[Any], None]:
    def change(scene: Any) -> None:
        scene.frame_start, scene.frame_end, scene.render.fps = first, last, fps

    return change


def _parents(scene: Any) -> None:
    scene.objects["Pad"].parent = scene.objects["Pad.old"]
    scene.objects["Pad.old"].constraints.new("COPY_TRANSFORMS").target = scene.objects["Pad"]


def _no_faces(scene: Any) -> None:
    scene.objects["Pad"].data.clear_geometry()


def _no_sensors(scene: Any) -> None:
    for obj in scene.objects:
        obj.palpate.role = "NONE"


def _everything_is_a_target(scene: Any) -> None:
    for obj in scene.objects:
        obj.palpate.role = "TARGET"


def _text(scene: Any) -> None:
    import bpy

    text = bpy.data.texts.new("evil.py")
    text.write(f"import os; os.mkdir('{MARK_OF_SCRIPTS}')")
    text.use_module = True


def _free(mass: float) -> Callable[[Any], None]:
    def change(scene: Any) -> None:
        for obj in scene.objects:
            if obj.palpate.role == "TARGET":
                obj.palpate.body, obj.palpate.mass = "FREE", mass

    return change


def _changes() -> dict[str, Callable[[Any], None]]:
    found: dict[str, Callable[[Any], None]] = {f"name {name!r}": _rename(name) for name in ODD_NAMES}
    found |= {f"{name} = {value}": _number(name, value) for name in PROPERTIES for value in ODD_NUMBERS}
    for value in ODD_NUMBERS:
        found |= {
            f"location {value}": _location(value),
            f"scale {value}": _scale(value),
            f"vertex at {value}": _vertex(value),
            f"gravity {value}": _gravity(value),
            f"free body of {value} kg": _free(value),
        }
    for text in (
        "frame / 100",
        f"__import__('os').mkdir('{MARK_OF_SCRIPTS}')",
        "1 / 0",
        "nonsense(",
        "sin(frame)*1e300",
    ):
        found[f"driver {text}"] = _driver(text)
    for text in ("//", "//.", "/", "/proc", "/dev/null", "//.palpate", "//palpate-bake/Pad", "//x\n", "", "//" + "a" * 300):
        found[f"bake folder {text!r}"] = _folder(text)
    found |= {
        "frames 0 to 0": _frames(0, 0),
        "frames 1000000 to 1000001": _frames(1000000, 1000001),
        "one frame per second": _frames(1, 2, 1),
        "parents in a circle": _parents,
        "no faces": _no_faces,
        "no sensors": _no_sensors,
        "no sensor but targets": _everything_is_a_target,
        "a script": _text,
    }
    return found


def kinds() -> list[str]:
    """Return the names of all hostile scenes."""
    return list(_changes())


def make(kind: str, path: str) -> None:
    """Save a hostile scene."""
    import bpy

    from .scenes import make_scene

    make_scene(path, frames=3)
    _changes()[kind](bpy.context.scene)
    bpy.ops.wm.save_as_mainfile(filepath=path, compress=True)
    if os.path.exists(f"{path}1"):
        os.unlink(f"{path}1")


def problem_of_bake(folder: str) -> str:
    """Return what is wrong with a bake that a command has called good; empty if nothing is."""
    import numpy as np

    from palpate.core.errors import PalpateError
    from palpate.core.io.bake_reader import read_bake

    try:
        bake = read_bake(folder)
    except PalpateError as error:
        return f"the bake cannot be read: {error}"
    for name, sensor in bake.recording.sensors.items():
        if not np.isfinite(sensor.normal_force).all() or not np.isfinite(sensor.net_force).all():
            return f"forces of '{name}' are not finite"
    return ""


def leave() -> None:
    """Let go of a folder that is about to be unmounted."""
    import bpy

    os.chdir("/")
    bpy.ops.wm.read_factory_settings(use_empty=True)
