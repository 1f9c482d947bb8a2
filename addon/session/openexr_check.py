# SPDX-License-Identifier: GPL-3.0-or-later
"""Can the OpenEXR library be loaded beside this Blender's own copy of it? Tried once per version, in a child process.

Where the two copies disturb each other, the first image written ends in a segmentation fault. The child process is the same
Blender, so that it crashes in the place of the user's. Its result is kept in a file, and asked for again only when the version
of Blender, Python or OpenEXR changes.
"""

from __future__ import annotations

import importlib.metadata
import json
import platform
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.errors import FileError
from ...core.io import exr_backend
from ...core.io.file_writing import atomic_write
from . import dependencies, openexr_trial

TIME_LIMIT = 120.0
"""Seconds after which the child process counts as failed; it usually takes one or two."""
FILE_NAME = "openexr.json"


@dataclass(frozen=True)
class Check:
    """The check of one Blender. Nothing of Blender is touched when it runs, so any thread may call it.

    Attributes
    ----------
    command : sequence of str
        Runs a script, whose path and arguments follow, in the same Blender.
    versions : str
        Of Blender, Python and OpenEXR, and where Blender is.
    memory : Path
        File that keeps results by `versions`.
    """

    command: tuple[str, ...]
    versions: str
    memory: Path

    def __call__(self) -> bool:
        """Return the remembered result, or try and remember. Without any answer from the child process nothing is kept."""
        known = self._known()
        if self.versions in known:
            return bool(known[self.versions])
        try:
            passed = run(self.command)
        except (OSError, subprocess.TimeoutExpired):
            return False
        with suppress(FileError), atomic_write(self.memory) as temporary:
            temporary.write_text(json.dumps({**known, self.versions: passed}, indent=2) + "\n", encoding="utf-8")
        return passed

    def _known(self) -> dict:
        try:
            known = json.loads(self.memory.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return known if isinstance(known, dict) else {}


def run(command: Sequence[str]) -> bool:
    """Try the library in a child process and return whether everything there went well.

    Raises
    ------
    OSError, subprocess.TimeoutExpired
        The child process could not be started, or did not end.
    """
    with tempfile.TemporaryDirectory(prefix="palpate-openexr-") as folder:
        child = subprocess.run(
            [*command, openexr_trial.__file__, "--", json.dumps(_module_folders()), folder],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=TIME_LIMIT,
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
    return child.returncode == 0 and openexr_trial.PASSED.encode() in child.stdout


def _module_folders() -> list[str]:
    """Return the folders that modules are found in, apart from Blender's own scripts, which any Blender adds by itself."""
    return [path for path in sys.path if not Path(path).as_posix().endswith(("/scripts/modules", "/scripts/startup"))]


def register() -> None:
    """Install the check; it runs when the first tactile image is written or read."""
    exr_backend.set_safety_check(Check(_command(), _versions(), _folder() / FILE_NAME))


def unregister() -> None:
    """Remove the check."""
    exr_backend.set_safety_check(None)


def _command() -> tuple[str, ...]:
    if bpy.app.binary_path:  # empty where bpy is a module; `bpy.app.module` is missing in Blender 4.3
        return (bpy.app.binary_path, "--background", "--factory-startup", "--python-exit-code", "1", "--python")
    return (sys.executable, "-s")


def _versions() -> str:
    try:
        library = importlib.metadata.version(exr_backend.LIBRARY)
    except importlib.metadata.PackageNotFoundError:
        library = "?"
    build = bpy.app.build_hash.decode(errors="replace")
    where = bpy.app.binary_path or sys.executable
    return f"Blender {bpy.app.version_string} {build} in {where}, Python {platform.python_version()}, OpenEXR {library}"


def _folder() -> Path:
    package = dependencies.root_package()
    if package.startswith("bl_ext."):
        return Path(bpy.utils.extension_path_user(package, create=True))
    return Path(bpy.utils.user_resource("DATAFILES", path="palpate", create=True))
