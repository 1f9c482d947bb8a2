# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings that carry a part of the channel before, and a cover that is wider than the array, are named as what they are."""

from functools import partial

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.report import sentences
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.gap.selection.rule_numbers import SURE
from palpate.core.jobs import run_job


def scanned(force, time):
    """A converter that has not settled keeps 12 % of the channel before; a row begins after the end of the row before."""
    kept = np.zeros_like(force)
    kept[:, 1:] = 0.12 * force[:, :-1]
    return force + kept


def beneath_a_wide_cover(force, time, width=6e-3):
    """The loads under a cover, kernels of 6 mm, of which the texels see their part: texels outside are there and not read."""
    margin, y, x = 6, *np.mgrid[0 : cases.ROWS, 0 : cases.COLUMNS]
    rows, columns = cases.ROWS + 2 * margin, cases.COLUMNS + 2 * margin
    wide_y, wide_x = np.mgrid[0:rows, 0:columns] - margin
    apart = np.hypot(wide_y.reshape(-1, 1) - y.ravel(), wide_x.reshape(-1, 1) - x.ravel()) * cases.PITCH
    weight = np.exp(-0.5 * (apart / width) ** 2)
    inside = (wide_y.ravel() >= 0) & (wide_y.ravel() < cases.ROWS) & (wide_x.ravel() >= 0) & (wide_x.ravel() < cases.COLUMNS)
    return force @ (weight / weight.sum(axis=0))[inside].T


@pytest.mark.long("a whole diagnosis of five recordings")
@pytest.mark.parametrize(
    ("change", "name", "form"),
    [(scanned, "crosstalk", "previous"), (beneath_a_wide_cover, "load-spreading", "open")],
)
def test_what_goes_from_texel_to_texel_is_named(change, name, form):
    result = run_job(diagnose(cases.rig(change, seed=4)))
    assert [(one.name, one.form) for one in result.findings if one.confidence >= SURE] == [(name, form)]
    assert result.verdict == "explained" and not result.ambiguous
    parameters = result.best.model.parameters
    assert parameters.k == pytest.approx(80.0, rel=0.05)
    found = result.best.model.effects[0].values
    assert found["share" if name == "crosstalk" else "width"] == pytest.approx(0.12 if name == "crosstalk" else 6e-3, rel=0.05)


@pytest.mark.long("a whole diagnosis of five recordings")
def test_a_narrow_cover_and_wires_side_by_side_are_not_told_apart():
    """Where the kernel hardly reaches beyond the next texels, leaking wires and another gain give the same readings."""
    result = run_job(diagnose(cases.rig(partial(beneath_a_wide_cover, width=3e-3), seed=4)))
    assert result.verdict == "unexplained" and set(result.ambiguous[0]) == {"load-spreading", "crosstalk"}
    assert sentences.headline(result, gap_errors(result)).startswith(
        "Indistinguishable in these recordings: load-spreading or crosstalk"
    )
    assert not any(one.confidence >= SURE for one in result.findings)
