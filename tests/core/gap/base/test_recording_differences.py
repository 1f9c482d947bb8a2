# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings that differ by a gain and a level, or that go on from each other: assumptions that compete like any effect."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.base.recording_differences import as_one_session, may_differ, with_own_numbers
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.report.sentences import headline
from palpate.core.gap.report.summary import summary
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.gap.selection.rule_numbers import SURE
from palpate.core.jobs import run_job


def changing(change):
    """A rig whose recording number i is `change(force, i)`."""
    count = iter(range(5))
    return cases.rig(lambda force, time: change(force, next(count)), seed=1, trials=5, seconds=6.0)


@pytest.mark.long("a whole diagnosis of five recordings")
def test_gains_of_recordings_are_no_effect_of_the_sensor():
    """As an amplifier's range is changed between recordings; a level is that of test_report.py."""
    gains = (1.0, 0.7, 1.2, 0.9, 1.1)
    result = run_job(diagnose(changing(lambda force, i: force * gains[i])))
    assert result.between is not None and result.between.confidence > 0.9
    assert result.verdict == "explained" and not result.findings
    assert result.between.factors["t1"] / result.between.factors["t0"] == pytest.approx(0.7, rel=0.02)
    errors = gap_errors(result)
    assert headline(result, errors).startswith("Recordings differ by a gain and a level of their own")
    assert summary(result, errors)["between_recordings"]["confidence"] == result.between.confidence


@pytest.mark.long("a whole diagnosis of five recordings")
def test_wear_without_a_session_is_found_as_one_session_in_the_order_of_the_rig():
    put_on = [np.zeros(cases.ROWS * cases.COLUMNS)]

    def worn(force, i):
        gathered = put_on[-1] + np.cumsum(np.maximum(np.diff(force, axis=0, prepend=0.0), 0.0), axis=0)
        put_on.append(gathered[-1])
        return force / (1.0 + 0.6 * gathered)

    result = run_job(diagnose(changing(worn)))
    assert result.assumed_session and result.between is None and result.verdict == "explained"
    assert result.findings[0].name == "wear" and result.findings[0].confidence >= SURE
    errors = gap_errors(result)
    assert headline(result, errors).startswith("Between recordings, taken as one session in their order: Missing: wear")
    assert summary(result, errors)["between_recordings"]["effect"] == "wear"


def test_what_a_rig_says_is_not_asked_again():
    rig = changing(lambda force, i: force)
    names = {f"t{i}" for i in range(5)}
    assert may_differ(rig)
    assert {(trial.factor, trial.zero) for trial in with_own_numbers(rig).trials} == {(name, name) for name in names}
    for words in ({"session": "s"}, {"factor": "A"}, {"zero": 0.1}):
        assert not may_differ(replace(rig, trials=(replace(rig.trials[0], **words), *rig.trials[1:])))
    assert not may_differ(replace(rig, trials=(*rig.trials[:2], rig.trials[4])))


def test_one_session_keeps_the_order_of_the_rig_and_temperatures_at_their_samples():
    rig = changing(lambda force, i: force)
    rig = replace(rig, trials=tuple(replace(one, temperature=(one.time, one.time + 20.0)) for one in rig.trials))
    session = as_one_session(rig)
    assert session is not None and len({trial.session for trial in session.trials}) == 1
    ends = [float(trial.time[-1]) for trial in session.trials]
    assert all(trial.time[0] > end for trial, end in zip(session.trials[1:], ends[:-1], strict=True))
    assert [trial.name for trial in session.trials] == [trial.name for trial in rig.trials]
    assert all(np.array_equal(trial.temperature[0], trial.time) for trial in session.trials)
