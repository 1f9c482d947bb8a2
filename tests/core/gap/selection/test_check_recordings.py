# SPDX-License-Identifier: GPL-3.0-or-later
"""Check recordings are never fitted: one that is predicted worse than by the base model refutes the amended one."""

import json
from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import effect
from palpate.core.gap.candidates.candidates import parameters_at_bounds
from palpate.core.gap.fitting.least_squares import FreeParameter
from palpate.core.gap.forward.predictor import Model
from palpate.core.gap.report import sentences, summary
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.selection.check_recordings import CheckedRecording, CheckOutcome
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job
from palpate.core.model.sensor_parameters import SensorParameters


def diagnosed(rig):
    return run_job(diagnose(rig))


def recording(before, after, name="t", rise=0.3):
    """A check recording of readings alone with these mean squares."""
    one = np.array([before, 0.0]), np.array([after, 0.0]), np.array([100.0, 0.0]), np.array([rise, 0.0])
    return CheckedRecording(name, *one, fitted=np.array([5.0, 0.0]))


def with_check(rig, factor=1.0, level=0.0):
    """A rig whose check recording reads so many times as much, and a level more."""
    changed = [t if t.use == "fit" else replace(t, reading=factor * t.reading + level) for t in rig.trials]
    return replace(rig, trials=tuple(changed))


@pytest.mark.parametrize(("recordings", "refuted"), [
    ([recording(10, 4)], False),
    ([recording(10, 2), recording(2, 2.5)], True),  # one of them is worse by more than its noise
    ([recording(10, 2), recording(2, 2.2)], False),
    ([recording(10, 6)], True),  # the fitted ones have 5
    ([], False),
])  # fmt: skip
def test_no_recording_may_become_worse(recordings, refuted):
    outcome = CheckOutcome(tuple(recordings))
    assert outcome.is_refuted is refuted
    assert (outcome.worst is None) is not refuted


def test_the_recording_that_speaks_most_clearly_is_named():
    outcome = CheckOutcome((recording(10, 2, "a"), recording(2, 3, "b"), recording(2, 5, "c")))
    assert outcome.worst is not None and outcome.worst.name == "c"


@pytest.mark.long("a whole diagnosis")
def test_a_check_that_fails_is_said_with_what_differs():
    result = diagnosed(with_check(cases.rig(contact=cases.relaxing(), seed=7, trials=4, seconds=9.0), 0.6))
    assert result.verdict == "unexplained" and result.check.is_refuted
    errors = gap_errors(result)
    said = sentences.headline(result, errors)
    assert said.startswith("Unexplained") and "'t3'" in said and "40% less" in said
    assert sentences.caution(result) in sentences.warnings(result)
    found = json.loads(json.dumps(summary.summary(result, errors), allow_nan=False))
    assert found["check"][0]["trial"] == "t3" and any("40% less" in text for text in found["check"][0]["differs"])


@pytest.mark.slow("a whole diagnosis of which the check differs")
def test_noise_in_the_fitted_recordings_is_a_gap_where_the_check_is_none():
    result = diagnosed(with_check(cases.rig(seed=6, trials=4, seconds=6.0), level=0.02))
    said = sentences.headline(result, gap_errors(result))
    assert result.verdict == "unexplained" and not result.findings and "'t3'" in said and "without load it reads" in said


@pytest.mark.parametrize(
    ("kind", "form", "values", "low", "high", "at_bound"),
    [
        ("creep", "power", {"amount": 0.95}, 0.0, 0.95, False),  # all of the force may relax
        ("hysteresis", "trailing", {"width": 0.5}, 0.0, 0.5, True),  # a fit was not let beyond
        ("hysteresis", "bouc-wen", {"beta": 1.0}, 0.5, 1.0, False),  # it unloads as it loads
        ("hysteresis", "bouc-wen", {"beta": 0.5}, 0.5, 1.0, True),
        ("crosstalk", "wires", {"share": 0.25}, 0.0, 0.25, True),  # a quarter of a signal is not all of it
        ("crosstalk", "wires", {"fall": 1.0}, 0.0, 1.0, False),  # all wires couple alike
        ("dead-zone", "knee", {"sharpness": 20.0}, 1.2, 20.0, False),  # a corner
        ("dead-zone", "knee", {"sharpness": 1.2}, 1.2, 20.0, True),  # a blunt one imitates a curve
    ],
)
def test_a_value_with_a_meaning_of_its_own_is_no_bound(kind, form, values, low, high, at_bound):
    model = Model(SensorParameters(), (effect(kind, form, **values),))
    (name,) = values
    assert parameters_at_bounds(model, (FreeParameter(0, name, low, high),), 0) == (values if at_bound else {})


@pytest.mark.long("two whole diagnoses")
def test_check_recordings_choose_no_effect():
    """The amended model has the same effects, whatever the check recording holds; only what is said of it changes."""
    rig = cases.rig(contact=lambda f, t: f / (1.0 + 4.0 * f), seed=5, trials=4, seconds=6.0)
    plain, other = diagnosed(rig), diagnosed(with_check(rig, 0.6))
    chosen = [[(one.name, one.form) for one in result.best.model.effects] for result in (plain, other)]
    assert chosen[0] and chosen[0] == chosen[1]
    assert not plain.check.is_refuted and other.check.is_refuted
