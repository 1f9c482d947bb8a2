# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work with progress and cancelling.

Long work is a job: a generator that yields :class:`.progress.Progress` and returns its result. Closing it cancels the job,
which then removes what it has begun. The functions of :mod:`.job_runner` run a job in one go or a slice at a time.
"""

__all__ = ["job_runner", "progress", "progress_bar"]
