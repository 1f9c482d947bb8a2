# SPDX-License-Identifier: GPL-3.0-or-later
"""A thread that writes files while the solver computes the next frame."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

MAX_WAITING_TASKS = 8
"""Tasks that may wait. Each keeps its images in memory, so that a slow disk has to slow the solver down."""


class BackgroundWriter:
    """A thread that executes tasks in the order of their submission. An error in a task is raised by the next call."""

    def __init__(self):
        self._tasks: queue.Queue[Callable[[], None] | None] = queue.Queue(MAX_WAITING_TASKS)
        self._error: BaseException | None = None
        self._stopped = False
        self._thread: threading.Thread | None = None

    def submit(self, task: Callable[[], None]) -> None:
        """Add a task; block while :data:`MAX_WAITING_TASKS` are waiting."""
        self._raise_error()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="palpate-writer", daemon=True)
            self._thread.start()
        self._tasks.put(task)

    def finish(self) -> None:
        """Return once all submitted tasks are done."""
        self._tasks.join()
        self._raise_error()

    def stop(self) -> None:
        """Drop the waiting tasks, let the current one end, and end the thread. Raise nothing."""
        self._stopped = True
        if self._thread is not None:
            self._tasks.put(None)
            self._thread.join()
            self._thread = None

    def _run(self) -> None:
        """Execute tasks until None is submitted; after an error only take them off the queue."""
        while True:
            task = self._tasks.get()
            try:
                if task is None:
                    return
                if self._error is None and not self._stopped:
                    task()
            except BaseException as error:  # kept for the thread that submits or finishes
                self._error = error
            finally:
                self._tasks.task_done()

    def _raise_error(self) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error
