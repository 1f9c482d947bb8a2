# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile the solver before its first use, in another process, so that Blender's window stays usable and shows progress.

Meanwhile kernels are interpreted, which gives the same numbers slowly: small scenes are played and baked at once, and change
over to compiled code between two frames. Scenes whose frames would take too long wait. Without a window the solver is compiled
in place, with a line on stderr (:func:`load_solver`). Only the main thread touches Blender: a timer reads what
the other process wrote.
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
from typing import TYPE_CHECKING

import bpy

from ...core.jobs import Progress
from ...core.solver import precompile
from . import dependencies, session_state

if TYPE_CHECKING:
    from ...core.model.scenario import Scenario

STAGE = "Palpate is compiling its solver (first use only)"
SLOWLY = "Palpate computes slowly until its solver is compiled (first use only)"
USUAL_SECONDS = 40.0
"""How long the compiler usually takes beside a window that is in use; what the first seconds promise."""
COUNTED_SHARE = 0.8
"""Share of the compiler's time after which almost all functions are done: the last and largest take the rest (of 30 s, the
first 179 functions of 185 took 23.7 s)."""
MAX_START, MAX_FRAME = 3.0, 2.0
"""Scenes are computed by interpreted kernels if they are prepared and if each frame is computed within so many seconds, for
which the window does not answer."""
POLL_INTERVAL = 0.5
"""Seconds between two looks at the process."""


@dataclass
class _Compilation:
    """The process that compiles, the file that it writes to, when it started (monotonic clock), and what is known of its end.

    `share` is the part of its time that had passed when it last finished a function, `seconds` how long it may take in all, and
    `shown` the largest part that was shown: a bar never goes back.
    """

    process: subprocess.Popen
    log: Path
    started: float
    share: float = 0.0
    seconds: float = USUAL_SECONDS
    shown: float = 0.0

    def passed(self) -> float:
        """Return the part of the time that has passed, from 0 to 0.99; `share` is measured, and what follows it estimated."""
        now = time.monotonic() - self.started
        with suppress(OSError, ValueError, IndexError):  # nothing has been written yet
            written = json.loads(self.log.read_bytes().splitlines()[-1])
            share = COUNTED_SHARE * written["done"] / written["total"]
            if share > self.share:  # the first functions take longer than their share; the usual time counts for what is left
                self.share, self.seconds = share, now + (1.0 - share) * (now + (1.0 - share) * USUAL_SECONDS)
        self.seconds = max(self.seconds, now / 0.99)
        self.shown = max(self.shown, self.share, now / self.seconds)
        return self.shown


_compilation: _Compilation | None = None
_gave_up = False
_interprets = False
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


def can_compute(scenario: Scenario) -> bool:
    """Return True if a scenario can be computed now, by compiled kernels or, if it is small, by interpreted ones."""
    global _interprets
    begin()
    if is_ready():
        return True
    start, frame = precompile.interpreted_seconds(scenario)
    if start > MAX_START or frame > MAX_FRAME:
        return False
    _interprets = True
    return True


def begin() -> None:
    """Start to compile the solver, unless it is ready or being compiled."""
    global _compilation
    if is_ready() or _compilation is not None:
        return
    log = Path(tempfile.mkstemp(prefix="palpate-compiling-", suffix=".log", dir=bpy.app.tempdir or None)[1])
    package = dependencies.root_package()
    command = [sys.executable, "-I", str(precompile.PROCESS), package, json.dumps(sys.path)]
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
    passed = _compilation.passed()
    left = (1.0 - passed) * _compilation.seconds
    stage = f"{SLOWLY if _interprets else STAGE}, " + (f"about {left:.0f} s more" if left > 1.0 else "nearly done")
    return Progress(stage, round(1000 * passed), 1000)


def load_solver():
    """Import the solver, compile it if needed, and return the module :mod:`.simulation`.

    The first call after installation compiles for about half a minute. With a window open, a process compiles
    earlier, and kernels are interpreted meanwhile.
    """
    dependencies.choose_numba_cache()
    from ...core.compiled import kernels
    from ...core.solver import simulation

    if not is_ready():
        kernels.interpret_kernels()
    else:
        kernels.compile_kernels()
        precompile.compile_solver_with_notice()
    return simulation


def wait(scenario: Scenario | None = None) -> Generator[Progress, None, None]:
    """Yield progress until the solver is ready, or until `scenario`, if it is given, can be computed by interpreted kernels.

    Every job that uses the solver begins with this.
    """
    if scenario is not None and can_compute(scenario):
        return
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
    print(f"Palpate could not compile its solver in the background; it compiles at first use. {why}", file=sys.stderr)


def _poll() -> float | None:
    """Timer: show the progress."""
    _check()
    now = progress()
    if _compilation is None:
        return None
    _show(now and f"{now.stage} …")
    session_state.redraw_panels()
    if now is not None:
        return POLL_INTERVAL
    _change_over()
    for function in when_ready:
        function()
    return None


def _change_over() -> None:
    """Use compiled kernels from now on, if kernels were interpreted; a run goes on with its next frame."""
    global _interprets
    if _interprets:
        from ...core.compiled import kernels

        kernels.compile_kernels()
    _interprets = False


def _show(text: str | None) -> None:
    for manager in bpy.data.window_managers:
        for window in manager.windows:
            with bpy.context.temp_override(window=window):  # Blender crashes without one, as just after a timer opened a file
                window.workspace.status_text_set(text)


def stop() -> None:
    """End the process, because the add-on is being disabled or Blender closes. What was compiled is kept for the next time."""
    global _compilation, _gave_up
    compilation, _compilation, _gave_up = _compilation, None, False
    _change_over()
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
