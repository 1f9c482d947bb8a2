# SPDX-License-Identifier: GPL-3.0-or-later
"""Work that goes on behind the solver's back: files are written by a thread of their own while the next frame is computed."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

MAX_WAITING_TASKS = 8
"""Tasks that may wait: what they hold stays in memory, so a slow disk slows the solver down in the end."""


class BackgroundWriter:
    """Does tasks one after the other, in order, in a thread. What goes wrong is raised by the next call."""

    def __init__(self):
        self._tasks: queue.Queue[Callable[[], None] | None] = queue.Queue(MAX_WAITING_TASKS)
        self._error: BaseException | None = None
        self._stopped = False
        self._thread: threading.Thread | None = None

    def submit(self, task: Callable[[], None]) -> None:
        """Add a task; waits when too many wait already."""
        self._raise()
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="palpate-writer", daemon=True)
            self._thread.start()
        self._tasks.put(task)

    def finish(self) -> None:
        """Return when all that was added is done."""
        self._tasks.join()
        self._raise()

    def stop(self) -> None:
        """Drop what waits, let what is being done end, and end the thread; nothing is raised."""
        self._stopped = True
        if self._thread is not None:
            self._tasks.put(None)
            self._thread.join()
            self._thread = None

    def _work(self) -> None:
        while True:
            task = self._tasks.get()
            try:
                if task is None:
                    return
                if self._error is None and not self._stopped:
                    task()
            except BaseException as error:  # for the thread that waits for it
                self._error = error
            finally:
                self._tasks.task_done()

    def _raise(self) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error
