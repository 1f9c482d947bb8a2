# SPDX-License-Identifier: GPL-3.0-or-later
"""An effect is one file: nothing outside the library names one, and a copy of the package with a new file passes its tests."""

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from palpate.core.effects.engine.registry import library

ROOT = Path(__file__).resolve().parents[3]
SOURCES = ("addon", "commands", "core", "examples", "operators", "paper", "panels", "sample_blends", "sweep", "tools")
LIBRARY = "core/effects/library/"

COLUMN = "a column of recordings"
ALLOWED = {
    # words that are names of effects and of something else
    "commands/fit.py": ({"offset"}, "the constant of a straight line, as the title of a column"),
    "core/effects/engine/specification.py": ({"temperature"}, "what recordings must hold"),
    "core/gap/dataset/column_names.py": ({"temperature"}, COLUMN),
    "core/gap/dataset/rig.py": ({"temperature"}, COLUMN),
    "core/gap/logs/column_meaning.py": ({"temperature"}, COLUMN),
    "core/gap/logs/proposal.py": ({"temperature"}, COLUMN),
    "core/gap/selection/candidates.py": ({"temperature"}, "what recordings must hold"),
    "core/gap/selection/plausibility.py": ({"offset"}, "the parameter that the signature of an offset is about"),
    "core/simulators/formats/urdf.py": ({"offset"}, "an attribute of arrays in a URDF"),
}
"""Files outside the library that may name effects, which (all, if none is listed), and why. Tests may: they are examples."""

MODULE = '''# SPDX-License-Identifier: GPL-3.0-or-later
"""The reading is a power of the force."""

from __future__ import annotations

import numpy as np

from ...model.parameter import Parameter
from ...model.sensor import Values
from ..engine.specification import Drawing, Form, Kind, TransducerArray, scalar


def power(signal: np.ndarray, time: np.ndarray, values: Values, transducers: TransducerArray, seed: int) -> np.ndarray:
    """``F (f/F)^p``."""
    force = scalar(values, "force")
    return np.sign(signal) * force * (np.abs(signal) / force) ** scalar(values, "exponent")


KIND = Kind(
    name="power-law",
    title="Power Law",
    text="Reads a power of the force.",
    site="readout",
    order=37,
    forms=(
        Form(
            "power",
            "r = F (f/F)^p",
            "Flórez and Velásquez, IEEE ANDESCON (2010): force-sensing resistors",
            (
                Parameter("exponent", "1", 0.7, 0.2, 1.0, "Exponent p."),
                Parameter("force", "N", 1.0, 1e-6, 1e6, "Force F that is read as it is.", log=True),
            ),
            neutral={"exponent": 1.0},
            memoryless=power,
        ),
    ),
    experiment="press slowly, from the first touch to the highest load",
    drawing=Drawing("force", values={"power": {"exponent": 0.5}}),
    families=("nonlinear",),
)
'''
COPIED = ("__init__.py", "benchmarks", "commands", "core", "pyproject.toml", "tests", "tools", "docs/effects.md")
TESTS = {
    "tests/core/effects/engine/test_registry.py": "",
    "tests/core/effects/library/test_library.py": "power-law",
    "tests/core/gap/fitting/test_identifiability.py": "pace or nonlinear or unloading",
    "tests/core/gap/test_hidden_cases.py": "every_effect or own_forms",
    "tests/tools/test_effects_page.py": "this_library or every_experiment",
    "tests/core/effects/test_one_file.py": "names_an_effect",
}
"""Tests that look at the effects, and which of them: those of other effects pass as they do without the new file."""
USES = """
from types import SimpleNamespace
import gap_cases as cases
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.report.sentences import next_experiment
from palpate.core.gap.selection.candidates import candidates
from palpate.core.gap.fitting.identifiability import NONLINEAR

rig = cases.rig(trials=1, seconds=2.0)
assert "power-law" in {one.name for one in candidates(predictors_of(rig.trials, rig), Model(rig.parameters))}
assert "power-law" in NONLINEAR
asked = next_experiment(SimpleNamespace(ambiguous=[("power-law", "saturation")]))
assert "press slowly, from the first touch to the highest load" in asked, asked
"""


def named(source: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the name of each literal in a source that is an effect's name, or begins with one and a form."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.split("/")[0] in library():
            yield node.lineno, node.value.split("/")[0]


def test_no_file_outside_the_library_names_an_effect():
    """What others need to know of an effect is stated in its KIND."""
    unlisted, found = [], dict.fromkeys(ALLOWED, False)
    for path in sorted(path for folder in SOURCES for path in (ROOT / folder).rglob("*.py")):
        file = path.relative_to(ROOT).as_posix()
        allowed, _ = ALLOWED.get(file, (None, ""))
        for line, name in () if file.startswith(LIBRARY) else named(path.read_text(encoding="utf-8")):
            found[file] = True
            if allowed is None or allowed and name not in allowed:
                unlisted.append(f"{file}:{line} names '{name}'")
    assert not unlisted, "\n".join(unlisted)
    unused = [file for file, is_found in found.items() if not is_found and (ROOT / file).exists()]
    assert not unused, f"take from the list: {', '.join(unused)}"


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ('if effect.name == "creep": pass', ["creep"]),
        ('COSTS = {"dead-zone": 0.4, "price": 1}', ["dead-zone"]),
        ('x = f"drift/{form}" + "offset/common"', ["drift", "offset"]),
        ('"""About creep and lag."""\nx = "creeping"  # "creep"', []),
    ],
)
def test_a_name_is_seen(source, names):
    assert sorted(name for _, name in named(source)) == names


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """The package in another place, with one effect more and its page rewritten, and the environment to run it in."""
    folder = tmp_path_factory.mktemp("one_file") / "palpate"
    for name in COPIED:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "build"))
        else:
            shutil.copy(ROOT / name, folder / name)
    (folder / "docs" / "images").mkdir()
    (folder / LIBRARY / "power_law.py").write_text(MODULE, encoding="utf-8")
    paths = os.pathsep.join(map(str, (folder.parent, folder / "tests", folder / "tools")))
    environment = {**os.environ, "PYTHONPATH": paths, "PALPATE_NUMBA": "0"}
    environment.pop("PYTEST_ADDOPTS", None)

    def run(*command):
        done = subprocess.run(
            [sys.executable, *command], cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
        return done.stdout

    return folder, run


@pytest.mark.long("runs the tests of effects in a copy of the package")
def test_a_new_file_is_all_that_a_new_effect_needs(copy):
    """The commands of docs/architecture.md, "How to add an effect"."""
    folder, run = copy
    run("tools/effects_page.py")
    assert "`power-law` · readout. Reads a power of the force." in (folder / "docs" / "effects.md").read_text(encoding="utf-8")
    run("-c", USES)
    words = [f"({Path(file).stem} and ({which}))" if which else Path(file).stem for file, which in TESTS.items()]
    said = run("-m", "pytest", "-v", "-x", "-p", "no:cacheprovider", *TESTS, "-k", " or ".join(words))
    assert "::test_a_form_says_what_it_is[power-law-power] PASSED" in said
    assert all(f"{Path(file).name}::" in said for file in TESTS)
