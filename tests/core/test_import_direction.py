# SPDX-License-Identifier: GPL-3.0-or-later
"""Imports point one way, core ← addon ← operators ← panels, and enabling the add-on loads nothing heavy.

The rules are checked on the source, so that an import inside a function, or under TYPE_CHECKING, is seen too.
"""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Which rooms a room may import from; each may import from itself. The root package registers everything.
MAY_IMPORT = {
    "core": set(),
    "addon": {"core"},
    "operators": {"core", "addon"},
    "panels": {"core", "addon", "operators"},
    "commands": {"core", "addon", "paper", "sample_blends"},
    "paper": {"core", "addon", "sample_blends"},
    "sample_blends": {"core", "addon"},
    "": {"core", "addon", "operators", "panels", "commands", "paper", "sample_blends"},
}
BLENDER = {
    "bpy",
    "bpy_extras",
    "bmesh",
    "mathutils",
    "gpu",
    "gpu_extras",
    "blf",
    "bl_ui",
    "bl_operators",
    "idprop",
    "aud",
}
HEAVY = {"numba", "llvmlite", "scipy", "matplotlib", "trimesh", "OpenEXR", "tqdm", "tomli_w"}
# Loaded when the add-on is enabled; core is measured by the subprocess test below.
LIGHT_ROOMS = {"", "addon", "operators", "panels"}


@dataclass(frozen=True)
class Import:
    """What one import statement names: `module` is absolute, or counted from the repository root."""

    file: Path
    line: int
    module: str
    relative: bool
    at_module_level: bool

    @property
    def top(self) -> str:
        return self.module.partition(".")[0]

    def __str__(self) -> str:
        return f"{self.file.as_posix()}:{self.line} imports {self.module or 'the root package'}"


def room_of(file: Path) -> str:
    return file.parts[0] if len(file.parts) > 1 else ""


def imports_of(file: Path, source: str) -> list[Import]:
    """All imports of a file, whose path is relative to the repository root."""
    tree = ast.parse(source, filename=str(file))
    inside_functions = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for node in ast.walk(function)
    }
    found = []
    for node in ast.walk(tree):
        outside = id(node) not in inside_functions
        if isinstance(node, ast.Import):
            found += [Import(file, node.lineno, alias.name, False, outside) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.append(Import(file, node.lineno, node.module or "", False, outside))
        elif isinstance(node, ast.ImportFrom):
            # `..core.mesh` in addon/bridge.py: one dot is the file's folder, each further dot one folder up.
            folders = file.parent.parts
            if node.level - 1 > len(folders):
                found.append(Import(file, node.lineno, "<above the root package>", True, outside))
                continue
            base = [*folders[: len(folders) - (node.level - 1)], *(node.module or "").split(".")]
            base = [part for part in base if part]
            if base:
                found.append(Import(file, node.lineno, ".".join(base), True, outside))
            else:  # `from .. import core, addon`: each name may be a room
                found += [Import(file, node.lineno, alias.name, True, outside) for alias in node.names]
    return found


def faults_of(file: Path, source: str) -> list[str]:
    """Every breach of the rules in one file, in words."""
    room = room_of(file)
    allowed = MAY_IMPORT[room] | {room}
    faults = []
    for found in imports_of(file, source):
        if found.relative:
            if found.module.startswith("<"):
                faults.append(f"{found}: too many dots")
            elif found.top in MAY_IMPORT and found.top not in allowed:
                faults.append(f"{found}: {room} may import only {sorted(allowed)}")
        else:
            if found.top == "palpate" or found.top in MAY_IMPORT:
                faults.append(f"{found}: inside the package imports are relative")
            if room == "core" and found.top in BLENDER:
                faults.append(f"{found}: core never names Blender")
        if not found.relative and found.at_module_level:
            if room in LIGHT_ROOMS and found.top in HEAVY:
                faults.append(f"{found} at module level: import it in the function that uses it")
            if room in ("", "commands") and found.top in BLENDER:
                faults.append(f"{found} at module level: palpate.core and --help must load without Blender")
    return faults


def package_files() -> list[Path]:
    files = [ROOT / "__init__.py"]
    for room in MAY_IMPORT:
        if room:
            files += sorted((ROOT / room).rglob("*.py"))
    return [file.relative_to(ROOT) for file in files]


@pytest.mark.parametrize("file", package_files(), ids=lambda file: file.as_posix())
def test_file_keeps_the_direction(file):
    faults = faults_of(file, (ROOT / file).read_text(encoding="utf-8"))
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize(
    ("file", "source"),
    [
        ("core/a.py", "import bpy"),
        ("core/a.py", "def f():\n    import mathutils"),
        (
            "core/a.py",
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from bpy.types import Object",
        ),
        ("core/a.py", "from ..addon import bridge"),
        ("core/formats/exr.py", "from ... import panels"),
        ("core/formats/exr.py", "from .... import x"),
        ("core/a.py", "from palpate.core import mesh"),
        ("core/a.py", "import core.mesh"),
        ("addon/a.py", "from ..operators.bake import run"),
        ("addon/a.py", "import numba"),
        ("addon/a.py", "class A:\n    from scipy import optimize"),
        ("operators/a.py", "try:\n    import OpenEXR\nexcept ImportError:\n    OpenEXR = None"),
        ("operators/a.py", "from ..panels import sensor"),
        ("sample_blends/a.py", "from ..commands import demo"),
        ("commands/a.py", "from ..operators import bake"),
        ("__init__.py", "import bpy"),
        ("__init__.py", "import matplotlib.pyplot"),
    ],
)
def test_a_breach_is_seen(file, source):
    assert faults_of(Path(file), source)


@pytest.mark.parametrize(
    ("file", "source"),
    [
        ("core/a.py", "import numba\nfrom .mesh import Mesh\nfrom . import bvh"),
        ("core/formats/exr.py", "from ..errors import PalpateError"),
        ("addon/a.py", "import bpy\nfrom ..core import mesh\ndef f():\n    import numba"),
        ("panels/a.py", "from ..operators import bake\nfrom ..addon import identity"),
        ("commands/a.py", "def f():\n    import bpy\n    from ..addon import jobs"),
        ("__init__.py", "def register():\n    from . import addon, operators, panels"),
    ],
)
def test_a_fair_import_passes(file, source):
    assert not faults_of(Path(file), source)


def test_every_room_is_known():
    """A new package folder has to be given its place in the direction."""
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["packages"]
    rooms = {package.split(".")[1] for package in packages if "." in package}
    assert rooms == set(MAY_IMPORT) - {""}


def test_importing_core_loads_neither_blender_nor_numba():
    code = "import sys, palpate.core; print(*sorted({m.partition('.')[0] for m in sys.modules}))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(run.stdout.split())
    assert "palpate" in loaded
    assert not loaded & (BLENDER | HEAVY)
