# SPDX-License-Identifier: GPL-3.0-or-later
"""A gap of the stimulus is judged by its length against the stimulus, and not by the share of what is missing."""

import numpy as np
import pytest

from palpate.benchmarks._recordings import Recording
from palpate.core.errors import PalpateError
from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.dataset.second_logger import MOST_ERROR, bridged, interpolated, longest_gap

TIME = np.arange(2000) * 0.05
"""100 s at 20 Hz."""


def presses(period):
    """A load that rises and falls as a cosine, once in a period."""
    return 0.5 - 0.5 * np.cos(2 * np.pi * TIME / period)


@pytest.mark.parametrize("period", [2.0, 5.0, 15.0])
def test_the_longest_gap_goes_with_the_time_of_a_press(period):
    """A chord of length g over a cosine of amplitude 1/2 errs by at most (1 − cos(π g / T)) / 2."""
    longest = longest_gap(TIME, presses(period))
    limit = period / np.pi * np.arccos(1.0 - 2.0 * MOST_ERROR)
    assert 0.3 * limit < longest < 1.1 * limit  # lengths are tried in steps of two; the quantile leaves the tops out


def test_nothing_is_interpolated_between_steps():
    steps = (np.floor(TIME / 0.2) % 2 > 0).astype(float)
    values = steps.copy()
    values[5::7] = np.nan
    assert np.isnan(bridged(TIME, values)).sum() == np.isnan(values).sum()


def test_a_stimulus_that_rests_may_lack_any_sample():
    values = np.full(100, 3.0)
    values[20:80] = np.nan
    assert (bridged(TIME[:100], values) == 3.0).all()


def test_a_second_logger_takes_what_the_first_one_knows():
    values = presses(15.0)
    values[1::2] = np.nan
    wanted = TIME[2:-4] + 0.013
    np.testing.assert_allclose(interpolated(TIME, values, wanted), np.interp(wanted, TIME, presses(15.0)), atol=3e-4)


def written(folder, time, force, reading):
    """A rig of one recording, with empty cells where there is no number."""
    columns = {"time": time, "force": force, "texel_0": reading}
    sensor = 'grid = { rows = 1, columns = 1, pitch = 0.01 }\nunit = "V"'
    return Recording("one", sensor, [("press", "fit", columns)]).write(folder)


def test_a_rig_uses_half_of_a_force_and_leaves_out_what_a_long_gap_hides(tmp_path):
    force = presses(15.0)
    answers = 2.0 * force
    missing = np.zeros(len(TIME), bool)
    missing[1::2] = True
    missing[500:900] = True
    rig = read_rig(written(tmp_path, TIME, np.where(missing, np.nan, force), answers))
    (trial,) = rig.trials
    used = np.isfinite(trial.reading[:, 0])
    assert not used[500:900].any() and used[:499].all() and used[901:-1].all()
    np.testing.assert_allclose(trial.level[used], force[used], atol=3e-4)
    assert any("not used, because the stimulus is missing for too long" in said for said in rig.warnings)


def test_a_stimulus_without_a_response_beside_it_is_refused(tmp_path):
    time = np.arange(80) * 0.1
    path = written(tmp_path, time, np.where(time < 3, time, np.nan), np.where(time < 4, np.nan, time))
    with pytest.raises(PalpateError, match="No response in 'press.csv' has a stimulus at the same time"):
        read_rig(path)
