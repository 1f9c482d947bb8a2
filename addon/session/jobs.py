# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work is a generator that yields Progress; this drives it beside Blender's window, :mod:`.job_runner` in one go."""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import dataclass

PATIENCE = 0.1  # seconds of work between two looks at the keyboard


@dataclass(frozen=True)
class Progress:
    """`done` of `total` steps; `stage` says in words what is being done, `frame` at which frame, where it is one."""

    stage: str
    frame: int | None
    done: int
    total: int

    @property
    def text(self) -> str:
        """For people."""
        return self.stage if self.frame is None else f"{self.stage}: frame {self.frame}"


Job = Generator[Progress, None, object]


class Slice:
    """A job that is run a little at a time.

    Attributes
    ----------
    is_done : bool
    result : object
        What the job returned, once it is done.
    progress : Progress or None
        The last one.
    """

    def __init__(self, job: Job):
        self._job = job
        self.is_done = False
        self.result = None
        self.progress: Progress | None = None

    def work(self, patience: float = PATIENCE) -> None:
        """Go on until the patience is over, at least one step."""
        end = time.monotonic() + patience
        while not self.is_done:
            try:
                self.progress = next(self._job)
            except StopIteration as stop:
                self.is_done, self.result = True, stop.value
            if time.monotonic() >= end:
                return

    def cancel(self) -> None:
        """Stop the job, which cleans up after itself."""
        self._job.close()
        self.is_done = True
