# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work with progress and cancelling.

Long work is a job: a generator that yields :class:`Progress` and returns its result. Closing it cancels the job, which then
removes what it has begun. A job runs in one go, a slice at a time, or as a part of another job.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, TypeVar


@dataclass(frozen=True)
class Progress:
    """How far a job has come.

    Attributes
    ----------
    stage : str
        What the job is doing, in words for the user.
    done, total : int
        Steps that are done, and all steps.
    frame : int or None
        The frame that the job is at, where it goes through frames.
    """

    stage: str
    done: int
    total: int
    frame: int | None = None

    @property
    def share(self) -> float:
        """The part of the job that is done, from zero to one."""
        return self.done / self.total

    @property
    def text(self) -> str:
        """The stage, with the frame where there is one."""
        return self.stage if self.frame is None else f"{self.stage}: frame {self.frame}"


Result = TypeVar("Result")
Job = Generator[Progress, None, Result]
"""Work that yields its progress and returns its result; closing it cancels the work."""


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


def progress_bar(label: str, total: int | None, unit: str = "frame") -> Any:
    """Return a bar of tqdm, a count without a total: a widget in notebooks that have them, else on a terminal, else none."""
    if "ipykernel" in sys.modules:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # without ipywidgets the bar is text, which needs no advice
            from tqdm.auto import tqdm
        return tqdm(total=total, desc=label, unit=unit, leave=False)
    from tqdm import tqdm

    return tqdm(total=total, desc=label, unit=unit, file=sys.stderr, leave=False, disable=None, dynamic_ncols=True)


@contextmanager
def shown_progress(
    label: str,
    unit: str = "step",
    describe: Callable[[Progress], str] = lambda progress: progress.stage,
    check: Callable[[], object] = lambda: None,
) -> Iterator[Callable[[Progress], None]]:
    """Give a function that shows the progress of a job as a bar.

    Parameters
    ----------
    label : str
        Before the first progress.
    unit : str
        What the job counts.
    describe : callable
        Makes the words beside the bar out of a :class:`.Progress`; the default is its stage.
    check : callable
        Called with each progress, and may raise to stop the job.
    """
    with progress_bar(label, 1, unit) as bar:

        def show(progress: Progress) -> None:
            check()
            bar.total = progress.total
            bar.set_description(describe(progress), refresh=False)
            bar.update(progress.done - bar.n)

        yield show
