# SPDX-License-Identifier: GPL-3.0-or-later
"""The noise of readings where contact begins earlier than the rig says, and where no part is without contact."""

from __future__ import annotations

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from scipy.signal import lfilter

from palpate.core.gap.fitting.noise_floor import BEFORE_EARLY_CONTACT, NEIGHBOURING_SAMPLES, NOTHING_UNLOADED, reading_noise
from palpate.core.gap.forward.predictor import predictors_of
from palpate.core.gap.report.sentences import EARLY_CONTACT, NEVER_WITHOUT_CONTACT, warnings
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs.job_runner import run_job
from palpate.core.model.sensor_parameters import SensorParameters

NOISE, SLOPE = 8e-4, 80.0


def flat(texels, early, colour=0.0, words=None):
    """Four recordings of texels under a flat probe that touches `early` metres before the rig says so."""
    rng, trials = np.random.default_rng(3), []
    for i in range(4):
        depth = -cases.path(rng, 10.0)
        time = np.arange(len(depth)) / cases.RATE
        white = rng.normal(size=(len(time) + 200, texels))
        tremble = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white, axis=0)[200:]
        reading = SLOPE * np.maximum(depth, 0.0)[:, None] + NOISE * tremble
        one = cases.depth_trial(time, depth - early, reading=reading, name=f"t{i}", use="check" if i == 3 else "fit")
        trials.append(replace(one, **(words or {})))
    return cases.grid_rig(1, texels, 0.004, SensorParameters(k=SLOPE), trials, given=("k",))


def noise_of(rig):
    return reading_noise(predictors_of(rig.trials, rig), 0.2)


@pytest.mark.parametrize("texels", [1, 3])
@pytest.mark.parametrize("early", [3e-4, 6e-4, 9e-4])
def test_noise_is_measured_before_readings_rise(texels, early):
    found = noise_of(flat(texels, early))
    assert found.source == BEFORE_EARLY_CONTACT
    assert found.deviation == pytest.approx(NOISE, rel=0.4)  # from 16 samples of a recording; it was 6 to 24 times as much


@pytest.mark.parametrize("colour", [0.0, 0.5, 0.9, 0.97])
def test_contact_where_the_rig_says_it_changes_nothing(colour):
    assert noise_of(flat(1, 0.0, colour)).source == "stretches without load"


def test_names_are_in_doubt_where_contact_begins_earlier_and_the_report_says_so():
    found = run_job(diagnose(flat(1, 3e-4)))
    assert found.contact_is_early and EARLY_CONTACT in warnings(found)
    assert found.findings and all(one.confidence < 0.5 for one in found.findings)  # it was a saturation at 0.82


def test_a_free_contact_height_is_the_remedy():
    found = run_job(diagnose(flat(1, 3e-4, words={"contact_height": "all"})))
    assert found.verdict == "no gap" and not found.findings
    assert not found.contact_is_early and EARLY_CONTACT not in warnings(found)
    assert found.best.model.recordings["contact height of all"] == pytest.approx(3e-4, abs=2e-5)


def test_recordings_that_never_leave_the_sensor_say_so():
    rig = flat(1, -0.002)
    assert noise_of(rig).source == NOTHING_UNLOADED
    assert NEVER_WITHOUT_CONTACT in warnings(run_job(diagnose(rig)))


def test_readings_that_never_change_at_rest_were_without_contact_all_the_same():
    rig = flat(1, 0.0)
    trials = [replace(one, reading=np.round(one.reading / 0.02) * 0.02) for one in rig.trials]
    assert noise_of(replace(rig, trials=tuple(trials))).source == NEIGHBOURING_SAMPLES
