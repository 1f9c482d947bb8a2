# SPDX-License-Identifier: GPL-3.0-or-later
"""An effect is one file: nothing outside the library names one."""

import ast
from collections.abc import Iterator
from pathlib import Path

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
    "core/gap/candidates/candidates.py": ({"temperature"}, "what recordings must hold"),
    "core/gap/candidates/plausibility.py": ({"offset"}, "the parameter that the signature of an offset is about"),
    "core/simulators/formats/urdf.py": ({"offset"}, "an attribute of arrays in a URDF"),
}
"""Files outside the library that may name effects, which, and why. Tests may: they are examples."""


def named(source: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the name of each literal in a source that is an effect's name, or begins with one and a form."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.split("/")[0] in library():
            yield node.lineno, node.value.split("/")[0]


def test_no_file_outside_the_library_names_an_effect():
    """What others need to know of an effect is stated in its KIND."""
    unlisted = []
    for path in sorted(path for folder in SOURCES for path in (ROOT / folder).rglob("*.py")):
        file = path.relative_to(ROOT).as_posix()
        allowed, _ = ALLOWED.get(file, ((), ""))
        if not file.startswith(LIBRARY):
            lines = named(path.read_text(encoding="utf-8"))
            unlisted += [f"{file}:{line} names '{name}'" for line, name in lines if name not in allowed]
    assert not unlisted, "\n".join(unlisted)
