# SPDX-License-Identifier: GPL-3.0-or-later
"""What carries over from recording to recording is named as that, and never as a property of the texels."""

from dataclasses import replace
from types import SimpleNamespace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.forward.predictor import Model, Predictor, number_name
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.report.sentences import headline
from palpate.core.gap.report.summary import summary
from palpate.core.gap.selection import between_recordings, screening
from palpate.core.gap.selection.between_recordings import (
    TEXELS,
    as_one_session,
    change_of_level,
    differences,
    may_differ,
    texels_can_tell,
    with_common_zero,
    with_own_numbers,
)
from palpate.core.gap.selection.confidence import SURE
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job
from palpate.core.model.sensor_parameters import SensorParameters


@pytest.fixture(autouse=True)
def quick_search(monkeypatch):
    """A search with few starting points."""
    monkeypatch.setattr(screening, "THOROUGH", replace(screening.QUICK, most_first_fits=6, kinds=2, forms=1))


def changing(change):
    """A rig whose recording number i is `change(force, i)`."""
    count = iter(range(5))
    return cases.rig(lambda force, time: change(force, next(count)), seed=1, trials=5, seconds=6.0)


@pytest.mark.long("a whole diagnosis of five recordings, twice over")
@pytest.mark.parametrize(
    ("change", "name"),
    [
        (lambda force, i: force * (1.0 - 0.08 * i), "drift"),  # of all texels alike, whatever was pressed: no wear
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


def test_a_gain_that_changes_once_follows_no_line():
    noise = 0.002 * np.random.default_rng(0).normal(size=6)
    for first in (2, 3, 4):
        for size in (-0.15, 0.1):
            assert change_of_level(1.0 + size * (np.arange(6) >= first) + noise) == first
    for course in (np.arange(6) / 6, np.sqrt(np.arange(6) / 6), 1.0 - np.exp(-np.arange(6) / 3.0)):
        assert change_of_level(1.0 - 0.3 * course + noise) is None
    assert change_of_level(np.array([1.0, 1.0, 0.8])) is None
    scattered = [change_of_level(1.0 + 0.1 * rng.normal(size=6)) for rng in map(np.random.default_rng, range(300))]
    assert sum(one is not None for one in scattered) < 0.1 * 300


@pytest.mark.slow("a whole diagnosis of six recordings")
def test_a_gain_that_falls_once_is_no_sure_drift():
    count = iter(range(6))
    rig = cases.rig(lambda force, time: force * (1.0 if next(count) < 4 else 0.85), seed=2, trials=6, seconds=8.0)
    result = run_job(diagnose(rig))
    assert result.between is not None and result.between.changed_from == "t4" and result.between.confidence < SURE
    assert result.verdict == "explained" and not any(one.confidence >= SURE for one in result.findings)
    errors = gap_errors(result)
    assert headline(result, errors).startswith("Between recordings the gain changes once, by -15% from 't4' on")
    assert summary(result, errors)["between_recordings"]["changed_from"] == "t4"


SMALL = cases.grid_rig(1, 2, 0.01, SensorParameters(k=60.0))


def differing(gains, amounts, texels_alike):
    """What is said of recordings with such gains, of which each presses all texels `amounts` times."""
    time = np.arange(200) / 20.0
    order = [
        Predictor(cases.depth_trial(time, 1e-3 * np.maximum(np.sin(np.pi * count * time / 10.0), 0.0), name=f"t{i}"), SMALL)
        for i, count in enumerate(amounts)
    ]
    numbers = {number_name("factor", f"t{i}"): gain for i, gain in enumerate(gains)}
    return differences(Model(SMALL.parameters, recordings=numbers), order, 0.9, 0.05, 1.0, texels_alike)


def test_texels_can_tell_wear_from_drift_only_where_they_carry_unequal_loads():
    up_and_down = np.maximum(np.sin(np.linspace(0.0, 12.0, 100)), 0.0)[:, None]
    for shares, told in (([1.0, 1.0, 1.0], False), ([1.0, 0.8, 0.7], False), ([1.0, 0.3, 0.2], True), ([1.0, 0.0, 0.0], False)):
        order = [SimpleNamespace(load=up_and_down * np.array(shares)) for _ in range(3)]
        assert texels_can_tell(order) is told, shares


def test_gains_that_fall_alike_in_recordings_that_are_alike_are_wear_or_drift(monkeypatch):
    falling = 1.0 - 0.06 * np.arange(6)
    alike = differing(falling, [4] * 6, False)
    assert (alike.name, alike.rival, alike.evidence) == ("drift", "wear", "")
    equal_loads = differing(falling, [4] * 6, True)
    assert (equal_loads.rival, equal_loads.evidence) == ("wear", ""), "wear of texels that carry the same is alike, too"
    with monkeypatch.context() as patch:
        patch.setattr(between_recordings, "texels_can_tell", lambda order: True)
        of_all_texels = differing(falling, [4] * 6, True)
    assert (of_all_texels.name, of_all_texels.rival, of_all_texels.evidence) == ("drift", "", TEXELS)
    once = differing(np.array([0.999, 1.0, 1.001, 1.002, 0.9, 0.903]), [4] * 6, False)
    assert (once.name, once.rival, once.changed_from) == ("drift", "wear", "t4")
    assert once.change_of_gain == pytest.approx(-0.0989, abs=1e-3)
    rising = differing(falling[::-1], [4] * 6, False)
    assert rising.rival == rising.changed_from == alike.changed_from == ""
    scattered = differing(np.array([1.0, 0.9, 1.05, 0.95, 1.1, 0.97]), [4] * 6, False)
    assert (scattered.name, scattered.rival) == ("drift", "")


def test_gains_of_texels_are_still_named(monkeypatch):
    gains = 1.0 + 0.25 * np.sin(2.3 * np.arange(cases.ROWS * cases.COLUMNS))
    result = run_job(diagnose(changing(lambda force, i: force * gains)))
    assert result.between is None and [one.name for one in result.findings] == ["gain-mismatch"]


def test_a_zero_that_all_recordings_share_is_no_difference_between_them():
    result = run_job(diagnose(changing(lambda force, i: force + 0.006)))
    assert result.between is None and not result.assumed_session


@pytest.mark.long("a whole diagnosis of five recordings, twice over")
def test_wear_without_a_session_is_found_as_one_session_in_the_order_of_the_rig():
    put_on = [np.zeros(cases.ROWS * cases.COLUMNS)]

    def worn(force, i):
        gathered = put_on[-1] + np.cumsum(np.maximum(np.diff(force, axis=0, prepend=0.0), 0.0), axis=0)
        put_on.append(gathered[-1])
        return force / (1.0 + 0.6 * gathered)

    result = run_job(diagnose(changing(worn)))
    assert result.assumed_session and result.between is None and result.verdict == "explained"
    assert result.findings[0].name == "wear" and result.findings[0].confidence > 0.5
    errors = gap_errors(result)
    assert headline(result, errors).startswith("Between recordings, taken as one session in their order: Missing: wear")
    assert summary(result, errors)["between_recordings"]["effect"] == "wear"


def test_what_a_rig_says_is_not_asked_again():
    rig = changing(lambda force, i: force)
    names = {f"t{i}" for i in range(5)}
    own, common = with_own_numbers(rig), with_common_zero(rig)
    assert may_differ(rig) and {(trial.factor, trial.zero) for trial in own.trials} == {(name, name) for name in names}
    assert {trial.factor for trial in common.trials} == {1.0} and len({trial.zero for trial in common.trials}) == 1
    for words in ({"session": "s"}, {"factor": "A"}, {"zero": 0.1}):
        assert not may_differ(replace(rig, trials=(replace(rig.trials[0], **words), *rig.trials[1:])))
    assert not may_differ(replace(rig, trials=(*rig.trials[:2], rig.trials[4])))


def test_one_session_keeps_the_order_of_the_rig():
    rig = changing(lambda force, i: force)
    session = as_one_session(rig)
    assert session is not None and len({trial.session for trial in session.trials}) == 1
    ends = [float(trial.time[-1]) for trial in session.trials]
    assert all(trial.time[0] > end for trial, end in zip(session.trials[1:], ends[:-1], strict=True))
    assert [trial.name for trial in session.trials] == [trial.name for trial in rig.trials]
