# SPDX-License-Identifier: GPL-3.0-or-later
"""Which effects on top of recordings can be told is computed from what was put on top (benchmarks/_tellable.py)."""

from __future__ import annotations

import gap_cases as cases
import numpy as np
import pytest
from scipy.signal import lfilter

from palpate.benchmarks._injected import CleanedRecordings, with_effect
from palpate.benchmarks._recordings import Recording
from palpate.benchmarks._tellable import Tellable, tellable
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.forward.predictor import predictors_of
from palpate.core.gap.selection import diagnosis
from palpate.core.gap.selection.base_model import prepared

LEFT = 0.004
"""Newtons that nothing explains, with a memory of a quarter of a second; full load is 0.2 N."""


def cleaned(depth_of):
    """Three recordings of one texel, as if effects had been taken out of them."""
    rng, trials = np.random.default_rng(5), []
    for i in range(3):
        depth = depth_of(rng)
        time = np.arange(len(depth)) / cases.RATE
        rest = lfilter([np.sqrt(1.0 - 0.9**2)], [1.0, -0.9], rng.normal(size=len(depth)))
        reading = 80.0 * np.maximum(depth, 0.0) + LEFT * rest
        trials.append((f"t{i}", "check" if i == 2 else "fit", {"time": time, "depth": depth, "texel_0": reading}))
    words = "grid = { rows = 1, columns = 1, pitch = 0.004 }\nk = 80.0\ncn = 0.0"
    return CleanedRecordings(Recording("one texel", words, trials), LEFT, LEFT / 0.2)


def with_base_model(one, folder):
    """The diagnosis before any effect is looked for."""
    rig = read_rig(one.recording.write(folder))
    predictors = predictors_of(rig.trials, rig)
    return diagnosis._search_of(rig, predictors, *prepared(rig, predictors), []).result


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    one = cleaned(lambda rng: -cases.path(rng, 12.0))
    return one, with_base_model(one, tmp_path_factory.mktemp("pressed"))


@pytest.mark.parametrize(("size", "fails"), [(4.0, False), (0.3, True)])
def test_a_creep_can_be_told_where_it_is_larger_than_what_is_left(pressed, size, fails):
    one, freed = pressed
    found = tellable("creep", one, freed, with_effect(one, "creep", size))
    assert found.is_shown and found.nearest != "creep" and found.leaves > 1.0
    assert bool(found.fails) is fails


def test_what_the_check_recordings_show_is_the_square_of_the_size(pressed):
    """An effect of n times what is left adds n² to its square, which is 1 before."""
    one, freed = pressed
    found = tellable("dead-zone", one, freed, with_effect(one, "dead-zone", 2.0))
    assert found.check == pytest.approx(4.0 / 5.0, abs=0.1)


def test_hysteresis_cannot_be_told_where_nothing_was_unloaded(tmp_path):
    one = cleaned(lambda rng: np.concatenate([np.zeros(40), np.linspace(0.0, rng.uniform(0.001, 0.002), 200)]))
    found = tellable("hysteresis", one, with_base_model(one, tmp_path), with_effect(one, "drift", 2.0))
    assert found.fails == "the stimulus does not show it"


@pytest.mark.parametrize(("found", "fails"), [
    (Tellable(True, "lag", 3.0, 1.5, 0.8), ""),
    (Tellable(False, "lag", 3.0, 1.5, 0.8), "the stimulus does not show it"),
    (Tellable(True, "lag", 1.4, 1.5, 0.8), "lag could pass for it"),
    (Tellable(True, "lag", 3.0, 1.5, 0.4), "the check recordings hardly show it"),
])  # fmt: skip
def test_each_reason_is_said(found, fails):
    assert found.fails == fails
