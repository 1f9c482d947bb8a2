# SPDX-License-Identifier: GPL-3.0-or-later
"""Terminal of the commands: progress bars, tables, Ctrl-C, and Blender's own output kept away."""

from __future__ import annotations

import argparse
import atexit
import ctypes
import functools
import os
import re
import shutil
import signal
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Any, NoReturn

from ..core import jobs as bars
from ..core.errors import PalpateError
from ..core.jobs import Job, Progress, Result, run_job
from ..core.jobs import progress_bar as progress_bar


class Interrupt:
    """Ctrl-C, which stops a command only where that is safe.

    An exception at an arbitrary moment would interrupt Blender's start, a handler or an import: Blender would print and ignore
    it, or continue half initialised. Therefore the first Ctrl-C is only noted, and :meth:`check`, called many times a second,
    raises the exception. A second Ctrl-C raises it at once.
    """

    pressed = False
    at_once = limits_at_once = False
    reason: PalpateError | None = None
    """Another reason to stop: a limit that is reached."""
    clean_up: Callable[[], object] = staticmethod(lambda: None)
    """Removes unfinished files of the call into Blender that runs now, before the process is ended in it."""

    @classmethod
    @contextmanager
    def noted(cls) -> Iterator[None]:
        """Note Ctrl-C while the body runs. A Blender without a window would only set a flag that nothing reads."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        cls.pressed = cls.at_once = False
        before = signal.signal(signal.SIGINT, cls._press)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)

    @classmethod
    @contextmanager
    def raised_at_once(cls, limits: bool = False) -> Iterator[None]:
        """Let Ctrl-C raise at once while the body runs: for work without Blender, whose files are written atomically.

        With `limits` a limit raises, too: for work that takes no error for one of a part of it.
        """
        cls.check()
        before = cls.at_once, cls.limits_at_once
        cls.at_once, cls.limits_at_once = True, limits
        try:
            yield
        finally:
            cls.at_once, cls.limits_at_once = before

    @classmethod
    def _press(cls, *_: object) -> None:
        cls.check()
        cls.pressed = True
        if cls.at_once:
            cls.check()

    @classmethod
    def check(cls) -> None:
        """Raise KeyboardInterrupt if Ctrl-C was pressed, and the other reason to stop if there is one."""
        if cls.pressed:
            raise KeyboardInterrupt
        if cls.reason is not None:
            raise cls.reason


@contextmanager
def blender_output_hidden() -> Iterator[None]:
    """Keep Blender's own output off the terminal while the body runs.

    Most of it is printed by C code, so the file descriptors themselves are redirected into a temporary file. It is printed if
    the body raises an unexpected error. Operators write to Python's `sys.stdout`, which is redirected as well. `sys.stderr`
    stays on the terminal, for progress bars.
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
        if _descriptor(sys.stderr) == 2:  # not where a test has replaced it
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
    """Keep Blender's message about its memory, printed when the process ends, off the terminal."""

    def silence() -> None:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and not stream.closed:
                stream.flush()
        _flush_c()
        null = os.open(os.devnull, os.O_WRONLY)
        for descriptor in (1, 2):
            os.dup2(null, descriptor)

    atexit.register(silence)


def end_process(status: int) -> NoReturn:
    """End the process as the interpreter does, but without taking Blender's module down.

    Blender 4.5 waits for ever there once it has compiled a driver that needs Python: its module is freed after the thread state
    that the drivers wait for. Threads are waited for, functions registered with :mod:`atexit` run, and output is flushed.
    """
    with suppress(ValueError):  # not the main thread
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading._shutdown()  # type: ignore[attr-defined]  # noqa: SLF001
    atexit._run_exitfuncs()  # noqa: SLF001
    _remove_blenders_folder()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # nobody reads it any more, or it is closed
            if stream is not None:
                stream.flush()
    with suppress(OSError):
        _flush_c()
    os._exit(status)


def _remove_blenders_folder() -> None:
    """Remove the temporary folder of this Blender, as it does itself when its module is freed."""
    bpy = sys.modules.get("bpy")
    folder = getattr(getattr(bpy, "app", None), "tempdir", "") or ""
    name = os.path.basename(os.path.normpath(folder))
    if re.fullmatch(r"blender_\w{6}", name):  # and not the folder of all programs
        shutil.rmtree(folder, ignore_errors=True)


def _flush_c() -> None:
    """Flush the buffers of C's streams, so that their content does not appear after a redirection has changed."""
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
    library.fflush(None)


def _descriptor(stream: Any) -> int | None:
    """Return the file descriptor of a stream; None if it has none."""
    try:
        return stream.fileno()
    except (AttributeError, OSError, ValueError):  # none, closed, or one that is not a file (io.UnsupportedOperation)
        return None


