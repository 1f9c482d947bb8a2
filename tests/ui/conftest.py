# SPDX-License-Identifier: GPL-3.0-or-later
"""A real Blender with the extension installed, for roads played in its window (see README.md)."""

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
WORK, HERE = "/palpate-work", "/palpate-ui"


def pytest_addoption(parser):
    versions = list(provision_blender.DEBIAN)
    parser.addoption("--blender", choices=versions, default=provision_blender.DEFAULT, help="which Blender opens its window")
    parser.addoption("--long", action="store_true", help="measure three first images with machine code and three without")
    parser.addoption("--minutes", type=float, default=0.0, help="how long the window is used at least, beyond five rounds")


@dataclass
class RealBlender:
    """Debian's Blender in its own small system, with a user folder that holds nothing but the extension."""

    root: Path
    work: Path
    here: Path

    def run(self, command: list[str], log: Path, timeout: float) -> int:
        """Run a command inside, output into a log; return its status."""
        environment = ["env", f"BLENDER_USER_RESOURCES={WORK}/user", "LIBGL_ALWAYS_SOFTWARE=1"]
        folders = {self.work: WORK, self.here: HERE}
        inside = provision_blender.inside([*environment, *command], self.root, binds=folders)
        with log.open("w", encoding="utf-8") as out:
            return subprocess.run(
                inside, stdout=out, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, timeout=timeout
            ).returncode

    @classmethod
    def fresh(cls, root: Path, work: Path) -> RealBlender:
        """Return a Blender whose user folder is empty."""
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir(parents=True)
        blender = cls(root, work, Path(__file__).parent)
        blender.give_brushes()
        return blender

    def install(self, zip_path: Path, *, enable: bool = True) -> None:
        """Install a zip by Blender's own command, as a user would, and enable it."""
        log = self.work / "install.log"
        shutil.copy(zip_path, self.work / "palpate.zip")
        enabling = ["--enable"] if enable else []
        install = ["extension", "install-file", "--repo", "user_default", *enabling, f"{WORK}/palpate.zip"]
        # the splash screen would take the first click
        quiet = "import bpy; bpy.context.preferences.view.show_splash = False; bpy.ops.wm.save_userpref()"
        for command in (["--command", *install], ["--background", "--python-exit-code", "1", "--python-expr", quiet]):
            code = self.run(["blender", *command], log, timeout=180)
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

    def play(self, road: Path, out: Path, timeout: float) -> dict:
        """Play a road in a window on a virtual screen; return its results.

        Fails if the road broke off or a check did not hold, if Blender crashed, took too long or printed a
        traceback (a panel that cannot draw says so only there), or if a screenshot is empty.
        """
        out.mkdir(parents=True)
        log = out / "blender.log"
        inner = f"{WORK}/{out.relative_to(self.work)}"
        script = f"""
            mkfifo /tmp/display
            Xvfb -displayfd 3 -screen 0 {SCREEN[0]}x{SCREEN[1]}x24 +extension GLX -nolisten tcp 3>/tmp/display &
            read -r number </tmp/display
            DISPLAY=:$number; export DISPLAY
            blender --enable-event-simulate -noaudio --window-geometry 0 0 {SCREEN[0]} {SCREEN[1]} \\
                --python-exit-code 1 --python {HERE}/driver.py -- {HERE}/roads/{road.name} {inner}
            sleep 1
            ! grep -ls 'precompile_proces[s]' /proc/[0-9]*/cmdline  # nothing that Blender started outlives it
        """
        try:
            code: int | str = self.run(["sh", "-euc", script], log, timeout)
        except subprocess.TimeoutExpired:
            code = f"none, after {timeout:g} s"
        said = log.read_text(encoding="utf-8", errors="replace")
        results = out / "results.json"
        result = json.loads(results.read_text(encoding="utf-8")) if results.is_file() else {"error": "no results"}

        faults = [f"not so: {check['what']}" for check in result.get("checks", []) if not check["passed"]]
        if result["error"]:
            faults.append(result["error"])
        elif not result["finished"]:
            faults.append("the road did not reach its end")
        elif not result["checks"]:
            faults.append("the road checked nothing")
        if code != 0:
            faults.append(f"Blender's exit status: {code}")
        if "Traceback (most recent call last)" in said:
            faults.append("Blender printed a traceback")
        for name in result.get("screenshots", []):
            if blank(out / name):
                faults.append(f"the screenshot {name} is empty")
        if faults:
            steps = "\n".join(result.get("steps", []))
            tail = "\n".join(said.splitlines()[-40:])
            text = "\n".join(faults)
            pytest.fail(f"{road.name}:\n{text}\n--- steps\n{steps}\n--- {log}\n{tail}", pytrace=False)
        return result


