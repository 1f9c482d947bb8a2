# SPDX-License-Identifier: GPL-3.0-or-later
"""A job is run to its end or cancelled, and cleans up in both cases, however it is run."""

from dataclasses import replace

import pytest

from palpate.core import jobs
from palpate.core.jobs import Progress, SlicedJob, part_of_job, run_job


class Work:
    """Counts to `total`; notes whether it was ended in order."""

    def __init__(self, total=5):
        self.total, self.cleaned = total, False

    def job(self):
        try:
            for i in range(self.total):
                yield Progress("Counting", i + 1, self.total, frame=10 + i)
            return "counted"
        finally:
            self.cleaned = True


def test_progress_in_words_and_as_a_share():
    assert Progress("Reading", 1, 4).text == "Reading"
    assert Progress("Reading", 1, 4, 7).text == "Reading: frame 7"
    assert Progress("Reading", 1, 4).share == 0.25


def test_a_job_runs_to_its_end():
    work, seen = Work(), []
    assert run_job(work.job(), seen.append) == "counted"
    assert [step.done for step in seen] == [1, 2, 3, 4, 5] and work.cleaned


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_whoever_watches_can_cancel(error):
    work = Work()

    def stop(progress):
        if progress.done == 3:
            raise error

    with pytest.raises(error):
        run_job(work.job(), stop)
    assert work.cleaned


def test_a_sliced_job_goes_on_where_it_was():
    work = Work()
    sliced = SlicedJob(work.job())
    sliced.work(0.0)
    assert (sliced.progress.done, sliced.is_done, sliced.result) == (1, False, None)
    sliced.work(60.0)
    assert (sliced.progress.done, sliced.is_done, sliced.result) == (5, True, "counted")
    sliced.work(60.0)
    assert sliced.result == "counted"


@pytest.mark.parametrize(("pause", "steps"), [(0.0, 2), (0.55, 9), (20.0, 80)])
def test_a_slice_is_as_long_as_the_pause_before_it(pause, steps, monkeypatch):
    """Within 0.1 and 5 s, in steps of 1/16 s, so that a window that draws slowly does not draw most of the time."""
    now = 0.0

    def job():
        nonlocal now
        for i in range(1000):
            now += 1 / 16
            yield Progress("Counting", i + 1, 1000)

    monkeypatch.setattr(jobs.time, "monotonic", lambda: now)
    sliced = SlicedJob(job())
    sliced.work(0.0)
    now += pause
    sliced.work()
    assert sliced.progress.done == 1 + steps


def test_a_sliced_job_is_cancelled_once_and_for_all():
    work = Work()
    sliced = SlicedJob(work.job())
    sliced.work(0.0)
    sliced.cancel()
    assert sliced.is_done and work.cleaned and sliced.result is None
    sliced.work(60.0)
    assert sliced.progress.done == 1


def test_a_part_reports_as_its_whole_and_ends_with_it():
    parts = Work(), Work()

    def whole():
        first = yield from part_of_job(parts[0].job(), lambda step: replace(step, total=10))
        second = yield from part_of_job(parts[1].job(), lambda step: replace(step, done=5 + step.done, total=10))
        return first, second

    seen = []
    assert run_job(whole(), seen.append) == ("counted", "counted")
    assert [step.done for step in seen] == list(range(1, 11)) and {step.total for step in seen} == {10}
    parts = Work(), Work()
    job = whole()
    next(job)
    job.close()
    assert parts[0].cleaned
