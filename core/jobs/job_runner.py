# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a job to its end, a slice at a time, or as a part of another job."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Generic

from .progress import Job, Progress, Result

SLICE = 0.1
"""Seconds of work between two looks at the keyboard, where the window draws quickly."""
LONGEST_SLICE = 5.0
"""Seconds of work at most, where the window draws slowly: as long as it draws, so that drawing takes half of the time."""


def run_job(job: Job[Result], on_progress: Callable[[Progress], None] | None = None) -> Result:
    """Run a job to its end and return its result.

    Parameters
    ----------
    job : Job
    on_progress : callable, optional
        Called with each :class:`.Progress`. An exception that it raises, KeyboardInterrupt included, cancels the job.
    """
    try:
        while True:
            try:
                progress = next(job)
            except StopIteration as stop:
                return stop.value
            if on_progress is not None:
                on_progress(progress)
    finally:
        job.close()


def part_of_job(job: Job[Result], change: Callable[[Progress], Progress]) -> Job[Result]:
    """Return a job as a part of a longer one: `change` makes the longer job's progress out of the part's.

    Use it as ``result = yield from part_of_job(job, change)``.
    """
    try:
        while True:
            try:
                progress = next(job)
            except StopIteration as stop:
                return stop.value
            yield change(progress)
    finally:
        job.close()


class SlicedJob(Generic[Result]):
    """A job that is run a little at a time, beside a window that stays responsive.

    Parameters
    ----------
    job : Job

    Attributes
    ----------
    is_done : bool
        True after the end and after :meth:`cancel`.
    result : object
        What the job returned; None before its end.
    progress : Progress or None
        The last one.
    """

    def __init__(self, job: Job[Result]):
        self._job = job
        self.is_done = False
        self.result: Result | None = None
        self.progress: Progress | None = None
        self._rested_since = time.monotonic()

    def work(self, seconds: float | None = None) -> None:
        """Run at least one step, and more until this time has passed; by default as long as the pause since the last slice.

        That time is at least :data:`SLICE` and at most :data:`LONGEST_SLICE`.
        """
        begin = time.monotonic()
        if seconds is None:
            seconds = min(max(begin - self._rested_since, SLICE), LONGEST_SLICE)
        while not self.is_done:
            try:
                self.progress = next(self._job)
            except StopIteration as stop:
                self.is_done, self.result = True, stop.value
            if time.monotonic() >= begin + seconds:
                break
        self._rested_since = time.monotonic()

    def cancel(self) -> None:
        """Stop the job, which removes what it has begun."""
        self._job.close()
        self.is_done = True
