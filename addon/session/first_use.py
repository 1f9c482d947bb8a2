# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile the solver before its first use, in another process, so that Blender's window stays usable and shows progress.

Without a window the solver is compiled in place, with a line on stderr (:func:`.dependencies.load_solver`). Only the main
thread touches Blender: a timer reads what the other process wrote.
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
POLL_INTERVAL = 0.5
"""Seconds between two looks at the process."""


@dataclass
class _Compilation:
    """The process that compiles, the file that it writes to, and when it started (monotonic clock)."""

    process: subprocess.Popen
    log: Path
    started: float


_compilation: _Compilation | None = None
_gave_up = False
when_ready: list[Callable[[], None]] = []
"""Called in the main thread when the solver is ready."""


def has_window() -> bool:
    """Return True unless Blender runs in the background."""
    return not bpy.app.background


def is_ready() -> bool:
    """Return True if the solver can be used now. Without a window always: then nobody waits at one."""
    if _gave_up or not has_window():
        return True
    dependencies.choose_numba_cache()
    return not precompile.is_needed()


def begin() -> None:
    """Start to compile the solver, unless it is ready or being compiled."""
    global _compilation
    if is_ready() or _compilation is not None:
        return
    log = Path(tempfile.mkstemp(prefix="palpate-compiling-", suffix=".log", dir=bpy.app.tempdir or None)[1])
    package = dependencies.root_package()
    command = [sys.executable, "-I", precompile_process.__file__, package, json.dumps(sys.path)]
    try:
        with log.open("wb") as out:
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,  # it is closed whenever Blender ends; then the process ends too
                stdout=out,
                stderr=subprocess.STDOUT,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
    except OSError as error:
        _give_up(str(error))
        return
    _compilation = _Compilation(process, log, time.monotonic())
    bpy.app.timers.register(_poll, first_interval=POLL_INTERVAL, persistent=True)


def progress() -> Progress | None:
    """Return the progress of compiling; None when no compilation runs."""
    if _compilation is None or is_ready():
        return None
    with suppress(OSError, ValueError, IndexError):  # nothing has been written yet
        written = json.loads(_compilation.log.read_bytes().splitlines()[-1])
        return Progress(_stage(f"{written['done']} of {written['total']} parts, "), written["done"], written["total"])
    return Progress(_stage(""), 0, 1)


def _stage(parts: str) -> str:
    assert _compilation is not None
    return f"{STAGE}: {parts}{time.monotonic() - _compilation.started:.0f} s"


def wait() -> Generator[Progress, None, None]:
    """Yield progress until the solver is ready. Every job that uses the solver begins with this."""
    begin()
    while (now := progress()) is not None:
        _check()
        yield now
        time.sleep(0.05)  # nothing else can be done here


def _check() -> None:
    """Give up if the process ended without having compiled the solver."""
    if _compilation is not None and _compilation.process.poll() is not None and not is_ready():
        _give_up(_compilation.log.read_text(encoding="utf-8", errors="replace")[-2000:])


def _give_up(why: str) -> None:
    """Compile the solver where it is first used: the window is blocked meanwhile, but the result is the same."""
    global _gave_up
    _gave_up = True
    print(f"Palpate could not prepare its solver beside the window; it does so at first use. {why}", file=sys.stderr)


def _poll() -> float | None:
    """Timer: show the progress."""
    _check()
    now = progress()
    if _compilation is None:
        return None
    _show(now and f"{now.stage} …")
    redraw.panels()
    if now is not None:
        return POLL_INTERVAL
    for function in when_ready:
        function()
    return None


def _show(text: str | None) -> None:
    for manager in bpy.data.window_managers:
        for window in manager.windows:
            window.workspace.status_text_set(text)


def stop() -> None:
    """End the process, because the add-on is being disabled or Blender closes. What was compiled is kept for the next time."""
    global _compilation, _gave_up
    compilation, _compilation, _gave_up = _compilation, None, False
    if compilation is None:
        return
    compilation.process.kill()
    compilation.process.wait()
    compilation.process.stdin.close()
    with suppress(OSError):
        os.unlink(compilation.log)
    if bpy.app.timers.is_registered(_poll):
        bpy.app.timers.unregister(_poll)
        _show(None)
