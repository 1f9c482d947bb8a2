# SPDX-License-Identifier: GPL-3.0-or-later
"""The noise is measured from all cells that there are: missing ones do not change it."""

from dataclasses import replace

import gap_cases as cases
import numpy as np
import pytest

from palpate.core.gap.fitting.noise_floor import force_noise, reading_noise
from palpate.core.gap.forward.predictor import predictors_of

NOISE = 0.003
ERROR = 0.05
"""The deviation of a few thousand values has a standard error of 2 %."""


def with_missing(values, share, rng):
    """Values of which a share is missing."""
    return np.where(rng.random(values.shape) < share, np.nan, values)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.1, 0.4])
def test_missing_readings_leave_the_noise_as_it_is(share):
    rng, rig = np.random.default_rng(11), cases.rig(trials=2, seconds=8.0, noise=NOISE)
    trials = tuple(replace(one, reading=with_missing(one.reading, share, rng)) for one in rig.trials)
    found = reading_noise(predictors_of(trials, rig), 1.0)
    true = reading_noise(predictors_of(rig.trials, rig), 1.0)
    assert true.source == found.source == "stretches without load"
    assert found.deviation == pytest.approx(true.deviation, rel=ERROR)
    assert found.correlation_time == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("zeros", [0.0, 50.0])
def test_neither_common_mode_nor_zeros_nor_the_median_bias_the_noise(zeros):
    rng, rig, found = np.random.default_rng(14), cases.rig(trials=2, seconds=20.0), []
    for _ in range(8):
        trials = []
        for one in rig.trials:
            common = np.sin(one.time)[:, None] + zeros * NOISE * rng.normal(size=one.reading.shape[1])
            trials.append(replace(one, reading=common + NOISE * rng.normal(size=one.reading.shape)))
        found.append(reading_noise(predictors_of(trials, rig), 1.0).deviation / NOISE)
    error = np.std(found, ddof=1) / np.sqrt(len(found))
    assert error < 0.003 and np.mean(found) == pytest.approx(1.0, abs=3 * error)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_missing_forces_leave_the_noise_as_it_is(share):
    rng, rig = np.random.default_rng(12), cases.rig(trials=2, seconds=8.0)
    force = [np.sin(one.time)[:, None] + NOISE * rng.normal(size=(len(one.time), 3)) for one in rig.trials]
    trials = tuple(replace(t, force=with_missing(f, share, rng)) for t, f in zip(rig.trials, force, strict=True))
    assert force_noise(predictors_of(trials, rig), 1.0).deviation == pytest.approx(NOISE, rel=2 * ERROR)


def test_coloured_noise_keeps_its_memory_where_cells_are_missing():
    rng, rig = np.random.default_rng(13), cases.rig(trials=2, seconds=30.0)
    trials = []
    for one in rig.trials:
        noise = rng.normal(size=one.reading.shape)
        noise[1:] += noise[:-1]  # of neighbours: correlation 1/2, so a memory of two samples
        trials.append(replace(one, reading=one.reading + NOISE * noise))
    some = [replace(one, reading=with_missing(one.reading, 0.3, rng)) for one in trials]
    whole, part = (reading_noise(predictors_of(one, rig), 1.0) for one in (trials, some))
    assert part.deviation == pytest.approx(whole.deviation, rel=ERROR)
    assert part.correlation_time == pytest.approx(whole.correlation_time, abs=0.3)
