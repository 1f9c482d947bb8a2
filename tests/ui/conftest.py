# SPDX-License-Identifier: GPL-3.0-or-later
"""A real Blender with the extension installed, whose window plays all roads that are asked for (see README.md)."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import build_zip
import provision_blender
import pytest

SCREEN = (1600, 1000)
# Folders of the repository and where the Blender inside sees them
WORK, HERE, RIG = "/palpate-work", "/palpate-ui", "/palpate-rig"
PREFERENCES = """
import bpy
preferences = bpy.context.preferences
preferences.view.show_splash = False  # it would take the first click
preferences.view.smooth_view = 0
preferences.system.viewport_aa = "OFF"  # a processor draws: each view would be drawn eight times
bpy.ops.wm.save_userpref()
"""
LONGEST = 3600.0
"""Seconds after which a window that hangs is closed, beyond the minutes that it is used on purpose."""


def pytest_addoption(parser):
    versions = list(provision_blender.DEBIAN)
    parser.addoption("--blender", choices=versions, default=provision_blender.DEFAULT, help="which Blender opens its window")
    parser.addoption("--minutes", type=float, default=0.0, help="how long the window is used at least, beyond five rounds")


@dataclass
class RealBlender:
    """Debian's Blender in its own small system, with a user folder that holds nothing but the extension."""

    root: Path
    work: Path
    rig: Path

    def run(self, command: list[str], log: Path, timeout: float, **environment: object) -> int:
        """Run a command inside, output into a log; return its status."""
        known = {"BLENDER_USER_RESOURCES": f"{WORK}/user", "LIBGL_ALWAYS_SOFTWARE": 1, **environment}
        folders = {self.work: WORK, Path(__file__).parent: HERE, self.rig: RIG}
        words = ["env", *(f"{key}={value}" for key, value in known.items()), *command]
        inside = provision_blender.inside(words, self.root, binds=folders)
        with log.open("w", encoding="utf-8") as out:
            return subprocess.run(
                inside, stdout=out, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, timeout=timeout
            ).returncode

    def install(self, zip_path: Path) -> None:
        """Install a zip by Blender's own command, as a user would, and enable it."""
        log = self.work / "install.log"
        shutil.copy(zip_path, self.work / "palpate.zip")
        install = ["extension", "install-file", "--repo", "user_default", "--enable", f"{WORK}/palpate.zip"]
        for command in (["--command", *install], ["--background", "--python-exit-code", "1", "--python-expr", PREFERENCES]):
            code = self.run(["blender", *command], log, timeout=LONGEST)
            text = log.read_text(encoding="utf-8", errors="replace")
            if code != 0 or "Traceback" in text:
                raise RuntimeError(f"Installing {zip_path.name} failed with status {code}:\n{text}")

    def give_brushes(self) -> None:
        """Debian's 4.3 leaves out Blender's brushes (assets); those that come with bpy are the same."""
        there = self.root / "usr/share/blender/datafiles/assets"
        if not (there / "brushes").is_dir():
            spec = importlib.util.find_spec("bpy")
            assets = next(Path(spec.submodule_search_locations[0]).glob("*/datafiles/assets"))
            shutil.copytree(assets, there, dirs_exist_ok=True)

    def play(self, roads: list[str], minutes: float = 0.0) -> dict[str, dict]:
        """Play roads in one window on a virtual screen; return their results by name, in which `faults` says what went wrong.

        A road is at fault if it broke off or a check did not hold, if Blender crashed, hung or printed a traceback meanwhile (a
        panel that cannot draw says so only there), or if a screenshot is empty.
        """
        log = self.work / f"{roads[0]}.log"
        script = f"""
            mkfifo /tmp/display
            Xvfb -displayfd 3 -screen 0 {SCREEN[0]}x{SCREEN[1]}x24 +extension GLX -nolisten tcp 3>/tmp/display &
            read -r number </tmp/display
            DISPLAY=:$number; export DISPLAY
            blender --enable-event-simulate -noaudio --window-geometry 0 0 {SCREEN[0]} {SCREEN[1]} \\
                --python-exit-code 1 --python {HERE}/driver.py -- {WORK} {" ".join(f"{HERE}/roads/{road}.py" for road in roads)}
            sleep 1
            ! grep -ls 'precompile_proces[s]' /proc/[0-9]*/cmdline  # nothing that Blender started outlives it
        """
        try:
            code: int | str = self.run(["sh", "-euc", script], log, LONGEST + 120 * minutes, PALPATE_MINUTES=minutes)
        except subprocess.TimeoutExpired:
            code = f"none, after {LONGEST:g} s"
        said = log.read_text(encoding="utf-8", errors="replace")
        results = {}
        for road in roads:
            file = self.work / road / "results.json"
            result = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {"error": "It was not played."}
            printed = said.partition(f"road {road}\n")[2].partition("\nroad ")[0]
            results[road] = result | {"faults": self._faults(road, result, printed, code if road == roads[-1] else 0)}
        return results

    def _faults(self, road: str, result: dict, printed: str, code: int | str) -> str:
        """Return what went wrong in a road, with its steps and the end of what Blender printed; empty where nothing did."""
        faults = [f"not so: {check['what']}" for check in result.get("checks", []) if not check["passed"]]
        if result["error"]:
            faults.append(result["error"])
        elif not result["finished"]:
            faults.append("the road did not reach its end")
        elif not result["checks"]:
            faults.append("the road checked nothing")
        if code != 0:
            faults.append(f"Blender's exit status: {code}")
        if "Traceback (most recent call last)" in printed:
            faults.append("Blender printed a traceback")
        faults += [
            f"the screenshot {name} is empty" for name in result.get("screenshots", []) if blank(self.work / road / name)
        ]
        steps, tail = "\n".join(result.get("steps", [])), "\n".join(printed.splitlines()[-40:])
        return "\n".join([*faults, "--- steps", steps, "--- printed", tail]) if faults else ""


def blank(picture: Path) -> bool:
    """Tell whether a screenshot shows next to nothing: a Blender window has hundreds of colours."""
    from PIL import Image

    with Image.open(picture) as image:
        small = image.convert("RGB").resize((200, 125), Image.Resampling.NEAREST)
        return len(small.getcolors(maxcolors=200 * 125)) < 50


@pytest.fixture(scope="session")
def real_blender(request, repository):
    """Return a real Blender with the zip of this very work tree installed. A second run in this repository waits for the first.

    The zip carries no machine code: the first road watches the compiler at work.
    """
    version = request.config.getoption("--blender")
    with provision_blender.locked(repository / "build" / "ui.lock"):
        made = {"blender_range": ("4.2.0", None), "suffix": "-local", "with_machine_code": False}
        python = provision_blender.DEBIAN[version].python
        zip_path = build_zip.build("linux-x64", python, repository / "build" / "ui-zip" / version, **made)
        work = repository / "build" / "ui" / version
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir(parents=True)
        blender = RealBlender(provision_blender.provision(version), work, repository / "docs" / "sample-rig")
        blender.give_brushes()
        blender.install(zip_path)
        yield blender


@pytest.fixture(scope="session")
def played(request, real_blender):
    """Return the results of all roads that the chosen tests ask for, by name."""
    params = [getattr(getattr(item, "callspec", None), "params", {}) for item in request.session.items]
    roads = list(dict.fromkeys(one["road"] for one in params if "road" in one))
    return real_blender.play(roads, request.config.getoption("--minutes"))
