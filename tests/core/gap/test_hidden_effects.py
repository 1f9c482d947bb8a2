# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects that are named only together, or are equal in the recordings."""

from __future__ import annotations

from functools import partial

import gap_cases as cases
import numpy as np
import pytest

from palpate.benchmarks._hidden import cases as hidden
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.report import sentences
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.selection.rule_numbers import SURE


@pytest.mark.long("a whole diagnosis of two hidden effects")
def test_two_effects_are_named_of_which_none_joins_alone(tmp_path):
    """Gains of texels alone fit what spreads as well, and fail on unseen stretches."""
    result = cases.diagnosed(read_rig(hidden.write(hidden.draw("two", 47001), tmp_path)))
    sure = {one.name for one in result.findings if one.confidence >= SURE}
    assert sure == {"load-spreading", "gain-mismatch"} == set(hidden.answer_of("two", 47001))


def beneath_a_cover(force, _time, width):
    """The loads under a cover that spreads them by `width`, of which the texels see their part: those outside are not read."""
    margin, y, x = 6, *np.mgrid[0 : cases.ROWS, 0 : cases.COLUMNS]
    rows, columns = cases.ROWS + 2 * margin, cases.COLUMNS + 2 * margin
    wide_y, wide_x = np.mgrid[0:rows, 0:columns] - margin
    apart = np.hypot(wide_y.reshape(-1, 1) - y.ravel(), wide_x.reshape(-1, 1) - x.ravel()) * cases.PITCH
    weight = np.exp(-0.5 * (apart / width) ** 2)
    inside = (wide_y.ravel() >= 0) & (wide_y.ravel() < cases.ROWS) & (wide_x.ravel() >= 0) & (wide_x.ravel() < cases.COLUMNS)
    return force @ (weight / weight.sum(axis=0))[inside].T


@pytest.mark.long("a whole diagnosis of five recordings")
def test_a_narrow_cover_and_wires_side_by_side_are_not_told_apart():
    """Where the kernel hardly reaches beyond the next texels, leaking wires and another gain give the same readings."""
    result = cases.diagnosed(cases.rig(partial(beneath_a_cover, width=2e-3), seed=4))
    assert result.verdict == "unexplained" and set(result.ambiguous[0]) == {"load-spreading", "crosstalk"}
    assert sentences.headline(result, gap_errors(result)).startswith(
        "Indistinguishable in these recordings: load-spreading or crosstalk"
    )
    assert not any(one.confidence >= SURE for one in result.findings)


@pytest.mark.long("a whole diagnosis of five recordings")
def test_a_cover_is_named_where_wires_would_have_to_leak_half_of_each_signal():
    result = cases.diagnosed(cases.rig(partial(beneath_a_cover, width=3e-3), seed=4))
    assert result.verdict == "explained" and [one.name for one in result.findings] == ["load-spreading"]
    assert result.findings[0].confidence >= SURE
