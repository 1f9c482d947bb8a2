# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sensor remembers goes on from recording to recording of a session, and nowhere else."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.effects.engine.registry import effect
from palpate.core.gap.candidates.view_set import view_set_of
from palpate.core.gap.fitting.noise_floor import coverage
from palpate.core.gap.forward.predictor import Model, Predictor, predictors_of
from palpate.core.model.sensor_parameters import SensorParameters

PARAMETERS = SensorParameters(k=80.0, cn=0.8)
STEP, CYCLE = 0.05, 40
HISTORIES = {
    "wear": effect("wear", "exponential", life=2.0),
    "wear by dose": effect("wear", "dose", life=5.0),
    "softening": effect("softening", "path", share=0.4, path=0.01),
    "creep": effect("creep", "exponential", amount=0.3, time=3.0),
    "drift": effect("drift", "linear", rate=0.01),
    "lag": effect("lag", "first-order", time=0.4),
}


def presses(cycles, start=0.0):
    """Triangular presses of 1.5 mm, each of 2 s, unloaded for 0.5 s before each."""
    time = start + STEP * np.arange(cycles * CYCLE)
    phase = np.arange(cycles * CYCLE) % CYCLE
    return time, np.interp(phase, [0, 10, 25, 39], [0.0, 0.0, 1.5e-3, 0.0])


def session_of(pieces, session="s"):
    """Predictors of trials (time, level, name) in one session, with their rig."""
    trials = [
        replace(cases.depth_trial(time, level, reading=level[:, None] * 0.0, name=n), session=session)
        for time, level, n in pieces
    ]
    rig = cases.grid_rig(1, 1, 0.01, PARAMETERS, trials)
    return predictors_of(trials, rig)


@pytest.mark.parametrize("name", HISTORIES)
def test_a_recording_cut_in_two_is_predicted_like_the_whole(name):
    model = Model(PARAMETERS, (HISTORIES[name],))
    time, level = presses(4)
    whole = Predictor(cases.depth_trial(time, level), cases.grid_rig(1, 1, 0.01, PARAMETERS)).predict(model).reading
    cut = 2 * CYCLE
    parts = session_of([(time[:cut], level[:cut], "a"), (time[cut:], level[cut:], "b")])
    found = np.concatenate([one.predict(model).reading for one in parts])
    # The rate at the cut is a one-sided difference in each part; the sensor is unloaded there.
    np.testing.assert_allclose(found, whole, rtol=1e-9, atol=1e-12)
    fresh = session_of([(time[cut:], level[cut:], "b")])[0].predict(model).reading
    if name not in ("lag", "drift"):  # nothing is left of a lag after half a second, and a drift goes by the clock alone
        assert np.abs(fresh - whole[cut:]).max() > 1e-3 * whole.max()


@pytest.mark.parametrize("name", HISTORIES)
def test_a_pause_is_time_without_load(name):
    model = Model(PARAMETERS, (HISTORIES[name],))
    (time, level), pause = presses(2), 7.0
    later = time[-1] + pause + time
    idle = np.arange(time[-1] + STEP, later[0] - 0.5 * STEP, STEP)
    stamps = np.concatenate([time, idle, later])
    loads = np.concatenate([level, 0.0 * idle, level])
    rig = cases.grid_rig(1, 1, 0.01, PARAMETERS)
    whole = Predictor(cases.depth_trial(stamps, loads), rig).predict(model).reading[-len(time) :]
    _, second = session_of([(time, level, "a"), (later, level, "b")])
    np.testing.assert_allclose(second.predict(model).reading, whole, rtol=1e-6, atol=1e-9)


def test_trials_of_other_sessions_or_none_begin_untouched():
    model = Model(PARAMETERS, (HISTORIES["wear"],))
    time, level = presses(2)
    trials = [cases.depth_trial(time, level, name=name) for name in "abc"]
    trials = [replace(trials[0], session="one"), replace(trials[1], session="two"), trials[2]]
    found = [one.predict(model).reading for one in predictors_of(trials, cases.grid_rig(1, 1, 0.01, PARAMETERS, trials))]
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


def test_thinned_views_keep_the_history_of_all_recordings():
    model = Model(PARAMETERS, (HISTORIES["softening"],))
    first, second = presses(8), presses(8, start=8 * CYCLE * STEP + 30.0)
    parts = session_of([(*first, "a"), (*second, "b")])
    alone = view_set_of(parts[1:], (1.0, 1.0)).few_samples[0].predictor  # the other recording is only checked
    found, exact = alone.predict(model).reading, parts[1].predict(model).reading[::4]
    fresh = session_of([(*second, "b")])[0].predict(model).reading[::4]
    # Thinned samples miss the tips of the presses, so a little of the path that softens the sensor.
    assert np.abs(found - exact).max() < 0.02 * exact.max() < 0.2 * np.abs(fresh - exact).max()


def test_cycles_of_a_session_are_counted_together():
    pieces = [(*presses(1, start=10.0 * i), f"t{i}") for i in range(3)]
    assert coverage(session_of(pieces)).cycles == 3
    assert coverage(session_of(pieces, session="")).cycles == 1


def test_tared_recordings_are_predicted_from_their_first_sample():
    time, level = presses(2)
    offset = effect("offset", "common", offset=0.5)
    trial = replace(cases.depth_trial(time, level + 1e-3), tared=True)
    found = Predictor(trial, cases.grid_rig(1, 1, 0.01, PARAMETERS)).predict(Model(PARAMETERS, (offset,))).reading
    np.testing.assert_allclose(found[:, 0], PARAMETERS.k * level, atol=0.05)
    assert found[0, 0] == 0.0
