# SPDX-License-Identifier: GPL-3.0-or-later
"""Kills a command at random moments, or stops a function at any of its steps, for tests of what is left behind.

::

    for kill in Kills([sys.executable, "-m", "palpate.commands", "bake", scene], cwd=folder, seed=1).repeat(20, restore):
        assert read(folder) in (earlier, new)
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import pytest

LONGEST = 300.0
"""Seconds after which a command counts as hung."""
POLL = 0.002
"""Seconds between two looks at a running command."""


STEPS = ("replace", "unlink", "rmdir", "mkdir")
"""Functions of :mod:`os` that change names in folders: what is found after a kill depends on which of them were called."""


class Stopped(BaseException):
    """The process was killed here."""


@contextmanager
def stopped_at(number: int, error: OSError | None = None) -> Iterator[list[str]]:
    """Let the call of this number of :data:`STEPS` fail in the body; yield the list of calls, which grows.

    Without an error this stands for a kill: all later calls fail as well, and the body ends by :class:`Stopped`. With an error
    that one call raises it, and the body handles it.
    """
    calls: list[str] = []

    def failing(name, original):
        def call(*arguments, **options):
            calls.append(f"{name} {arguments[0]}")
            if len(calls) == number and error is not None:
                raise error
            if len(calls) >= number and error is None:
                raise Stopped
            return original(*arguments, **options)

        return call

    with pytest.MonkeyPatch.context() as patch:
        for name in STEPS:
            patch.setattr(os, name, failing(name, getattr(os, name)))
        with suppress(Stopped):
            yield calls


@dataclass(frozen=True)
class Kill:
    """A kill of a command.

    Attributes
    ----------
    share : float
        Share of its work, between its beginning and its end, after which it was killed.
    was_running : bool
        False if the command had already ended.
    """

    share: float
    was_running: bool


def whole_group(process: subprocess.Popen) -> None:
    """Kill a process and all that it has started, as a machine that loses its power does."""
    if os.name == "nt":
        process.kill()
    else:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


class Kills:
    """Random kills of one command. The moments follow from the seed and from what an undisturbed run takes.

    Parameters
    ----------
    command : sequence of str
    seed : int
    began : callable, optional
        Returns True once the work has begun during which kills are of interest. Default: at once.
    kill : callable
        What is killed; default: the process and all that it has started.
    **options
        Of :class:`subprocess.Popen`, such as `cwd` and `env`.
    """

    def __init__(
        self,
        command: Sequence[str],
        seed: int,
        began: Callable[[], bool] = lambda: True,
        kill: Callable[[subprocess.Popen], None] = whole_group,
        **options,
    ):
        self._command, self._began, self._kill = list(command), began, kill
        self._dice = random.Random(seed)
        self._options = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, **options}
        self._seconds = 0.0

    def run(self) -> None:
        """Run the command undisturbed, and measure its work; raises AssertionError if it fails."""
        process = self._start()
        self._wait_for_work(process)
        began = time.monotonic()
        assert process.wait(LONGEST) == 0, f"{self._command} ended with status {process.returncode}"
        self._seconds = time.monotonic() - began

    def repeat(self, count: int, before: Callable[[], object] = lambda: None) -> Iterator[Kill]:
        """Call `before`, start the command and kill it, `count` times; yield each kill. :meth:`run` comes first.

        Raises
        ------
        AssertionError
            The command fails before it is killed.
        """
        assert self._seconds > 0.0, "run() measures how long the command works"
        for share in self._shares(count):
            before()
            process = self._start()
            self._wait_for_work(process)
            with suppress(subprocess.TimeoutExpired):
                process.wait(share * self._seconds)
            was_running = process.poll() is None
            assert was_running or process.returncode == 0, f"{self._command} ended with status {process.returncode}"
            self._kill(process)
            process.wait(LONGEST)
            yield Kill(share, was_running)

    def _shares(self, count: int) -> Iterable[float]:
        """Return random moments that are spread over the work: one in each of `count` equal parts, in random order."""
        shares = [(i + self._dice.random()) / count for i in range(count)]
        self._dice.shuffle(shares)
        return shares

    def _start(self) -> subprocess.Popen:
        return subprocess.Popen(self._command, start_new_session=True, **self._options)

    def _wait_for_work(self, process: subprocess.Popen) -> None:
        """Return once the command has begun its work, or has ended."""
        end = time.monotonic() + LONGEST
        while not self._began() and process.poll() is None:
            assert time.monotonic() < end, f"{self._command} does not begin"
            time.sleep(POLL)
