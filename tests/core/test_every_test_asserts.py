# SPDX-License-Identifier: GPL-3.0-or-later
"""Each test can fail by itself: it asserts, expects an error, or calls a helper whose name begins with `assert`."""

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parents[1]


def asserts(function: ast.FunctionDef) -> bool:
    called = [ast.unparse(node.func).split(".")[-1] for node in ast.walk(function) if isinstance(node, ast.Call)]
    return any(isinstance(node, ast.Assert) for node in ast.walk(function)) or any(
        name.startswith("assert") or name in ("raises", "warns", "fail") for name in called
    )


@pytest.mark.slow("reads all tests")
def test_every_test_asserts():
    found = []
    for file in sorted(TESTS.rglob("test_*.py")):
        functions = [
            node for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(node, ast.FunctionDef)
        ]
        names = [f.name for f in functions if f.name.startswith("test_") and not asserts(f)]
        found += [f"{file.relative_to(TESTS).as_posix()}: {name}" for name in names]
    assert not found


def test_a_test_without_an_assertion_is_seen():
    function = ast.parse("def test_nothing():\n    run(1)").body[0]
    assert not asserts(function)
