# SPDX-License-Identifier: GPL-3.0-or-later
"""``import palpate as pp`` is quick, loads nothing heavy, and offers its names to people, editors and mypy."""

from __future__ import annotations

import ast
import json
import subprocess
import sys

import pytest

import palpate as pp

HEAVY = {"bpy", "numba", "llvmlite", "scipy", "matplotlib", "trimesh", "numpy", "tqdm", "xarray", "pandas"}

IMPORT = """
import json, sys, time
begin = time.perf_counter()
import palpate, palpate.core
print(json.dumps([time.perf_counter() - begin, sorted({name.partition(".")[0] for name in sys.modules})]))
"""


def subprocess_output(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_import_is_quick_and_loads_nothing_heavy():
    runs = [json.loads(subprocess_output(IMPORT)) for _ in range(5)]
    assert min(seconds for seconds, _ in runs) < 0.05
    assert not HEAVY & set(runs[0][1])


def test_no_command_loads_blender_before_it_runs():
    """In a Python without Blender every command has its help, and says what is missing when it needs Blender."""
    code = (
        "import importlib, pkgutil, sys, palpate.commands as commands\n"
        "names = [module.name for module in pkgutil.iter_modules(commands.__path__) if module.name != '__main__']\n"
        "for name in names:\n    importlib.import_module(f'palpate.commands.{name}')\n"
        "print(len(names), 'bpy' in sys.modules)"
    )
    count, has_blender = subprocess_output(code).split()
    assert int(count) >= 12
    assert has_blender == "False"


def test_both_lists_of_names_agree(repository):
    """One list is for mypy and editors, the other is what is imported."""
    tree = ast.parse((repository / "__init__.py").read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING")
    typed = {alias.asname: node.module for node in block.body for alias in node.names}
    assert typed == pp._PUBLIC
    assert set(pp.__all__) == {*typed, "__version__"}


def test_a_wrong_name_is_corrected():
    with pytest.raises(AttributeError, match="did you mean 'simulate'"):
        pp.simulat  # noqa: B018


def test_names_resolve_without_blender():
    """All names can be looked at, as an editor does, before anything is computed."""
    code = f"import sys, palpate\n[getattr(palpate, name) for name in {pp.__all__!r}]\nprint({HEAVY!r} & set(sys.modules))"
    assert not {"bpy", "matplotlib"} & eval(subprocess_output(code))
