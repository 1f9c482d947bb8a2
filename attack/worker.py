# SPDX-License-Identifier: GPL-3.0-or-later
"""A process with Blender that runs commands for the attack, and the parent's end of it.

Starting Blender takes seconds, a small bake a fraction of one. So one process runs thousands of commands one after the other.
It is ended and started again when a command does not come back or takes the process down, which is a finding.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import traceback
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .injector import Injector, Stopped

PACKAGE = "palpate.attack"
"""Name of this package for a process that was started in another folder."""
PATIENCE = 1800.0
"""Seconds after which a worker counts as hung, where nothing else is said: it may compile the solver on a busy machine."""
KILLED = "killed"
"""Status of a command that :class:`.Stopped` has ended."""


class Hung(Exception):
    """The worker did not answer in time and was ended."""


class Crashed(Exception):
    """The worker process ended by itself."""


class Failed(Exception):
    """A function in the worker raised; the text is the traceback."""


class Worker:
    """The parent's end.

    Parameters
    ----------
    folder : Path
        For Blender's preferences and what the worker prints.
    """

    def __init__(self, folder: Path):
        self._folder = folder
        self._process: subprocess.Popen | None = None

    def call(self, function: str, timeout: float = PATIENCE, **arguments: Any) -> Any:
        """Call ``module:function`` of this package in the worker with JSON values and return what it returns.

        Raises
        ------
        Hung, Crashed, Failed
        """
        if self._process is None:
            self._start()
        line = json.dumps({"function": function, "arguments": arguments}) + "\n"
        os.write(self._to, line.encode())
        answer = bytearray()
        while not answer.endswith(b"\n"):
            ready, _, _ = select.select([self._from], [], [], timeout)
            if not ready:
                self.close()
                raise Hung(f"no answer within {timeout:g} s")
            block = os.read(self._from, 1 << 16)
            if not block:
                status = self._process.wait()
                self.close()
                raise Crashed(signal.Signals(-status).name if status < 0 else f"exit status {status}")
            answer += block
        result = json.loads(answer)
        if result["error"]:
            raise Failed(result["error"])
        return result["value"]

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            os.close(self._to)
            os.close(self._from)
            self._process = None

    def _start(self) -> None:
        requests, self._to = os.pipe()
        self._from, answers = os.pipe()
        home = self._folder / "blender"
        home.mkdir(parents=True, exist_ok=True)
        code = f"from {PACKAGE}.worker import serve; serve({requests}, {answers})"
        environment = {**os.environ, "BLENDER_USER_RESOURCES": str(home), "PYTHONPATH": os.environ.get("PYTHONPATH", "")}
        with open(self._folder / "worker.log", "ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", code],
                pass_fds=(requests, answers),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                cwd=self._folder,
                env=environment,
            )
        os.close(requests)
        os.close(answers)


def serve(requests: int, answers: int) -> None:
    """Answer requests until the parent closes its end."""
    never_wait_for_the_disk()
    with os.fdopen(requests, "r", encoding="utf-8") as lines:
        for line in lines:
            request = json.loads(line)
            module, _, name = request["function"].partition(":")
            answer: dict[str, Any] = {"value": None, "error": ""}
            try:
                function = getattr(importlib.import_module(f".{module}", __package__), name)
                answer["value"] = function(**request["arguments"])
            except BaseException:
                answer["error"] = traceback.format_exc()
            os.write(answers, (json.dumps(answer) + "\n").encode())
    os._exit(0)


# --- in the worker


def run_command(argv: list[str], cwd: str, fault: dict[str, Any] | None = None) -> dict[str, Any]:
    """Run a command of Palpate in this process.

    Parameters
    ----------
    argv : list of str
    cwd : str
    fault : dict, optional
        `root`, `at` and `kind` of an :class:`.Injector`.

    Returns
    -------
    dict
        `status` (or :data:`KILLED`), `printed`, `traceback` of an error that the command did not catch, and the `calls` that
        were counted.
    """
    from palpate import commands
    from palpate.core.io import bake_switch

    answer: dict[str, Any] = {"status": None, "printed": "", "traceback": "", "calls": []}
    os.chdir(cwd)
    with tempfile.TemporaryFile() as printed, _printed_into(printed):
        injector = Injector(Path(fault["root"]), fault["at"], fault["kind"]) if fault else None
        try:
            if injector is None:
                answer["status"] = commands.main(argv)
            else:
                with injector:
                    answer["status"] = commands.main(argv)
            bake_switch.wait_for_removals()
        except Stopped:
            answer["status"] = KILLED
        except BaseException:
            answer["traceback"] = traceback.format_exc()
        if injector is not None:
            answer["calls"] = injector.calls
        _forget()
        os.chdir("/")  # the folder may be unmounted next
        sys.stdout.flush()
        sys.stderr.flush()
        printed.seek(0)
        answer["printed"] = printed.read().decode("utf-8", "backslashreplace")[-20000:]
    return answer


def _forget() -> None:
    """Let go of what an interrupted command has left in memory: threads and locks that end with a process."""
    from palpate.core.io import bake_switch

    with suppress(BaseException):
        bake_switch.wait_for_removals()
    sys.last_traceback = None
    gc.collect()


@contextmanager
def _printed_into(file):
    """Send what is printed, also by C code, into a file."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(number) for number in (1, 2)]
    for number in (1, 2):
        os.dup2(file.fileno(), number)
    try:
        yield
    finally:
        for number, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, number)
            os.close(copy)


def never_wait_for_the_disk() -> None:
    """Let this process synchronise nothing: a busy disk takes seconds for each call. Power cuts have processes of their own."""
    os.fsync = lambda descriptor: None  # type: ignore[assignment]
    if hasattr(os, "sync"):
        os.sync = lambda: None  # type: ignore[assignment]


def checkpoints_always() -> None:
    """Let every bake save a checkpoint after each frame."""
    from palpate.addon.bake import bake_checkpoint

    bake_checkpoint.CHECKPOINT_INTERVAL, bake_checkpoint.MAX_COST_SHARE = 0.0, float("inf")
