# SPDX-License-Identifier: GPL-3.0-or-later
"""Hidden effects under coloured noise, with cells missing, on a mesh, and of friction (benchmarks/conditions.py)."""

import numpy as np
import pytest

from palpate.benchmarks._hidden import cases, conditions
from palpate.core.gap.dataset.rig import grid_texels, read_rig


def same(first, second):
    """True if two cases have the same answer, readings and forces, empty cells included."""
    pairs = [*zip(first.readings, second.readings, strict=True), *zip(first.forces, second.forces, strict=True)]
    return first.answer == second.answer and all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


@pytest.mark.long("draws cases of the benchmark")
@pytest.mark.parametrize(("condition", "number"), [("missing", 10), ("mesh", 15), ("friction", 3), ("pairs", 3)])
def test_a_case_of_a_condition_is_drawn_the_same_twice_and_its_rig_is_read(tmp_path, condition, number):
    case = conditions.draw(condition, number)
    assert same(case, conditions.draw(condition, number)) and len(case.answer) == {"friction": 0, "pairs": 2}.get(condition, 1)
    path = conditions.write(condition, case, tmp_path)
    rig = read_rig(path)
    assert [trial.use for trial in rig.trials] == ["fit"] * 4 + ["check"] * 2 and not rig.warnings
    for trial, reading, force in zip(rig.trials, case.readings, case.forces, strict=True):
        assert np.isnan(reading).any() == (condition == "missing")
        np.testing.assert_allclose(trial.reading, reading, rtol=1e-6, atol=1e-6 * np.nanmax(np.abs(reading)))
        np.testing.assert_allclose(trial.force, force, rtol=1e-6, atol=1e-6 * np.abs(force).max())
    grid = grid_texels(cases.ROWS, cases.COLUMNS, cases.PITCH, cases.PITCH)
    assert (rig.grid is None) == (condition == "mesh")
    np.testing.assert_allclose(rig.texels.position, grid.position, rtol=0, atol=1e-15)
    np.testing.assert_allclose(rig.texels.normal, grid.normal, rtol=0, atol=1e-12)
    text = path.read_text(encoding="utf-8") + (tmp_path / "trial_0.csv").read_text(encoding="utf-8")
    assert not any(word in text for word in (*case.answer, "missing", "coloured", "nan"))


@pytest.mark.long("draws cases of the benchmark")
def test_stating_what_a_case_has_anyway_changes_no_bit():
    plain = cases.draw("none", 2)
    assert same(plain, cases.draw("none", 2, names=(), coloured=True))
    assert not same(plain, cases.draw("none", 2, coloured=False))


@pytest.mark.long("draws cases of the benchmark")
def test_coloured_noise_stays_from_sample_to_sample_in_readings_and_forces():
    """AR(1) with 0.9: neighbouring samples have this correlation, and the size is that of white noise."""
    case = conditions.draw("coloured", 6)
    assert same(case, conditions.draw("coloured", 6))
    for with_noise, clean in ((case.readings, 0), (case.forces, 1)):
        noise = np.concatenate([(a - b[clean]).T for a, b in zip(with_noise, case.clean, strict=True)])
        assert abs(np.corrcoef(noise[:, :-1].ravel(), noise[:, 1:].ravel())[0, 1] - 0.9) < 0.02
        assert clean or abs(np.std(noise) / case.noise - 1.0) < 0.05


@pytest.mark.parametrize("way", conditions.MISSING)
def test_the_share_of_cells_that_is_said_is_missing(way):
    readings = [np.zeros((1251, 84)) for _ in range(6)]
    empty = [np.isnan(part) for part in conditions._emptied(readings, way, np.random.default_rng(3))]
    if way != "stretch":
        assert abs(np.mean(empty) - float(way.split()[0]) / 100) < 2e-3 and not np.isnan(readings).any()
        return
    assert np.any(empty, axis=(0, 1)).sum() == 1
    low, high = conditions.STRETCH
    for one in empty:
        (at,) = np.nonzero(one.any(axis=1))
        assert low - 1e-3 < len(at) / len(one) < high + 1e-3 and np.ptp(at) == len(at) - 1


def test_friction_is_of_each_effect_and_formula_or_nothing(monkeypatch):
    plain = cases.draw("none", 0)
    asked = []
    monkeypatch.setattr(cases, "draw", lambda kind, number, names: asked.append((kind, *names)) or plain)
    drawn = [conditions.draw("friction", number) for number in range(8)]
    hidden = {(formula, name) for formula in conditions.FORMULAS for name in cases.IN_FORCE}
    assert len(asked) == 8 and {entry for entry in asked if len(entry) > 1} == hidden
    assert [case.kind for case in drawn[3::4]] == ["none", "none"]
