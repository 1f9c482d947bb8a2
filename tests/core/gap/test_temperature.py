# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures of recordings: read with their unit, on the clock of the samples, and what follows them is named."""

import numpy as np
import pytest
import small_pad
from rig_files import RIG, table, write

from palpate.benchmarks._recordings import Recording
from palpate.benchmarks._rows import sure_names
from palpate.core.effects.library.temperature import REFERENCE
from palpate.core.errors import PalpateError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.forward.predictor import Model, predictors_of
from palpate.core.gap.logs.column_meaning import meaning_of, unit_of
from palpate.core.gap.selection.candidates import candidates, scales_of
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job

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
    with pytest.raises(PalpateError, match="check its unit"):
        read_rig(write(tmp_path, press=warmed(zero=5000.0), again=warmed()))


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
    assert unit_of("°C", "°F", 70.0) == ("°F", "the file says so", "stated")


@pytest.mark.long("a whole diagnosis of warm and cold recordings")
def test_a_gain_and_a_zero_that_follow_it_are_named(tmp_path):
    """That the zero of each texel follows it in another degree is left."""
    sure, result = examined(pad_in_a_warming_room(2), tmp_path)
    closed = [share for share in result.closed.left_out if share is not None]
    assert sure == {"temperature"} and result.findings[0].form == "gain-and-zero" and min(closed) > 0.9


def examined(recordings, folder):
    """The diagnosis of a rig of recordings (path, readings, temperatures), and what it names surely."""
    trials = [
        (f"t{i}", "check" if i in (2, 4) else "fit", small_pad.columns_of(path, reading, temperature=warmth))
        for i, (path, reading, warmth) in enumerate(recordings)
    ]
    result = run_job(diagnose(read_rig(Recording("pad", small_pad.SENSOR, trials).write(folder))))
    return sure_names(result), result


def pad_in_a_warming_room(number):
    """Six recordings of a room that warms and cools; gain and zero follow it by formulas that the library does not have."""
    rng = np.random.default_rng(number)
    spread, recordings = 1.0 + 0.1 * rng.normal(size=small_pad.ROWS * small_pad.COLUMNS), []
    for _ in range(6):
        path = small_pad.presses(rng)
        force, time = small_pad.loads(path), np.arange(len(path)) / small_pad.RATE
        warmth = rng.uniform(15.0, 32.0) + rng.uniform(-4.0, 4.0) * np.sin(2.0 * np.pi * time / rng.uniform(15.0, 60.0))
        above = warmth[:, None] - 22.0
        zero = 0.015 * force.max() * above * (1.0 + 0.01 * above) * spread
        reading = force / (1.0 + 0.02 * above + 0.0001 * above**2) + zero
        recordings.append((path, reading + 0.005 * force.max() * rng.normal(size=force.shape), warmth))
    return recordings


def pad_in_rooms(kind, number):
    """Six recordings, each at a temperature of its own: `kind` says whether gain or zero follows it, by a line."""
    rng = np.random.default_rng(number)
    warmth, rate = rng.permutation(np.linspace(16.0, 32.0, 6)), 0.015
    recordings = []
    for warm in warmth:
        path = small_pad.presses(rng)
        force, above = small_pad.loads(path), rate * (warm - REFERENCE)
        full, noise = force.max(), rng.normal(size=force.shape)
        reading = (force * (1.0 + above) if kind == "gain" else force + above * full) + 0.005 * full * noise
        recordings.append((path, reading, warm + 0.02 * rng.normal(size=len(path))))
    return recordings


@pytest.mark.long("two whole diagnoses of six recordings")
@pytest.mark.parametrize("kind", ["gain", "zero"])
def test_recordings_that_differ_by_their_temperature_do_not_differ_by_levels_and_gains_of_their_own(tmp_path, kind):
    sure, result = examined(pad_in_rooms(kind, 1), tmp_path)
    assert sure == {"temperature"} and result.between is None and result.verdict == "explained"
    assert result.findings[0].confidence > 0.95
