# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of the data are found with evidence, put right on request, and no healthy rig is accused."""

import ast
from pathlib import Path

import pytest

from palpate.benchmarks._faulty import faults as made
from palpate.benchmarks._faulty.sensors import FAMILIES
from palpate.benchmarks.data_faults import is_right
from palpate.core.errors import PalpateError
from palpate.core.gap.data_faults.search import find_faults, put_right
from palpate.core.gap.dataset.fault_kinds import FAULT_KINDS
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.forward.stimulus import stimulus_of

FOLDER = Path(made.__file__).parent


def stimuli_of(rig):
    return [stimulus_of(trial, rig) for trial in rig.trials]


def with_correction(path, words='"all"'):
    path.write_text(path.read_text().replace("[sensor]", f"[data]\ncorrect = {words}\n[sensor]", 1))
    return path


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_the_generator_shares_nothing_with_the_package(path):
    allowed = {"__future__", "collections", "dataclasses", "pathlib", "numpy", "scipy"}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert {name.name.split(".")[0] for name in node.names} <= allowed
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 1 or node.module.split(".")[0] in allowed


def test_every_kind_of_fault_is_made():
    assert set(made.KINDS) == set(FAULT_KINDS)


@pytest.mark.parametrize("kind", made.KINDS)
def test_a_fault_is_found_and_put_right(tmp_path, kind):
    case = made.draw("gel", kind, 0, tmp_path)
    rig = read_rig(case.path)
    found = find_faults(rig, stimuli_of(rig))
    assert is_right(case, [(fault.kind, fault.trials) for fault in found])
    assert found[0].sentence.endswith("puts it right.") and "\n" not in found[0].sentence
    rig = read_rig(with_correction(case.path))
    mended, faults = put_right(rig, stimuli_of(rig))
    assert [(fault.kind, fault.put_right) for fault in faults] == [(kind, True)]
    assert "this was put right" in faults[0].sentence
    assert not find_faults(mended, stimuli_of(mended))


@pytest.mark.parametrize("family", FAMILIES)
def test_a_healthy_rig_is_not_accused(tmp_path, family):
    for number in range(3):
        rig = read_rig(made.draw(family, "", number, tmp_path).path)
        assert not find_faults(rig, stimuli_of(rig))


def test_only_what_is_asked_for_is_put_right(tmp_path):
    rig = read_rig(with_correction(made.draw("gel", "stuck-logger", 0, tmp_path).path, '["sign", "unit"]'))
    assert rig.correct == ("sign", "unit")
    mended, faults = put_right(rig, stimuli_of(rig))
    assert mended is rig and [fault.put_right for fault in faults] == [False]


@pytest.mark.parametrize("words", ['"some"', "3", '["signs"]', "[1]"])
def test_unknown_corrections_are_refused(tmp_path, words):
    with pytest.raises(PalpateError, match="clock-shift"):
        read_rig(with_correction(made.draw("foam", "", 0, tmp_path).path, words))
