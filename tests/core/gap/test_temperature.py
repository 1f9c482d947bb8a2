# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures of recordings: read with their unit, on the clock of the samples, and what follows them is named."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest
from rig_files import RIG, refusal, table, write

from palpate.core.effects.library.temperature import REFERENCE
from palpate.core.gap.candidates.candidates import candidates, scales_of
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.logs.column_meaning import meaning_of, unit_of

IN_KELVIN = '[columns]\ntemperature = { name = "T", unit = "K" }\n\n[sensor]'


def warmed(name="temperature", zero=0.0):
    """The table of rig_files with temperatures from 20 to 30 °C, and one missing."""
    header, *rows = table()
    values = [f"{20.0 + 10.0 * i / (len(rows) - 1) + zero:.9g}" for i in range(len(rows))]
    values[3] = ""
    return [[*header, name], *([*row, value] for row, value in zip(rows, values, strict=True))]


def named(predictors):
    return {one.label for one in candidates(predictors, Model(predictors[0].rig.parameters)) if one.name == "temperature"}


def test_a_column_of_temperatures(tmp_path):
    rig = read_rig(write(tmp_path, press=warmed(), again=warmed()))
    time, values = rig.trials[0].temperature
    assert not rig.warnings and len(time) == len(rig.trials[0].time) - 1
    np.testing.assert_allclose(values[[0, -1]], [20.0, 30.0])
    np.testing.assert_allclose(time[[0, -1]], rig.trials[0].time[[0, -1]])
    predictors = predictors_of(rig.trials, rig)
    assert scales_of(predictors, Model(rig.parameters)).warmth == pytest.approx(10.0)
    assert named(predictors) == {"temperature/gain", "temperature/zero", "temperature/gain-and-zero"}
    free = next(one for one in candidates(predictors, Model(rig.parameters)) if one.label == "temperature/gain")
    assert [parameter.name for parameter in free.form.parameters] == ["gain_change"]


def test_kelvins_are_told_by_the_rig(tmp_path):
    rows = warmed("T", 273.15)
    trial = read_rig(write(tmp_path, RIG.replace("[sensor]", IN_KELVIN, 1), press=rows, again=rows)).trials[0]
    np.testing.assert_allclose(trial.temperature[1][[0, -1]], [20.0, 30.0], atol=1e-6)
    assert "check its unit" in refusal(tmp_path, press=warmed(zero=5000.0), again=warmed())


def test_only_where_every_recording_has_it(tmp_path):
    rig = read_rig(write(tmp_path, press=warmed()))
    assert not named(predictors_of(rig.trials, rig))


def test_a_session_puts_temperatures_on_its_clock(tmp_path):
    words = RIG.replace("[[trial]]", '[[trial]]\nsession = "day"')
    rig = read_rig(write(tmp_path, words, press=warmed(), again=warmed()))
    predictors = predictors_of(rig.trials, rig)
    for trial, predictor in zip(rig.trials, predictors, strict=True):
        np.testing.assert_allclose(trial.temperature[0][[0, -1]], trial.time[[0, -1]])
        assert predictor.session is not None
    assert rig.trials[1].time[0] > rig.trials[0].time[-1]
    assert predictors[0].responses is predictors[1].responses


def test_what_a_log_calls_a_temperature():
    assert meaning_of("temperature_degC").quantity == meaning_of("Temp [K]").quantity == "temperature"
    assert meaning_of("Temp [K]").unit == "K"
    assert unit_of("°C", "", 295.0)[0] == "K" and unit_of("°C", "", 21.0)[0] == "°C"
    assert unit_of("°C", "°F", 70.0) == ("°F", "the file says so", False)


@pytest.mark.long("a whole diagnosis of six recordings")
def test_recordings_that_differ_by_their_temperature_do_not_differ_by_gains_of_their_own():
    """Each is made at a temperature of its own, which the gain follows by a line."""
    rng = np.random.default_rng(1)
    temperatures = rng.permutation(np.linspace(16.0, 32.0, 6))
    warmth = iter(temperatures)
    rig = cases.rig(lambda force, time: force * (1.0 + 0.015 * (next(warmth) - REFERENCE)), trials=6)
    measured = [warm + 0.02 * rng.normal(size=len(one.time)) for warm, one in zip(temperatures, rig.trials, strict=True)]
    trials = [replace(one, temperature=(one.time, values)) for one, values in zip(rig.trials, measured, strict=True)]
    result = cases.diagnosed(replace(rig, trials=tuple(trials)))
    assert [one.name for one in result.findings] == ["temperature"] and result.findings[0].confidence > 0.95
    assert result.between is None and result.verdict == "explained"
