# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands and short programs that tests run in processes of their own."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable

PALPATE = [sys.executable, "-m", "palpate.commands"]
"""Begins the command line of every command."""


def palpate(*words: object, **more: object) -> subprocess.CompletedProcess:
    """Run a command of palpate."""
    return _run([*PALPATE, *map(str, words)], more)


def python(code: str, *words: object, **more: object) -> subprocess.CompletedProcess:
    """Run a program in Python."""
    return _run([sys.executable, "-c", code, *map(str, words)], more)


def interrupted(
    command: list[str], has_begun: Callable[[subprocess.Popen], bool], pause: float = 0.0, **more: object
) -> tuple[tuple[int, str, str], float]:
    """Press Ctrl-C some time after a command has begun; return its status, what it says, and the seconds until its end."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more)
    end = time.monotonic() + 120.0
    while process.poll() is None and not has_begun(process) and time.monotonic() < end:
        time.sleep(0.02)
    time.sleep(pause)
    pressed = time.monotonic()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=120)
    return (process.returncode, out, err), time.monotonic() - pressed


def _run(command: list[str], more: dict[str, object]) -> subprocess.CompletedProcess:
    return subprocess.run(command, **{"capture_output": True, "text": True, "timeout": 120, **more})