def blank(picture: Path) -> bool:
    """Tell whether a screenshot shows next to nothing: a Blender window has hundreds of colours."""
    from PIL import Image

    with Image.open(picture) as image:
        small = image.convert("RGB").resize((200, 125), Image.Resampling.NEAREST)
        return len(small.getcolors(maxcolors=200 * 125)) < 50


@pytest.fixture(scope="session")
def blender_version(request):
    """Return which Blender opens its window, as in "4.3"."""
    return request.config.getoption("--blender")


@pytest.fixture(scope="session")
def one_at_a_time(repository):
    """Hold the lock of this repository's Blenders: a second run waits for the first."""
    with provision_blender.locked(repository / "build" / "ui.lock"):
        yield


@pytest.fixture(scope="session")
def build_local_zip(blender_version):
    """Return a function that builds the zip of this very work tree for the Blender, into a folder."""

    def build(out: Path, with_machine_code: bool) -> Path:
        python = provision_blender.DEBIAN[blender_version].python
        made = {"blender_range": ("4.2.0", None), "suffix": "-local", "with_machine_code": with_machine_code}
        return build_zip.build("linux-x64", python, out, **made)

    return build


@pytest.fixture(scope="session")
def local_zip(repository, blender_version, build_local_zip, one_at_a_time):
    """Return the zip that roads install, without machine code: some of them watch the compiler at work."""
    return build_local_zip(repository / "build" / "ui-zip" / blender_version, with_machine_code=False)


@pytest.fixture(scope="session")
def real_blender(repository, blender_version, local_zip):
    """Return a real Blender with the extension installed, the same for all roads: the first of them compiles the solver."""
    root = provision_blender.provision(blender_version)
    blender = RealBlender.fresh(root, repository / "build" / "ui" / blender_version)
    blender.install(local_zip)
    return blender


@pytest.fixture
def unseen_blender(blender_version, repository, one_at_a_time):
    """Return a function that makes a Blender whose profile has never seen Palpate, in a folder of a name."""

    def make(name: str) -> RealBlender:
        work = repository / "build" / "ui-unseen" / blender_version / name
        return RealBlender.fresh(provision_blender.provision(blender_version), work)

    return make


@pytest.fixture
def play_in(repository, blender_version):
    """Return a function that plays a road by name in a Blender and copies its pictures to build/ui-screenshots."""

    def play(blender: RealBlender, name: str, timeout: float) -> dict:
        out = blender.work / name
        try:
            return blender.play(Path(__file__).parent / "roads" / f"{name}.py", out, timeout)
        finally:
            shots = repository / "build" / "ui-screenshots" / blender_version
            shots.mkdir(parents=True, exist_ok=True)
            for picture in out.glob("*.png"):
                shutil.copy(picture, shots / f"{name}-{picture.name}")

    return play


@pytest.fixture
def play_road(real_blender, play_in):
    """Return a function that plays a road by name in the Blender that all roads share, and returns its results."""

    def play(name: str, timeout: float = 300.0) -> dict:
        return play_in(real_blender, name, timeout)

    return play


@pytest.fixture
def play_unseen(unseen_blender, local_zip, play_in):
    """Return a function that plays a road by name in a Blender of its own that has never compiled the solver."""

    def play(name: str, timeout: float = 300.0) -> dict:
        blender = unseen_blender(name)
        blender.install(local_zip)
        return play_in(blender, name, timeout)

    return play