@contextmanager
def exit_on_interrupt(message: str, clean_up: Callable[[], object]) -> Iterator[None]:
    """Let Ctrl-C end the process during a call into Blender, such as a render.

    Python raises KeyboardInterrupt only after the call has returned, which can take a minute. But the signal handler writes to
    a socket at once. A thread that waits at this socket calls `clean_up`, prints `message` and exits with status 130.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    stderr = os.dup(2)

    def listen() -> None:
        if receiver.recv(1) == bytes([signal.SIGINT]):
            clean_up()
            _remove_blenders_folder()
            os.write(stderr, f"\n{message}\n".encode())
            os._exit(130)

    Interrupt.clean_up = clean_up
    before = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
    thread = threading.Thread(target=listen, daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        Interrupt.clean_up = staticmethod(lambda: None)
        sender.close()  # the thread reads the end of the stream and returns
        thread.join()
        receiver.close()
        os.close(stderr)


def shown_progress(
    label: str, unit: str = "step", describe: Callable[[Progress], str] = lambda progress: progress.stage
) -> AbstractContextManager[Callable[[Progress], None]]:
    """Give a function that shows progress as :func:`.jobs.shown_progress` does, and raises after Ctrl-C."""
    return bars.shown_progress(label, unit, describe, Interrupt.check)


def run_with_progress_bar(
    label: str, job: Job[Result], unit: str = "step", describe: Callable[[Progress], str] = lambda progress: progress.stage
) -> Result:
    """Run a job as :func:`shown_progress` shows it, and return its result; Ctrl-C cancels the job."""
    with shown_progress(label, unit, describe) as show:
        return run_job(job, show)


def text_table(rows: Sequence[Sequence[str]], align: str) -> str:
    """Return rows of cells as lines with aligned columns; `align` has "<" or ">" for each column."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(align))]
    lines = []
    for row in rows:
        cells = (f"{cell:{side}{width}}" for cell, side, width in zip(row, align, widths, strict=True))
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


COMMANDS = ("bake", "gap", "render", "export", "sweep")
"""Commands that take limits."""
INTERVAL = 0.1
"""Seconds between two looks at time and memory."""
GRACE = 5.0
"""Seconds in which a command may end by itself, so that its files are put away, before the process is ended."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--time-limit", metavar="SECONDS", type=_positive, help="stop with exit status 1 after this time (default: no limit)"
    )
    parser.add_argument(
        "--memory-limit",
        metavar="MB",
        type=_positive,
        help="stop with exit status 1 when the process holds more memory (default: no limit)",
    )


@contextmanager
def kept(arguments: argparse.Namespace) -> Iterator[None]:
    """Watch the limits of a command while the body runs.

    A thread looks at them. When one is reached, the next :meth:`Interrupt.check` raises the reason. A call that
    does not return soon enough, such as a render, is ended with the process.
    """
    if arguments.time_limit is None and arguments.memory_limit is None:
        yield
        return
    if arguments.memory_limit is not None:
        resident_memory()  # raises where it cannot be told
    over, prefix = threading.Event(), f"palpate {arguments.command}:"
    began, stderr = time.monotonic(), os.dup(2)

    def watch() -> None:
        while not over.wait(INTERVAL):
            reason = _reached(arguments, time.monotonic() - began)
            if reason:
                Interrupt.reason = PalpateError(reason)
                if Interrupt.limits_at_once:
                    signal.raise_signal(signal.SIGINT)  # as Ctrl-C does
                if not over.wait(GRACE):
                    with suppress(Exception):
                        Interrupt.clean_up()
                    with suppress(OSError):
                        os.write(stderr, f"{prefix} {reason}\n".encode())
                    os._exit(1)
                return

    thread = threading.Thread(target=watch, name="palpate limits", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
        Interrupt.reason = None
        os.close(stderr)


def resident_memory() -> float:
    """Return the memory that this process holds, in bytes; on macOS the most that it held so far.

    Raises
    ------
    PalpateError
        This system does not tell.
    """
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        pass
    try:
        import resource
    except ImportError as error:
        raise PalpateError("--memory-limit is not possible on this system: leave it out.") from error
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _reached(arguments: argparse.Namespace, elapsed: float) -> str:
    """Return a sentence about the limit that is reached; empty if none is."""
    if arguments.time_limit is not None and elapsed > arguments.time_limit:
        return f"The time limit of {arguments.time_limit:g} s is reached: raise --time-limit or give the command less to do."
    if arguments.memory_limit is not None and (held := resident_memory() / 1e6) > arguments.memory_limit:
        return (
            f"The memory limit of {arguments.memory_limit:g} MB is reached ({held:.0f} MB are in use): raise --memory-limit or "
            "give the command less to do."
        )
    return ""


def _positive(text: str) -> float:
    """Return the number in an option that must be finite and above zero."""
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a number above zero")
    return value
