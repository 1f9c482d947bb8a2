# SPDX-License-Identifier: GPL-3.0-or-later
"""A contact height that the rig leaves open is fitted with the base model and is no effect of the sensor."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from rig_files import RIG, write

from palpate.core.errors import FileError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.forward.stimulus import stimulus_of
from palpate.core.gap.selection.candidates import candidates
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job

OFF = 0.0004


def lowered(rig, height, **words):
    """The rig with poses recorded too high by `height`: the sensor's surface is as much higher than they say."""
    trials = [replace(one, position=one.position + [0.0, 0.0, height], **words) for one in rig.trials]
    return replace(rig, trials=tuple(trials))


@pytest.mark.parametrize("height", [-OFF, 0.0029])  # with the second one no recording seems to touch
def test_a_free_height_is_fitted_and_no_effect(height):
    found = run_job(diagnose(lowered(cases.rig(trials=3, seconds=6.0), height, contact_height="all")))
    assert found.verdict == "no gap" and not found.findings
    assert found.best.model.recordings["contact height of all"] == pytest.approx(height, abs=1e-5)
    (interval,) = [one for one in found.intervals if one.name == "contact height of all"]
    assert interval.low < height < interval.high < interval.low + 1e-4


def test_a_stated_height_is_used_as_it_is():
    rig = cases.rig(trials=2, seconds=4.0)
    moved = lowered(rig, OFF, contact_height=OFF)
    for one, other in zip(rig.trials, moved.trials, strict=True):
        np.testing.assert_allclose(stimulus_of(other, moved).depth, stimulus_of(one, rig).depth, atol=1e-12)
        assert stimulus_of(other, moved).trial is other


def test_the_height_of_a_misaligned_sensor_is_no_candidate_beside_a_free_one():
    rig = lowered(cases.rig(trials=2, seconds=4.0), 0.0, contact_height="all")
    predictors = predictors_of(rig.trials, rig)
    open_one = {one.form.name: one for one in candidates(predictors, Model(rig.parameters)) if one.name == "misalignment"}
    assert set(open_one) == {"shift", "turn", "tilt", "rigid"}
    assert all(p.name != "z" for one in open_one.values() for p in one.form.parameters)
    assert open_one["rigid"].effect({"x": 0.001}, 24, 1.0).values["z"] == 0.0
    known = cases.rig(trials=2, seconds=4.0)
    closed = candidates(predictors_of(known.trials, known), Model(known.parameters))
    assert any(p.name == "z" for one in closed if one.name == "misalignment" for p in one.form.parameters)


def test_depths_are_counted_from_where_contact_begins():
    time = np.arange(9.0)
    level = np.array([-2, -1, 0, 1, 2, 1, 0, -1, -2.0]) * 1e-3
    rig = cases.grid_rig(1, 2, 0.004, cases.SensorParameters(k=80.0))
    trial = cases.depth_trial(time, level, reading=np.zeros((9, 2)))
    raised = stimulus_of(trial, rig, height=0.5e-3).depth[:, 0]
    np.testing.assert_allclose(raised, np.maximum(level + 0.5e-3, 0.0))
    clipped = cases.depth_trial(time, np.maximum(level, 0.0), reading=np.zeros((9, 2)))
    np.testing.assert_allclose(stimulus_of(clipped, rig, height=0.5e-3).depth[:, 0], np.where(level > 0, level + 0.5e-3, 0.0))


def test_the_recordings_of_a_session_share_the_height():
    rig = lowered(cases.rig(trials=2, seconds=4.0), OFF, contact_height="all")
    second = replace(rig.trials[1], time=rig.trials[1].time + 10.0)
    trials = [replace(one, session="a") for one in (rig.trials[0], second)]
    plain = predictors_of(cases.rig(trials=2, seconds=4.0).trials, rig)
    model = Model(rig.parameters, recordings={"contact height of all": OFF})
    for one, other in zip(predictors_of(trials, rig), plain, strict=True):
        np.testing.assert_allclose(one.predict(model).reading, other.predict(Model(rig.parameters)).reading, atol=1e-9)


def test_a_rig_says_it(tmp_path):
    def read(of_sensor="", of_trial=""):
        text = RIG.replace("k = 80.0", f"k = 80.0\n{of_sensor}")
        return read_rig(write(tmp_path, text.replace('file = "press.csv"', f'file = "press.csv"\n{of_trial}'))).trials

    assert [one.contact_height for one in read()] == [0.0, 0.0]
    assert [one.contact_height for one in read('contact_height = "free"')] == ["all", "all"]
    assert [one.contact_height for one in read("contact_height = 1e-3", 'contact_height = "free"')] == ["press", 1e-3]
    assert read("", 'contact_height = "free"\nspecimen = "A"')[0].contact_height == "A"
    for words in ('contact_height = "some"', "contact_height = 2", "contact_height = true", "contact_height = [1]"):
        with pytest.raises(FileError, match="contact_height"):
            read(words)
        with pytest.raises(FileError, match="contact_height of Trial 1"):
            read("", words)
    with pytest.raises(FileError, match="again.csv.*is free"):
        read_rig(write(tmp_path, RIG + 'contact_height = "free"\n'))
