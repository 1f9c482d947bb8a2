# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work is a generator that yields its progress; this runs one in a plain loop."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TypeVar

P = TypeVar("P")
R = TypeVar("R")


def drive(job: Generator[P, None, R], on_progress: Callable[[P], None] | None = None) -> R:
    """Run a job to its end and return its result; an exception, Ctrl-C as well, closes it."""
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
