# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences and numbers of a report; its files are tested in test_workflow.py."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import gap_cases as cases
import numpy as np
import pytest

from palpate.commands.gap import _parameter_rows
from palpate.core.effects.engine.registry import effect
from palpate.core.gap.base.base_model import base_fit, prepared
from palpate.core.gap.base.recording_differences import RecordingDifferences
from palpate.core.gap.candidates.silenced_texels import silenced_texels
from palpate.core.gap.candidates.view_set import view_set_of
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.fitting.intervals import ParameterInterval
from palpate.core.gap.fitting.least_squares import BASE
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.report import summary
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.report.html_report import _evidence_table, _value_and_ends
from palpate.core.gap.report.sentences import NOT_IDENTIFIABLE, headline, interval_text, said_confidence
from palpate.core.model.sensor_parameters import SensorParameters


@pytest.mark.parametrize(("gains", "levels", "odd"), [
    ([1.0, 1.001, 0.9, 0.999], [0.0] * 4, "t2"),
    ([1.0] * 4, [0.0, 2.0, 0.01, -0.01], "t1"),
    ([1.0, 0.95, 0.9, 0.85], [0.0] * 4, None),
])  # fmt: skip
def test_one_odd_recording_is_told_from_several(gains, levels, odd):
    own = ({f"t{i}": value for i, value in enumerate(values)} for values in (gains, levels))
    found = RecordingDifferences(0.9, 0.95, 0.05, *own).odd_recording(10.0)
    assert (found[0] if found else None) == odd


@pytest.mark.long("a whole diagnosis of recordings of which one is shifted")
def test_a_shifted_recording_is_named_and_its_gap_is_that_before_it_was_shifted_back():
    count = iter(range(5))
    rig = cases.rig(lambda force, time: force + (0.01 if next(count) == 2 else 0.0), seed=1, trials=5, seconds=6.0)
    result = cases.diagnosed(rig)
    errors = gap_errors(result)
    said, found = headline(result, errors), summary.summary(result, errors)
    assert result.between is not None and result.verdict == "explained"
    assert "Only 't2' differs: it reads" in said and "more than the others" in said
    gap = found["gap"]
    assert gap["before"]["fit"] == pytest.approx(result.between.before) and gap["before"]["fit"] > 2 * gap["after"]["fit"]
    assert gap["closed"]["fit"] > 0.9 and gap["closed"]["least"] <= gap["closed"]["fit"]
    by_name = {one["trial"]: one for one in found["fitted"]}
    assert list(by_name) == ["t0", "t1", "t2", "t3"]
    assert max(by_name, key=lambda name: by_name[name]["before"]) == "t2"
    assert by_name["t2"]["after"] < 0.5 * by_name["t2"]["before"]


def test_recordings_without_any_noise_have_a_floor_above_zero():
    time = np.arange(600) / cases.RATE
    trials = []
    for name, use, size in (("a", "fit", 1.0e-3), ("b", "fit", 1.5e-3), ("c", "check", 2.0e-3)):
        depth = np.maximum(size * np.sin(1.7 * time - 0.5), 0.0)
        force = 100.0 * depth
        trials.append(cases.depth_trial(time, depth, reading=(force / (1.0 + force / 0.15))[:, None], name=name, use=use))
    result = cases.diagnosed(cases.grid_rig(1, 1, 4e-3, SensorParameters(k=100.0, cn=0.0), tuple(trials), given=("k",)))
    errors = gap_errors(result)
    assert errors.noise_floor > 0.0 and result.noise_level[0] == 0.0
    assert headline(result, errors).startswith("Missing: saturation; the error shrinks from")


