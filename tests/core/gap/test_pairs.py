# SPDX-License-Identifier: GPL-3.0-or-later
"""Two hidden effects (benchmarks/_hidden) that are found only together, or where one seems to be something else at first."""

import pytest

from palpate.benchmarks._hidden import cases
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.gap.selection.rule_numbers import SURE
from palpate.core.jobs import run_job


def named(number, folder):
    """Sure names of a pair, the diagnosis, and all findings by name."""
    result = run_job(diagnose(read_rig(cases.write(cases.draw("two", number), folder))))
    sure = {one.name for one in result.findings if one.confidence >= SURE}
    return sure, result, {one.name: one for one in result.findings}


@pytest.mark.long("a whole diagnosis with net forces")
def test_a_saturation_that_explains_the_readings_does_not_explain_the_forces(tmp_path):
    """With a saturation of the readout the readings need no stiffening of the contact. It is left in the forces."""
    sure, result, _ = named(47017, tmp_path)
    assert sure == {"saturation"} < set(cases.answer_of("two", 47017)) and result.verdict == "unexplained"


@pytest.mark.long("a whole diagnosis of two hidden effects")
def test_two_effects_are_named_of_which_none_joins_alone(tmp_path):
    """Gains of texels alone fit what spreads as well, and fail on unseen stretches."""
    sure, _, _ = named(47001, tmp_path)
    assert sure == {"load-spreading", "gain-mismatch"} == set(cases.answer_of("two", 47001))


@pytest.mark.long("a whole diagnosis of two hidden effects")
def test_a_second_effect_is_dropped_if_a_third_does_its_work(tmp_path):
    """A reading that goes on rising does nearly as well as the lag that is there."""
    sure, _, found = named(605, tmp_path)
    assert sure <= set(cases.answer_of("two", 605)) == {"load-spreading", "lag"}
    assert "creep" not in found and found["lag"].next_best == "creep"


@pytest.mark.long("a whole diagnosis of two hidden effects")
def test_a_kind_that_leads_clearly_is_named_although_a_number_is_at_its_bound(tmp_path):
    sure, result, found = named(47004, tmp_path)
    assert sure == {"drift", "stribeck"} == set(cases.answer_of("two", 47004))
    assert result.closed.least(0) > 0.99 and result.closed.least(1) > 0.92
    assert found["stribeck"].unsettled == ("rise is at its bound of 4",)
