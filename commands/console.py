# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands print, kept apart from what Blender prints."""

from __future__ import annotations

import atexit
import ctypes
import functools
import os
import signal
import socket
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from ..core.errors import PalpateError
from ..core.jobs.job_runner import run_job
from ..core.jobs.progress import Job, Progress, Result


class Interrupt:
    """Ctrl-C, noticed where it is safe to stop.

    An exception that comes out of nowhere would hit Blender's start, its handlers or an import half-way: Blender prints and
    forgets it, or goes on with half of itself. So the first Ctrl-C is only noted, and :meth:`check` acts on it, many times a
    second; a second one insists.
    """

    pressed = False

    @classmethod
    @contextmanager
    def noted(cls) -> Iterator[None]:
        """Note Ctrl-C. Inside a Blender without a window it would only set a flag that nobody here looks at."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        cls.pressed = False
        before = signal.signal(signal.SIGINT, cls._press)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)

    @classmethod
    def _press(cls, *_) -> None:
        cls.check()
        cls.pressed = True

    @classmethod
    def check(cls) -> None:
        """Raise KeyboardInterrupt when Ctrl-C was pressed."""
        if cls.pressed:
            raise KeyboardInterrupt


@contextmanager
def blender_output_hidden() -> Iterator[None]:
    """Keep Blender's own words off the terminal while it works.

    Most come from C, so the descriptors themselves are turned away, into a file that nobody sees unless something unexpected
    happens: then it is printed with the traceback. Operators write to Python's `sys.stdout`, which goes the same way; only
    `sys.stderr` stays on the terminal, for progress bars.
    """
    with tempfile.TemporaryFile() as kept:
        before = sys.stdout, sys.stderr
        for stream in before:
            if stream is not None:
                stream.flush()
        _flush_c()
        saved = [os.dup(descriptor) for descriptor in (1, 2)]
        opened = [os.fdopen(os.dup(kept.fileno()), "w", encoding="utf-8", errors="replace", buffering=1)]
        sys.stdout = opened[0]
        if _descriptor(sys.stderr) == 2:  # one that a test has put there is not in Blender's way
            opened.append(os.fdopen(os.dup(2), "w", encoding=sys.stderr.encoding, errors="replace", buffering=1))
            sys.stderr = opened[1]
        for descriptor in (1, 2):
            os.dup2(kept.fileno(), descriptor)
        unexpected = False
        try:
            yield
        except (PalpateError, KeyboardInterrupt, SystemExit):
            raise
        except BaseException:
            unexpected = True
            raise
        finally:
            _flush_c()
            sys.stdout, sys.stderr = before
            for stream in opened:
                stream.close()
            for descriptor, copy in zip((1, 2), saved, strict=True):
                os.dup2(copy, descriptor)
                os.close(copy)
            if unexpected:
                kept.seek(0)
                os.write(2, kept.read()[-20000:])


@functools.cache
def silence_at_exit() -> None:
    """Keep what Blender says about its own memory after everything is done off the terminal."""

    def hush() -> None:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and not stream.closed:
                stream.flush()
        _flush_c()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for descriptor in (1, 2):
            os.dup2(nowhere, descriptor)

    atexit.register(hush)


def _flush_c() -> None:
    """Empty the buffers of C's streams, which would otherwise end up on the other side of a redirection."""
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
    library.fflush(None)


def _descriptor(stream) -> int | None:
    try:
        return stream.fileno()
    except (AttributeError, OSError, ValueError):  # none, closed, or one that is not a file (io.UnsupportedOperation)
        return None


@contextmanager
def exit_on_interrupt(words: str, clean_up: Callable[[], object]) -> Iterator[None]:
    """Let Ctrl-C end the process in the middle of a call into Blender, a render above all.

    Python tells of an interrupt only once the call has returned, a minute later. Its signal handler writes to a socket at once,
    though, and a thread that waits there tidies up, prints `words` and leaves with status 130.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ear, mouth = socket.socketpair()
    mouth.setblocking(False)
    stderr = os.dup(2)

    def listen() -> None:
        if ear.recv(1) == bytes([signal.SIGINT]):
            clean_up()
            os.write(stderr, f"\n{words}\n".encode())
            os._exit(130)

    before = signal.set_wakeup_fd(mouth.fileno(), warn_on_full_buffer=False)
    thread = threading.Thread(target=listen, daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        mouth.close()  # the thread reads the end and returns
        thread.join()
        ear.close()
        os.close(stderr)


def progress_bar(label: str, total: int, unit: str = "frame"):
    """Return a tqdm bar on stderr, which shows nothing where stderr is not a terminal."""
    from tqdm import tqdm

    return tqdm(total=total, desc=label, unit=unit, file=sys.stderr, leave=False, disable=None, dynamic_ncols=True)


def run_with_progress_bar(
    label: str, job: Job[Result], unit: str = "step", describe: Callable[[Progress], str] = lambda progress: progress.stage
) -> Result:
    """Run a job with a progress bar on stderr and return its result; Ctrl-C cancels the job.

    Parameters
    ----------
    label : str
        Before the first progress.
    job : Job
    unit : str
        What the job counts.
    describe : callable, optional
        Makes the words beside the bar out of a :class:`.Progress`; the default is its stage.
    """
    with progress_bar(label, 1, unit) as bar:

        def show(progress: Progress) -> None:
            Interrupt.check()
            bar.total = progress.total
            bar.set_description(describe(progress), refresh=False)
            bar.update(progress.done - bar.n)

        return run_job(job, show)


def text_table(rows: Sequence[Sequence[str]], align: str) -> str:
    """Return rows of words as lines with even columns; `align` has "<" or ">" for each column."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(align))]
    lines = []
    for row in rows:
        cells = (f"{cell:{side}{width}}" for cell, side, width in zip(row, align, widths, strict=True))
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