@pytest.mark.parametrize("fades", [0.0, 0.9, 1.0])
def test_a_texel_that_dies_midway_is_named_with_the_time(fades):
    rig = cases.rig(seed=3, stated=80.0, trials=3, seconds=8.0, noise=1e-4)
    texel = int(np.argmax(np.min([t.reading.max(axis=0) for t in rig.trials], axis=0)))  # loaded in all recordings
    trials = list(rig.trials)
    for number, one in enumerate(trials):
        dies = np.full(len(one.time), number > 1) | ((number == 1) & (one.time > 4.0))
        reading = one.reading.copy()
        reading[dies, texel] *= 1.0 - fades
        trials[number] = replace(one, reading=reading)
    found = silenced_texels(predictors_of(tuple(trials), rig), Model(rig.parameters), 1e-5)
    if fades == 0.0:
        assert not found
        return
    (one,) = found
    assert one.texel == texel and (one.recording == "t2" or (one.recording == "t1" and one.seconds > 4.0))


@pytest.mark.slow("the base model of the sample rig")
def test_the_end_of_a_release_is_no_death():
    """The sample rig creeps: late in a release its texels read nothing where the base model says a small load."""
    rig = read_rig(Path(__file__).parents[3] / "docs" / "sample-rig" / "rig.toml")
    predictors = predictors_of(rig.trials, rig)
    noise, full = prepared(rig, predictors)
    views = view_set_of([one for one in predictors if one.trial.use == "fit"], (noise[0].deviation, noise[1].deviation))
    base = base_fit(rig, views.whole, full[0])
    assert not silenced_texels(predictors, base.model, noise[0].deviation)


def test_numbers_without_an_interval_stand_below_the_others():
    """A scan found the shift, and no fit says how well it is known."""
    shift = effect("misalignment", "shift", x=-0.00119, y=0.00255)
    result = SimpleNamespace(
        intervals=[ParameterInterval(BASE, "k", 58.0, 57.0, 59.0), ParameterInterval(0, "y", 0.00255, 0.002, 0.003)],
        best=SimpleNamespace(model=SimpleNamespace(effects=(shift,))),
    )
    assert _parameter_rows(result) == [
        ("base model", "k", "58 (57 … 59)"),
        ("misalignment", "y", "0.00255 (0.002 … 0.003)"),
        ("misalignment", "x", "-0.00119 (no interval)"),
    ]


def test_what_leaves_more_and_is_a_rival_is_not_distinguished():
    """The share that a rival leaves would read as evidence against it."""

    def row(ambiguous):
        one = {"effect": "dead-zone", "gap_before": 0.05, "gap_after": 0.01, "confidence": 0.49}
        one["next_best"] = {"effect": "misalignment", "leaves": 11.2}
        return _evidence_table({"found": [one], "ambiguous": ambiguous}).rows[0][-1]

    assert row([["dead-zone", "misalignment"]]) == "misalignment, which is not distinguished from it"
    assert row([]) == row([["creep", "dead-zone", "misalignment"]]) == "misalignment, which leaves 11 times as much"


@pytest.mark.parametrize(("value", "low", "high", "bounds", "is_told"), [
    (0.4, 0.3, 0.5, (0.0, 0.95), True),
    (0.95, 0.8, 0.95, (0.0, 0.95), True),  # at one end of its bounds alone
    (0.95, 0.0, 0.95, (0.0, 0.95), False),
    (1.0, 0.01, 30.0, (0.0, 1e6), False),  # the order of magnitude is open
    (-1.0, -1.5, -0.5, (-10.0, 10.0), True),
])  # fmt: skip
def test_an_interval_that_fills_its_bounds_is_not_told(value, low, high, bounds, is_told):
    text = interval_text(ParameterInterval(0, "amount", value, low, high, bounds))
    assert text == (
        f"{value:.4g} ({low:.4g} … {high:.4g})"
        if is_told
        else f"not identifiable from these recordings; sensor.toml has {value:.4g}"
    )


@pytest.mark.parametrize(("confidence", "said"), [(0.25, "25%"), (0.985, "98%"), (0.99, "99%"), (0.9996, "over 99%")])
def test_no_confidence_is_said_as_certain(confidence, said):
    assert said_confidence(confidence) == said


def test_the_report_states_no_value_that_the_recordings_leave_open():
    assert _value_and_ends(0.95, NOT_IDENTIFIABLE) == ("–", NOT_IDENTIFIABLE)
    assert _value_and_ends(0.95, "0.9 … 1") == ("0.95", "0.9 … 1")
