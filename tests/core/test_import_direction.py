# SPDX-License-Identifier: GPL-3.0-or-later
"""Imports point one way: core ← api ← addon ← operators ← panels, and from room to room inside core and inside addon.

The order of the rooms stands in tools/import_graph.py, which reads the source, so that an import inside a function, or under
TYPE_CHECKING, is seen too. Enabling the add-on loads nothing heavy.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import pytest
from import_graph import MAY_IMPORT, ORDER, ROOT, Graph, breaches, circles, depth, imports_of, source_files

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
HEAVY = {"numba", "llvmlite", "scipy", "matplotlib", "trimesh", "OpenEXR", "tqdm", "tomli_w", "jinja2", "warp"}
# Loaded when the add-on is enabled; core is measured by the subprocess test below.
LIGHT_PACKAGES = {"", "addon", "operators", "panels"}


# Breaches of the order of rooms that are still in the source, by room and rule. The list may only become shorter.
# `python tools/import_graph.py` prints each breach with its file and line.
KNOWN: dict[tuple[str, str], int] = {}


def top_package_of(file: Path) -> str:
    return file.parts[0] if len(file.parts) > 1 else ""


def faults_of(file: Path, source: str) -> list[str]:
    """Every breach of the rules in one file, in words."""
    package = top_package_of(file)
    allowed = MAY_IMPORT[package] | {package}
    faults = []
    for found in imports_of(file, source):
        if found.relative:
            if found.module.startswith("<"):
                faults.append(f"{found}: too many dots")
            elif found.top in MAY_IMPORT and found.top not in allowed:
                faults.append(f"{found}: {package} may import only {sorted(allowed)}")
        else:
            if found.top == "palpate" or found.top in MAY_IMPORT:
                faults.append(f"{found}: inside the package imports are relative")
            if package == "core" and found.top in BLENDER:
                faults.append(f"{found}: core never names Blender")
        if not found.relative and found.at_module_level:
            if package in LIGHT_PACKAGES and found.top in HEAVY:
                faults.append(f"{found} at module level: import it in the function that uses it")
            if package in ("", "commands") and found.top in BLENDER:
                faults.append(f"{found} at module level: palpate.core and --help must load without Blender")
    return faults


@pytest.mark.parametrize("file", source_files(), ids=lambda file: file.as_posix())
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


def test_every_package_is_known():
    """A new top-level folder of the extension has to be given its place in the direction."""
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["packages"]
    top = {package.split(".")[1] for package in packages if "." in package}
    assert top == set(MAY_IMPORT) - {""}


def test_importing_core_loads_neither_blender_nor_numba():
    code = "import sys, palpate.core; print(*sorted({m.partition('.')[0] for m in sys.modules}))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(run.stdout.split())
    assert "palpate" in loaded
    assert not loaded & (BLENDER | HEAVY)


# --- rooms inside core and inside addon


@pytest.mark.slow("reads the whole source, for all tests of imports")
def test_rooms_keep_their_order(imports):
    """Each room imports only from rooms before it, only what they offer, and nothing goes in a circle."""
    found = breaches(imports)
    count = Counter((breach.room, breach.kind) for breach in found)
    grown = {key for key, number in count.items() if number > KNOWN.get(key, 0)}
    assert not grown, "\n".join(breach.text for breach in found if (breach.room, breach.kind) in grown)


def house(**files: str) -> Graph:
    """Return the graph of a small extension; `core__laws__contact` is the name of core/laws/contact.py."""
    sources = {Path(*name.split("__")).with_suffix(".py"): source for name, source in files.items()}
    for package in {parent for file in sources for parent in file.parents if parent.parts}:
        offered = {path.relative_to(package).parts[0].removesuffix(".py") for path in sources if package in path.parents}
        sources[package / "__init__.py"] = f'"""What this room is for."""\n\n__all__ = {sorted(offered)}\n'
    return Graph(sources)


@pytest.mark.parametrize(
    ("kind", "files"),
    [
        ("order", {"core__laws__contact": "from ..solver import substep", "core__solver__substep": ""}),
        ("order", {"core__laws__contact": "def f():\n    from ..solver.substep import g", "core__solver__substep": ""}),
        (
            "order",
            {
                "core__model__sensor": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ..io.files import File",
                "core__io__files": "",
            },
        ),
        ("order", {"core__gap__dataset__rig": "from ..report.page import write", "core__gap__report__page": ""}),
        ("order", {"addon__pantry__jam": ""}),
        ("circle", {"core__io__a": "from . import b", "core__io__b": "from .a import c"}),
        ("circle", {"core__io__a": "from .b import d", "core__io__b": "from . import c", "core__io__c": "from . import a"}),
        ("circle", {"core__io__x__a": "from ..b import d", "core__io__b": "from .x import c", "core__io__x__c": ""}),
        ("interface", {"core__io__a": "from ..laws.contact import _stiffness", "core__laws__contact": ""}),
        ("interface", {"operators__bake": "from ..addon.bake import files\nfiles._lock()", "addon__bake__files": ""}),
        ("depth", {f"core__io__m{i}": f"from . import m{i + 1}" if i < 8 else "" for i in range(9)}),
    ],
)
def test_a_breach_of_the_order_of_rooms_is_seen(kind, files):
    assert kind in {breach.kind for breach in breaches(house(**files))}


def test_modules_that_a_package_does_not_offer_are_its_own():
    graph = house(core__laws__contact="", core__io__files="from ..laws import contact")
    assert not breaches(graph)
    hidden = Graph({**graph.sources, Path("core/laws/__init__.py"): '"""What this room is for."""\n\n__all__ = []\n'})
    assert [breach.kind for breach in breaches(hidden)] == ["interface"]


@pytest.mark.parametrize(
    "source",
    [
        "__all__ = ['contact']",
        '"""Laws."""',
        '"""Laws."""\nfrom . import contact\n__all__ = ["contact"]',
        '"""Laws."""\n__all__ = ["x"]',
    ],
)
def test_a_package_says_what_it_is_for_and_loads_nothing(source):
    graph = house(core__laws__contact="")
    changed = Graph({**graph.sources, Path("core/laws/__init__.py"): source})
    assert [breach.kind for breach in breaches(changed)] == ["package"]


def test_depth_and_circles_of_a_graph():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set(), "e": {"d"}}
    assert circles(graph) == [["b", "c"]]
    assert depth(graph) == 4
    assert depth({}) == 0


def test_every_room_exists(imports):
    packages = {package: imports.children(package) for package in ORDER}
    assert not [f"{package}.{room}" for package, rooms in ORDER.items() for room in rooms if room not in packages[package]]


@pytest.mark.parametrize("package", ["core", "addon"])
def test_every_child_of_core_and_addon_has_a_place_in_the_order(imports, package):
    assert sorted(ORDER[package]) == sorted(imports.children(package))
