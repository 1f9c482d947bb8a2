# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver's first use: it is compiled in a process beside the window, which says how far that is and stays usable.

Without a window it is compiled in place, with a line on stderr (:func:`.dependencies.solver`). Nothing of Blender is touched
from outside the main thread: a timer looks at what the other process wrote.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.jobs.progress import Progress
from ...core.solver import precompile, precompile_process
from . import dependencies, redraw

STAGE = "Palpate is preparing its solver (first use only)"
LOOK = 0.5
"""Seconds between two looks at the process."""


@dataclass
class _Work:
    """The process, where it writes, and since when it runs."""

    process: subprocess.Popen
    log: Path
    began: float


_work: _Work | None = None
_gave_up = False
when_ready: list[Callable[[], None]] = []
"""Called in the main thread once the solver is ready."""


def has_window() -> bool:
    """Whether somebody looks at a window."""
    return not bpy.app.background


def is_ready() -> bool:
    """Whether the solver can be used now. Without a window always, because nobody is kept waiting at one."""
    if _gave_up or not has_window():
        return True
    dependencies.prepare_numba()
    return not precompile.is_needed()


def begin() -> None:
    """Start preparing the solver unless it is ready or being prepared."""
    global _work
    if is_ready() or _work is not None:
        return
    log = Path(tempfile.mkstemp(prefix="palpate-compiling-", suffix=".log", dir=bpy.app.tempdir or None)[1])
    package = dependencies.root_package()
    command = [sys.executable, "-I", precompile_process.__file__, package, json.dumps(sys.path)]
    try:
        with log.open("wb") as out:
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,  # closed when Blender ends, in whatever way; then the process ends as well
                stdout=out,
                stderr=subprocess.STDOUT,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
    except OSError as error:
        _give_up(str(error))
        return
    _work = _Work(process, log, time.monotonic())
    bpy.app.timers.register(_watch, first_interval=LOOK, persistent=True)


def progress() -> Progress | None:
    """Return how far preparing is; None when it does not go on."""
    if _work is None or is_ready():
        return None
    with suppress(OSError, ValueError, IndexError):  # nothing is written yet
        said = json.loads(_work.log.read_bytes().splitlines()[-1])
        return Progress(_stage(f"{said['done']} of {said['total']} parts, "), said["done"], said["total"])
    return Progress(_stage(""), 0, 1)


def _stage(parts: str) -> str:
    assert _work is not None
    return f"{STAGE}: {parts}{time.monotonic() - _work.began:.0f} s"


def wait() -> Generator[Progress, None, None]:
    """Yield progress until the solver is ready: the first part of every job that uses it."""
    begin()
    while (now := progress()) is not None:
        _check()
        yield now
        time.sleep(0.05)  # there is nothing to do here but to wait


def _check() -> None:
    """Notice that the process ended without having done it."""
    if _work is not None and _work.process.poll() is not None and not is_ready():
        _give_up(_work.log.read_text(encoding="utf-8", errors="replace")[-2000:])


def _give_up(why: str) -> None:
    """Let the solver be compiled where it is first used: the window stands still meanwhile, but the result is the same."""
    global _gave_up
    _gave_up = True
    print(f"Palpate could not prepare its solver beside the window; it does so at first use. {why}", file=sys.stderr)


def _watch() -> float | None:
    """Timer: show how far it is."""
    _check()
    now = progress()
    if _work is None:
        return None
    _show(now and f"{now.stage} …")
    redraw.panels()
    if now is not None:
        return LOOK
    for function in when_ready:
        function()
    return None


def _show(text: str | None) -> None:
    for manager in bpy.data.window_managers:
        for window in manager.windows:
            window.workspace.status_text_set(text)


def stop() -> None:
    """End the process, because the add-on is being disabled or Blender closes. The next time it goes on where it was."""
    global _work, _gave_up
    work, _work, _gave_up = _work, None, False
    if work is None:
        return
    work.process.kill()
    work.process.wait()
    work.process.stdin.close()
    with suppress(OSError):
        os.unlink(work.log)
    if bpy.app.timers.is_registered(_watch):
        bpy.app.timers.unregister(_watch)
        _show(None)
