# SPDX-License-Identifier: GPL-3.0-or-later
"""``import palpate as pp`` is quick, loads nothing heavy, and offers its names to people, editors and mypy."""

from __future__ import annotations

import ast
import json
import os
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

SCRIPT = """
import numpy as np
import palpate as pp

pad = pp.Sensor.grid(rows=14, columns=6, pitch=4e-3, k=1000.0, mus=0.435)
cube = pp.Body.box(0.05, mass=1.0, position=(0, 0, 0.0255))
ball: pp.Body = pp.Body.sphere(0.01, path_of_motion=np.zeros((5, 3)), name="ball")
recording = pp.simulate([pad], [cube, ball], duration=2.0, fps=60, progress=True)
total: np.ndarray = recording["pad"].normal_force.sum(axis=1)
recording.plot().savefig("a.png")
gap = pp.find_gap(pp.read_rig("rig.toml"))
names: list[str] = [effect.name for effect in gap.effects]
pp.export_sensor(gap.sensor, "mjcf", "out").files[0].exists()
try:
    pp.plan_experiment("rig.toml", limits={"depth": 1e-3}).report("out")
except pp.PalpateError as error:
    print(error)
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


@pytest.mark.long("runs mypy on the whole package, as make lint does")
def test_mypy_passes_on_a_script_of_a_user(repository, tmp_path):
    """The types are shipped: a right script passes, and a wrong argument is found."""
    (tmp_path / "palpate").symlink_to(repository, target_is_directory=True)
    (tmp_path / "right.py").write_text(SCRIPT, encoding="utf-8")
    (tmp_path / "wrong.py").write_text("import palpate as pp\npp.Body.box(0.05, mas=1.0)\n", encoding="utf-8")
    places = {**os.environ, "MYPYPATH": str(tmp_path)}

    def mypy(script: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "mypy", "--config-file", str(repository / "pyproject.toml"), "--follow-imports=silent"]
        command += ["--cache-dir", str(repository / ".mypy_cache"), script]
        return subprocess.run(command, cwd=tmp_path, env=places, capture_output=True, text=True, check=False)

    right, wrong = mypy("right.py"), mypy("wrong.py")
    assert right.returncode == 0, right.stdout
    assert 'Unexpected keyword argument "mas"' in wrong.stdout
