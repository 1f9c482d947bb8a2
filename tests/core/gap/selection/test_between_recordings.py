# SPDX-License-Identifier: GPL-3.0-or-later
"""What carries over from recording to recording is named as that, and never as a property of the texels."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.report.sentences import headline
from palpate.core.gap.report.summary import summary
from palpate.core.gap.selection import screening
from palpate.core.gap.selection.between_recordings import with_own_numbers
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs.job_runner import run_job


@pytest.fixture(autouse=True)
def quick_search(monkeypatch):
    """A search with few starting points."""
    monkeypatch.setattr(screening, "THOROUGH", replace(screening.QUICK, most_first_fits=6, kinds=2, forms=1))


def changing(change):
    """A rig whose recording number i is `change(force, i)`."""
    count = iter(range(5))
    return cases.rig(lambda force, time: change(force, next(count)), seed=1, trials=5, seconds=6.0)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (lambda force, i: force * (1.0 - 0.08 * i), "wear"),
        (lambda force, i: force * (1.0 + 0.08 * i), "drift"),
        (lambda force, i: force + 0.006 * (0.0, 1.0, -1.0, 2.0, 1.5)[i], "drift"),
    ],
)
def test_levels_and_gains_are_named_between_recordings(change, name):
    result = run_job(diagnose(changing(change)))
    assert result.between is not None and result.between.name == name and result.between.confidence > 0.9
    assert result.verdict == "explained" and not result.findings
    expected = change(1.0, 1) - change(0.0, 1)
    assert result.between.factors["t1"] == pytest.approx(expected, rel=0.02)
    errors = gap_errors(result)
    assert headline(result, errors).startswith(f"Missing: {name} between recordings")
    assert summary(result, errors)["between_recordings"]["effect"] == name


def test_gains_of_texels_are_still_named(monkeypatch):
    gains = 1.0 + 0.25 * np.sin(2.3 * np.arange(cases.ROWS * cases.COLUMNS))
    result = run_job(diagnose(changing(lambda force, i: force * gains)))
    assert result.between is None and [one.name for one in result.findings] == ["gain-mismatch"]


def test_what_a_rig_says_is_not_asked_again():
    rig = changing(lambda force, i: force)
    own = with_own_numbers(rig)
    assert own is not None and {(trial.factor, trial.zero) for trial in own.trials} == {(f"t{i}", f"t{i}") for i in range(5)}
    for words in ({"session": "s"}, {"factor": "A"}, {"zero": 0.1}):
        assert with_own_numbers(replace(rig, trials=(replace(rig.trials[0], **words), *rig.trials[1:]))) is None
    assert with_own_numbers(replace(rig, trials=(*rig.trials[:2], rig.trials[4]))) is None
