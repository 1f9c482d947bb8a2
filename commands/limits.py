# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits of time and memory that a batch gives a command."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from ..core.errors import PalpateError
from . import console

COMMANDS = ("bake", "gap", "render", "export", "sweep")
"""Commands that take limits."""
INTERVAL = 0.1
"""Seconds between two looks at time and memory."""
GRACE = 5.0
"""Seconds in which a command may end by itself, so that its files are put away, before the process is ended."""


class LimitReached(PalpateError):
    """A limit of time or memory that the user gave was reached."""


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

    A thread looks at them. When one is reached, the next :meth:`.console.Interrupt.check` raises :class:`LimitReached`. A call
    that does not return soon enough, such as a render, is ended with the process.
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
                console.Interrupt.reason = LimitReached(reason)
                if not over.wait(GRACE):
                    with suppress(Exception):
                        console.Interrupt.clean_up()
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
        console.Interrupt.reason = None
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
