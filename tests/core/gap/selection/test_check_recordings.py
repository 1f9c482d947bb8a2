# SPDX-License-Identifier: GPL-3.0-or-later
"""The check recordings decide whether an amended model explains a gap, and what keeps a name from being sure."""

import json
from dataclasses import replace
from types import SimpleNamespace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import effect
from palpate.core.gap.fitting.intervals import ParameterInterval
from palpate.core.gap.fitting.least_squares import Fit, FreeParameter, TrialView
from palpate.core.gap.forward.predictor import Model, Predictor
from palpate.core.gap.report import sentences, summary
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.selection import diagnosis
from palpate.core.gap.selection.candidates import parameters_at_bounds
from palpate.core.gap.selection.check_recordings import CheckedRecording, CheckOutcome, checked
from palpate.core.gap.selection.confidence import CLEAR_LEAD, _closes_most, unsettled_parameters
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.gap.selection.forward_selection import SelectionState, SelectionStep
from palpate.core.gap.selection.gap_sizes import GapSizes, Improvement
from palpate.core.gap.selection.verdict import FAULTY, REFUTED, conclude
from palpate.core.jobs import run_job
from palpate.core.model.sensor_parameters import SensorParameters

GAP_SIZES = GapSizes(np.array([10.0, 0.0]), np.ones(2), np.array([900.0, 0.0]))
NOISE = 1e-4


def diagnosed(rig):
    return run_job(diagnose(rig))


def recording(before, after, name="t", rise=0.3):
    """A check recording of readings alone with these mean squares."""
    one = np.array([before, 0.0]), np.array([after, 0.0]), np.array([100.0, 0.0]), np.array([rise, 0.0])
    return CheckedRecording(name, *one)


def with_check(rig, factor=1.0, level=0.0):
    """A rig whose check recording reads so many times as much, and a level more."""
    changed = [t if t.use == "fit" else replace(t, reading=factor * t.reading + level) for t in rig.trials]
    return replace(rig, trials=tuple(changed))


@pytest.mark.parametrize(("closed", "recordings", "refuted"), [
    (0.6, [recording(10, 4)], False),
    (0.4, [recording(10, 6)], True),
    (0.6, [recording(10, 2), recording(2, 2.5)], True),  # one of them is worse by more than its noise
    (0.6, [recording(10, 2), recording(2, 2.2)], False),
    (None, [recording(1, 1.1)], False),  # nothing to close, and nothing worse
    (None, [], False),
])  # fmt: skip
def test_half_of_the_gap_and_no_recording_worse(closed, recordings, refuted):
    outcome = CheckOutcome(tuple(recordings), (closed, None))
    assert outcome.is_refuted is refuted
    assert (outcome.worst is None) is not refuted


def test_the_recording_that_speaks_most_clearly_is_named():
    outcome = CheckOutcome((recording(10, 2, "a"), recording(2, 3, "b"), recording(2, 5, "c")), (0.6, None))
    assert outcome.worst is not None and outcome.worst.name == "c"


@pytest.mark.parametrize(("factor", "closes"), [(1.0, True), (1.5, False)])
def test_a_model_is_held_against_recordings_it_has_not_seen(factor, closes):
    """The true model closes the gap; a sensor that has another gain meanwhile opens it again."""
    rig = with_check(cases.rig(contact=lambda f, t: f / (1.0 + 4.0 * f), seed=4, trials=2, seconds=5.0, stated=80.0), factor)
    views = [TrialView(Predictor(t, rig), noise=(NOISE, 1.0)) for t in rig.of("check")]
    base = Model(rig.parameters)
    gap_sizes = GapSizes(np.array([1e4, 0.0]), np.array([16.0, 1.0]), np.array([900.0, 0.0]))
    amended = base.with_effect(effect("saturation", "rational", level=0.25))
    outcome = checked(views, base, amended, gap_sizes)
    assert (outcome.closed[0] > 0.9) is closes and outcome.is_refuted is not closes
    assert outcome.closed[1] is None  # no forces were measured


@pytest.mark.long("a whole diagnosis")
def test_a_check_that_fails_is_said_with_what_differs(tmp_path):
    rig = with_check(cases.rig(contact=cases.relaxing(), seed=7, trials=4, seconds=9.0), 0.6)
    result = diagnosed(rig)
    assert [one.name for one in result.findings] == ["creep"] and result.findings[0].confidence < 0.5
    assert result.verdict == "unexplained" and result.findings[0].doubts == (REFUTED,)
    errors = gap_errors(result)
    assert f"creep: {REFUTED}, so its name is in doubt" in sentences.evidence(result, errors)
    said = sentences.headline(result, errors)
    assert "creep fits the fitted recordings" in said and "'t3'" in said and "40% less" in said
    assert sentences.caution(result) in sentences.warnings(result)
    found = summary.summary(result, errors)
    json.dumps(found, allow_nan=False)
    assert found["gap"]["closed"]["least"] == found["gap"]["closed"]["check"] < 0.5 < found["gap"]["closed"]["fit"]
    assert found["check"][0]["trial"] == "t3" and any("40% less" in text for text in found["check"][0]["differs"])


def test_noise_in_the_fitted_recordings_is_no_gap_only_where_the_check_is_noise_too():
    rig = cases.rig(seed=6, trials=4, seconds=6.0)
    assert diagnosed(rig).verdict == "no gap"
    result = diagnosed(with_check(rig, level=0.02))
    assert result.verdict == "unexplained" and [one.name for one in result.unlike_fitted] == ["t3"]
    assert "without load it reads" in sentences.headline(result, gap_errors(result))


