# SPDX-License-Identifier: GPL-3.0-or-later
"""Run jobs of core to their end, with a progress bar where the caller wants one."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from ..core.jobs import Job, Progress, Result, run_job, shown_progress

ShowProgress = bool | Callable[[Progress], None]
"""True for a bar in a terminal or notebook, False for none, or a function that is called with each :class:`.Progress`."""


def shown(progress: ShowProgress, label: str, unit: str = "step") -> AbstractContextManager[Callable[[Progress], None]]:
    """Give a function that shows progress as the caller wants it."""
    if callable(progress):
        return nullcontext(progress)
    return shown_progress(label, unit) if progress else nullcontext(lambda step: None)


def finished(job: Job[Result], progress: ShowProgress, label: str, unit: str = "step") -> Result:
    """Run a job and return its result. An interrupt, as Ctrl-C, cancels the job, which removes what it has begun."""
    with shown(progress, label, unit) as show:
        return run_job(job, show)


def prepare_solver() -> None:
    """Compile the solver at its first use, and say so: it takes about a minute."""
    from ..core.solver import precompile

    precompile.compile_solver_with_notice()
