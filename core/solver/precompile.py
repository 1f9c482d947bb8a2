# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile the solver before it is needed: a tiny scene is solved once, and numba keeps what it compiled.

That takes half a minute, once for each version; a second where the extension carries machine code for the processor. While
Blender's window is open a process of its own does it (:func:`main`): a thread would share the interpreter with the window, and
could not be stopped when Blender closes. Meanwhile small scenes are computed by interpreted kernels, which give the same
numbers (:func:`interpreted_seconds`).
"""

from __future__ import annotations

import gc
import importlib.metadata
import json
import os
import platform
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from ..compiled.kernel_fingerprint import fingerprint

if TYPE_CHECKING:
    from ..model.scenario import Scenario

Report = Callable[[int, int], None]

PROCESS = Path(__file__).with_name("precompile_process.py")
"""The program that compiles in a process of its own."""
INTERPRETED_POINT = 1.2e-5
"""Seconds in which interpreted kernels compute one step of one contact point, if a fifth of the points touch something.

Measured: 6e-5 for points that touch something (the demo takes 0.4 s for a frame, 42 steps of 168 points), and 2.6 s for a frame
of 300 steps of a ball and a cube on 441 points, for which this says 3.2 s.
"""
INTERPRETED_TRIANGLE = 2e-4
"""Seconds in which interpreted kernels prepare one triangle of a target."""

_lock = threading.Lock()
_done = False


def cache_folder() -> Path:
    """Return where numba keeps what it compiles: what ``NUMBA_CACHE_DIR`` says, otherwise beside the source."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    return Path(chosen) if chosen else Path(__file__).parent / "__pycache__"


def completion_file() -> Path:
    """Return the file that says that these kernels were compiled, by this numba for this Python and processor."""
    python = f"{sys.implementation.cache_tag}-{platform.machine()}"
    return cache_folder() / f"palpate-{fingerprint()}-numba-{_numba()}-{python}.compiled"


@cache
def _numba() -> str:
    return importlib.metadata.version("numba")


def is_needed() -> bool:
    """True when the solver's first run would have to wait for the compiler. This imports nothing heavy."""
    if _done or os.environ.get("PALPATE_NUMBA", "1") == "0":
        return False
    try:
        return not completion_file().is_file()
    except importlib.metadata.PackageNotFoundError:  # in plain Python nothing is compiled
        return False


def compile_solver(report: Report = lambda done, total: None) -> None:
    """Compile everything that the solver needs, and note that it is done.

    Parameters
    ----------
    report : callable(done, total)
        Called now and then, from another thread, with how many functions are compiled.
    """
    global _done
    with _lock:
        if _done:
            return
        from ..compiled import machine_code
        from ..compiled.kernels import KERNELS, are_interpreted
        from .simulation import Simulation  # which imports all kernels

        with suppress(OSError):  # no place to keep it: it is compiled, and kept for this session only
            machine_code.install(KERNELS)
        with (
            _rare_garbage_collection(),
            _periodic_report(lambda: report(sum(kernel.is_translated for kernel in list(KERNELS)), max(1, len(KERNELS)))),
        ):
            for threads in (1, 2):  # a scene that uses every kernel, with one thread and with a helper
                Simulation(scenario(), threads).advance()
        _done = True
        if are_interpreted():  # the compiler failed and has said why
            return
        with suppress(OSError):  # where the folder is read-only numba chooses another one, and this is asked again next time
            cache_folder().mkdir(parents=True, exist_ok=True)
            completion_file().touch()


def compile_solver_with_notice() -> None:
    """Compile the solver unless that was done before, and say so on stderr first; for commands, which have no window."""
    if not is_needed():
        return
    from ..compiled import machine_code

    if not machine_code.fits():
        print("Palpate is compiling its solver (first use only), which takes half a minute …", file=sys.stderr, flush=True)
    compile_solver()


def interpreted_seconds(scenario: Scenario) -> tuple[float, float]:
    """Return how long interpreted kernels take about to prepare a scenario and to compute one of its frames, seconds."""
    from .time_step_adviser import plan

    points = sum(len(sensor.texels) * sensor.parameters.points_per_texel for sensor in scenario.sensors)
    triangles = sum(len(target.mesh.triangles) for target in scenario.targets)
    return triangles * INTERPRETED_TRIANGLE, points * len(scenario.targets) * plan(scenario).substeps * INTERPRETED_POINT


@contextmanager
def _rare_garbage_collection() -> Iterator[None]:
    """Look for unused objects seldom meanwhile: the compiler makes millions that stay, which costs an eighth of its time."""
    before = gc.get_threshold()
    gc.set_threshold(200_000, 20, 100)
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextmanager
def _periodic_report(look: Callable[[], None]) -> Iterator[None]:
    """Call a function twice a second meanwhile."""
    over = threading.Event()

    def watch() -> None:
        while not over.wait(0.5):
            look()

    thread = threading.Thread(target=watch, name="palpate compiling", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def compile_effect_laws() -> None:
    """Compile the law of every form of every effect."""
    from ..effects.engine.registry import effect, library
    from .simulation import Simulation

    plain = scenario()
    for name, kind in library().items():
        for form in kind.forms:
            sensor = replace(plain.sensors[0], effects=(effect(name, form.name),))
            Simulation(replace(plain, sensors=(sensor,)), 1).observe()


def scenario() -> Scenario:
    """Return a small box that falls on a pad of six texels (some effects want three channels each), for one frame of 10 ms."""
    import numpy as np

    from ..geometry.mesh import TriangleMesh
    from ..geometry.texels import texels_from_region
    from ..model.body import Body, Motion
    from ..model.scenario import Scenario, Target
    from ..model.sensor import Sensor

    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    box = TriangleMesh(0.01 * (corners - 0.5), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    sheet = np.array([[0.001 * x, 0.002 * y, 0.0] for y in (-0.5, 0.5) for x in (-1, 0, 1)])
    cells = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    pad = TriangleMesh(sheet, np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]]), cells)
    return Scenario(
        bodies=(
            Body("pad", Motion.at_rest()),
            Body("box", Motion.at_rest([0.0, 0.0, 0.0049]), True, 0.001, np.zeros(3), 1e-8 * np.eye(3)),
        ),
        sensors=(Sensor("pad", 0, texels_from_region(pad, np.ones(6, bool), "pad")),),
        targets=(Target("box", 1, box),),
        frame_end=2,
        fps=100.0,
    )


def _end_with_parent() -> None:
    """End this process when its parent is gone: the pipe on stdin is closed then, however the parent ended."""
    sys.stdin.buffer.read()
    os._exit(1)


def main() -> None:
    """Compile in a process of its own; a line of JSON on stdout twice a second tells the progress.

    When the solver is noted as compiled, the laws of effects follow, each of which takes a second when it is first used.
    """
    from ..compiled.kernels import are_interpreted

    threading.Thread(target=_end_with_parent, daemon=True).start()
    compile_solver(lambda done, total: print(json.dumps({"done": done, "total": total}), flush=True))
    if are_interpreted():
        sys.exit(1)
    compile_effect_laws()
