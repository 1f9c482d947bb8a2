# SPDX-License-Identifier: GPL-3.0-or-later
"""The models beside which the workflow is judged on further public recordings: they find what they consist of."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.benchmarks._further.handmade import HANDMADE, HandmadeModel, low_pass, predict_by_hand
from palpate.benchmarks._further.learned import predict_learned
from palpate.benchmarks._further.recordings import FURTHER
from palpate.benchmarks._further.sources import SOURCES
from palpate.benchmarks._recordings import Recording

EXPONENT, GAIN = 1.4, 2.5


def _law(numbers, columns, channel):
    return [columns["depth"] ** numbers[0]]


LAW = HandmadeModel(_law, (1.0,), (0.5,), (3.0,), "a power law")


def _recording(words: str = "", factors: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Recording:
    time = np.linspace(0.0, 10.0, 200)
    trials = []
    for number, factor in enumerate(factors):
        depth = 1.0 - np.cos((0.5 + 0.1 * number) * time)
        columns = {"time": time, "depth": depth, "texel_0": factor * GAIN * depth**EXPONENT}
        trials.append((f"trial_{number}", "check" if number == 2 else "fit", columns))
    return Recording("a law", "", trials, words)


def test_every_set_has_a_source_and_a_model():
    """A commit, so that anyone reads the same files."""
    assert set(FURTHER) == set(SOURCES) == set(HANDMADE)
    assert all(len(source.commit) == 40 for source in SOURCES.values())


def test_a_model_made_by_hand_finds_its_numbers_on_fitted_recordings():
    """The check recording is predicted, not fitted: with another reading there, the prediction stays."""
    recording = _recording()
    recording.trials[2][2]["texel_0"] *= 3.0
    predicted = predict_by_hand(LAW, recording)
    np.testing.assert_allclose(predicted[2][:, 0], recording.trials[2][2]["texel_0"] / 3.0, rtol=1e-5, atol=1e-6)


def test_a_free_factor_of_each_recording_is_free_for_models_made_by_hand():
    """Three specimens of one law are fitted exactly if the rig leaves a factor free, and only then."""
    factors = (1.0, 1.7, 0.6)
    exact = predict_by_hand(LAW, _recording('factor = "free"', factors))
    for (_, _, columns), prediction in zip(_recording(factors=factors).trials, exact, strict=True):
        np.testing.assert_allclose(prediction[:, 0], columns["texel_0"], rtol=1e-4, atol=1e-5)
    common = predict_by_hand(LAW, _recording("", factors))
    assert np.abs(common[2][:, 0] - _recording(factors=factors).trials[2][2]["texel_0"]).max() > 0.5


def test_the_learned_model_predicts_a_recording_that_it_has_not_seen():
    """A smooth law within the range of what was fitted: to a few per cent of the range."""
    recording = _recording()
    missed = predict_learned(recording)[2][:, 0] - recording.trials[2][2]["texel_0"]
    assert np.sqrt(np.mean(missed**2)) < 0.05 * np.ptp(recording.trials[2][2]["texel_0"])


@pytest.mark.parametrize("tau", [0.1, 2.0])
def test_the_low_pass_answers_a_step_as_an_exponential(tau):
    """Exact whatever the samples are apart."""
    time = np.array([0.0, 0.05, 0.3, 0.35, 1.0, 4.0])
    step = np.append(0.0, np.ones(5))
    np.testing.assert_allclose(low_pass(time, step, tau), np.append(0.0, 1.0 - np.exp(-time[1:] / tau)), rtol=1e-12)