@pytest.mark.long("two whole diagnoses")
def test_check_recordings_choose_no_effect():
    """The amended model has the same effects, whatever the check recording holds; only what is said of it changes."""
    rig = cases.rig(contact=lambda f, t: f / (1.0 + 4.0 * f), seed=5, trials=4, seconds=6.0)
    plain, other = diagnosed(rig), diagnosed(with_check(rig, 0.6))
    chosen = [[(one.name, one.form) for one in result.best.model.effects] for result in (plain, other)]
    assert chosen[0] and chosen[0] == chosen[1]
    assert not plain.check.is_refuted and other.check.is_refuted


def test_what_closes_most_stays_sure_beside_little_that_is_ambiguous():
    shares = {"stiffening": Improvement(0.95, 0.95), "hysteresis": Improvement(0.03, 0.6), "creep": Improvement(0.3, 0.9)}
    state = SelectionState(None, None, {}, shares)
    assert _closes_most("stiffening", {"hysteresis"}, state, GAP_SIZES)
    assert not _closes_most("stiffening", {"hysteresis", "creep"}, state, GAP_SIZES)
    assert not _closes_most("creep", {"hysteresis"}, state, GAP_SIZES)


@pytest.mark.parametrize(("left", "most"), [(2.0, True), (6.0, False)])
def test_what_an_effect_closes_alone_counts_where_another_one_imitates_it(left, most):
    """Of a gap of 9 the creep closes 8 alone, or 4, and 1.5 beside a hysteresis that takes most of its work."""
    shares = {"creep": Improvement(1.5 / 9.0, 0.5), "hysteresis": Improvement(0.03, 0.1)}
    alone = SimpleNamespace(
        candidate=SimpleNamespace(name="creep"),
        held_out=np.array([[left * 900.0, 0.0]]),
        fit=SimpleNamespace(count=np.array([[900.0, 0.0]])),
    )
    state = SelectionState(None, None, {}, shares, SelectionStep([alone], [left - 1.0]))
    assert _closes_most("creep", {"hysteresis"}, state, GAP_SIZES) is most


@pytest.mark.parametrize(("values", "interval", "why"), [
    ({"z": 0.0199}, (0.019, 0.02), "bound"),
    ({"z": 0.001}, (0.0005, 0.0015), ""),
    ({"z": 0.001}, (-0.02, 0.02), "do not identify"),
    ({"z": 0.0}, (-0.001, 0.001), ""),
])  # fmt: skip
def test_numbers_at_their_bounds_and_open_ones_do_not_make_a_sure_name(values, interval, why):
    one = effect("misalignment", "tilt", about_x=0.0, about_y=0.0, **values)
    model = Model(SensorParameters(), (one,))
    free = (FreeParameter(0, "z", -0.02, 0.02),)
    rig = cases.rig(seed=1, trials=1, seconds=2.0)
    result = type("Result", (), {})()
    result.rig, result.best = rig, Fit(model, free, np.zeros((1, 2)), np.zeros((1, 2), int))
    result.intervals = [ParameterInterval(0, "z", values["z"], *interval, (-0.02, 0.02))]
    said = unsettled_parameters(one, 0, result)
    assert len(said) == bool(why) and all(why in text for text in said)
    assert ("identify" in why) == (why != "" and not unsettled_parameters(one, 0, result, CLEAR_LEAD) and bool(said))


def test_a_share_of_all_is_no_bound():
    """All of the force may relax; a width that a fit was not let beyond is at a bound."""
    creep, loop = effect("creep", "power", amount=0.95), effect("hysteresis", "trailing", width=0.5)
    model = Model(SensorParameters(), (creep, loop))
    free = (FreeParameter(0, "amount", 0.0, 0.95), FreeParameter(1, "width", 0.0, 0.5))
    assert parameters_at_bounds(model, free, 0) == {} and parameters_at_bounds(model, free, 1) == {"width": 0.5}


@pytest.mark.parametrize(("beta", "at_bound"), [(1.0, {}), (0.5, {"beta": 0.5})])
def test_a_loop_that_unloads_as_it_loads_is_no_bound(beta, at_bound):
    model = Model(SensorParameters(), (effect("hysteresis", "bouc-wen", beta=beta),))
    assert parameters_at_bounds(model, (FreeParameter(0, "beta", 0.5, 1.0),), 0) == at_bound


@pytest.mark.slow("a whole diagnosis, judged again with a check that fails and with faults")
def test_no_name_is_in_doubt_without_a_reason_and_a_failed_check_leaves_none_sure(monkeypatch):
    rig = cases.rig(contact=cases.relaxing(), seed=7, trials=4, seconds=9.0)
    judged, seen = [], []

    def concluding(result, *rest):
        conclude(result, *rest)
        judged.append(result.findings)
        for change in (
            {"check": CheckOutcome((recording(10.0, 20.0),), (-1.0, None))},
            {"faults": [SimpleNamespace(put_right=False, kind="clock")]},
        ):
            other = replace(result, findings=[], ambiguous=[], ruled_out=[], **change)
            conclude(other, *rest)
            seen.append(other.findings)

    monkeypatch.setattr(diagnosis, "conclude", concluding)
    diagnosed(rig)
    (sure,) = judged[0]
    assert sure.name == "creep" and sure.confidence > 0.5 and not sure.doubts
    for (found,), why in zip(seen[:2], (REFUTED, FAULTY), strict=True):
        assert found.name == "creep" and found.confidence < 0.5 and found.doubts == (why,)
