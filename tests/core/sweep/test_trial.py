# SPDX-License-Identifier: GPL-3.0-or-later
"""What a dry run says of the time that a study takes."""

import pytest
from small_study import write_study

from palpate.sweep import trial
from palpate.sweep.study_folder import begin_study
from palpate.sweep.trial import Estimate, try_runs
from palpate.sweep.worker import NO_LIMITS


def test_the_time_of_a_study_counts_start_and_report():
    found = Estimate(seconds=0.5, size=1.0, failures=[], tried=5, start=3.0, closing=2.0, closing_each=0.01)
    assert found.seconds_of(1, 8) == pytest.approx(3.0 + 0.5 + 2.0)  # seven of the workers have nothing to do
    assert found.seconds_of(101, 2) == pytest.approx(3.0 + 25.25 + 2.0 + 1.0)


@pytest.mark.slow("starts a cluster, and the process of a worker")
def test_a_trial_measures_start_and_report(tmp_path, monkeypatch):
    monkeypatch.setattr(trial, "QUICK_SECONDS", 100.0)  # on a busy machine, too
    opened = begin_study(write_study(tmp_path, 20), tmp_path / "out", lambda *_: None)
    found = try_runs(opened.folder, opened.runs, NO_LIMITS, workers=1)
    assert (found.tried, found.failures) == (20, [])  # and not five, because they are short
    assert found.closing_each > 0.0
    # Loading the solver takes longer than a run of some milliseconds, and so does a report with its figures.
    assert found.start > found.seconds and found.closing > found.seconds
    assert found.seconds_of(20, 1) > found.start + 20 * found.seconds + found.closing - 1e-9
    assert not list((opened.folder / "runs").iterdir())
