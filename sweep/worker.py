# SPDX-License-Identifier: GPL-3.0-or-later
"""What a Dask worker does: it passes runs to a process of its own and writes down which of them ended it.

A process that dies or hangs is an ordinary failure here. If it took the worker with it, Dask would give up the whole
batch after a few times.
"""

from __future__ import annotations

import atexit
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..core.errors import FileError, PalpateError
from ..core.study.run_files import RUNS, run_batch, write_failure
from ..core.study.run_record import RUN_NAME
from ..core.study.run_shards import KnownRuns
from ..core.study.study_file import Study
from .child import DONE, FAILED, UNWRITABLE
from .scene_evaluation import REFUSE

MOST_DEATHS = 3
"""How often a process may die on a run before the run counts as failed: once may be an accident or an administrator."""
START_LIMIT = 900.0
"""Seconds that a process may take to start; the first one on a machine compiles the solver, about half a minute."""
GROUP_SECONDS = 2.0
"""After this time the runs that are written are brought onto the disk. A power cut loses no more; one wait for the disk, some
milliseconds, is little beside it."""
LOOK = 0.1
"""Seconds between two looks at the memory of a run, in which it grows by less than what a machine should have left."""

ONE_THREAD = {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
FREED_MEMORY_IS_KEPT = {"MALLOC_MMAP_THRESHOLD_": str(32 << 20), "MALLOC_TRIM_THRESHOLD_": str(64 << 20)}
"""For the C library of Linux: the largest values that it comes to by itself. Dask sets 64 kB for its workers, with which a
run of 1,024 texels and 2,000 frames took 445 ms of a processor instead of 187, since every large array was new pages."""


@dataclass(frozen=True)
class Limits:
    """What a run may take.

    Attributes
    ----------
    seconds : float or None
    memory : float or None
        MB that the process of the run holds, and a Blender that it has started.
    """

    seconds: float | None = None
    memory: float | None = None

    @classmethod
    def of(cls, study: Study) -> Limits:
        """Return those that a study's file gives."""
        return cls(study.run_limit, study.run_memory)


NO_LIMITS = Limits()


class LimitReached(PalpateError):
    """A run has reached its limit of time or memory; the message goes on from "Run N"."""


class MemoryReached(LimitReached):
    """It was that of memory."""


class Child:
    """A process that computes runs of one study.

    Attributes
    ----------
    begun : int
        Runs that it was given.
    """

    def __init__(self, folder: str, scripts: str = REFUSE):
        environment = {**os.environ, **ONE_THREAD, **FREED_MEMORY_IS_KEPT}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", f"{__package__}.child", folder, scripts],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
            env=environment,
            start_new_session=True,  # Ctrl-C in a terminal reaches the driver alone, which stops the others
        )
        self._answers: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        self.begun = 0
        first = self._answer(Limits(START_LIMIT))
        if first is None or first["status"] != "ready":
            self.kill()
            raise FileError("A process for runs did not start" + (f": {first['sentence']}" if first else "."))

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._answers.put(line)
        self._answers.put("")

    def _answer(self, limits: Limits) -> dict[str, Any] | None:
        """Return the next answer, None when the process has died; raises :class:`LimitReached`."""
        until = None if limits.seconds is None else time.monotonic() + limits.seconds
        while True:
            left = None if until is None else max(0.0, until - time.monotonic())
            wait = left if limits.memory is None else LOOK if left is None else min(LOOK, left)
            try:
                line = self._answers.get(timeout=wait)
            except queue.Empty:
                if until is not None and time.monotonic() >= until:
                    raise LimitReached(f"was ended after its limit of {limits.seconds:g} s: raise run_limit") from None
                if limits.memory is not None and self.memory() > limits.memory * 1e6:
                    raise MemoryReached(
                        f"was ended because it held more than its limit of {limits.memory:g} MB: raise run_memory"
                    ) from None
            else:
                return json.loads(line) if line else None

    def memory(self) -> int:
        """Return the bytes of memory that the process and those that it has started hold; 0 when it has ended."""
        import psutil  # of Dask

        held = 0
        with suppress(psutil.Error):
            own = psutil.Process(self._process.pid)
            for process in (own, *own.children(recursive=True)):
                with suppress(psutil.Error):
                    held += process.memory_info().rss
        return held

    @property
    def process_id(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """Whether it can take a run."""
        return self._process.poll() is None

    def compute(self, words: dict[str, Any], place: Path, limits: Limits = NO_LIMITS) -> dict[str, Any] | None:
        """Compute a run into the folder of a batch; return the answer, None if the process died.

        Raises :class:`LimitReached` at a limit.
        """
        assert self._process.stdin is not None
        self.begun += 1
        try:
            self._process.stdin.write(json.dumps({**words, "place": os.fspath(place)}) + "\n")
            self._process.stdin.flush()
        except OSError:
            return None
        return self._answer(limits)

    def kill(self) -> int:
        """End the process, and a Blender that it has started, and return its exit status."""
        with suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)  # it leads a session of its own
            self._process.kill()
        with suppress(OSError):
            assert self._process.stdin is not None
            self._process.stdin.close()
        return self._process.wait()


_children: dict[tuple[str, str], Child] = {}


def _child_for(folder: str, scripts: str) -> Child:
    """Return the process for a study; those for other studies are ended."""
    key = folder, scripts
    for other in [one for one in _children if one != key or not _children[one].is_alive]:
        _children.pop(other).kill()
    if key not in _children:
        _children[key] = Child(folder, scripts)
    return _children[key]


@atexit.register
def end_children() -> None:
    """End the processes of this worker."""
    while _children:
        _children.popitem()[1].kill()


def compute_batch(
    folder: str, runs: Sequence[dict[str, Any]], limits: Limits = NO_LIMITS, scripts: str = REFUSE
) -> list[dict[str, Any]]:
    """Compute runs of a study that are not done yet; called by Dask.

    Parameters
    ----------
    folder : str
        Of the study, as this machine sees it.
    runs : sequence of dict
        Fields of :class:`.Run`.
    limits : Limits
        What each may take.
    scripts : str
        What is done about the Python in a .blend, one of :data:`.scene_evaluation.SCRIPTS`.

    Returns
    -------
    list of dict
        For each run its digest, a status (:data:`.child.DONE`, ``FAILED`` or ``UNWRITABLE``), seconds, and the sentence of a
        failure. After an unwritable run the others are left out.
    """
    answers: list[dict[str, Any]] = []
    done: set[str] | None = None
    while len(answers) < len(runs):
        left = runs[len(answers) :]
        try:
            if done is None:
                done = _done_before(folder, [str(words["digest"]) for words in runs])
            answers += _computed_group(folder, left, done, limits, scripts)
        except FileError as error:
            answers.append({"digest": left[0]["digest"], "status": UNWRITABLE, "sentence": str(error), "seconds": 0.0})
        if answers[-1]["status"] == UNWRITABLE:
            break
    return answers


_known: dict[str, KnownRuns] = {}
"""Runs in the shards of the study at which this worker is."""


def _done_before(folder: str, digests: list[str]) -> set[str]:
    """Return the runs of a batch that are done: by a worker that Dask had lost."""
    runs = Path(folder) / RUNS
    if folder not in _known:
        _known.clear()
        _known[folder] = KnownRuns(runs)
    return _known[folder].among(digests) | {digest for digest in digests if (runs / digest / RUN_NAME).is_file()}


def _computed_group(
    folder: str, runs: Sequence[dict[str, Any]], done: set[str], limits: Limits, scripts: str
) -> list[dict[str, Any]]:
    """Compute runs until it is time to bring them onto the disk; return what became of them when they are there.

    Their files are put into place by this process, so that one that dies on a run takes none of the earlier ones with it.
    """
    answers: list[dict[str, Any]] = []
    until = time.monotonic() + GROUP_SECONDS
    with run_batch(Path(folder)) as batch:
        for words in runs:
            if words["digest"] in done:
                answers.append({"digest": words["digest"], "status": DONE, "seconds": 0.0})
                continue
            answers.append(_computed(folder, words, batch.place, limits, scripts))
            if answers[-1]["status"] == DONE:
                batch.add(words["digest"])
            if answers[-1]["status"] == UNWRITABLE or time.monotonic() >= until:
                break
    return answers


def _computed(folder: str, words: dict[str, Any], place: Path, limits: Limits, scripts: str) -> dict[str, Any]:
    """Return what became of a run; the process is started again where it dies."""
    sentence = ""
    began = time.monotonic()
    for _ in range(MOST_DEATHS):
        try:
            child = _child_for(folder, scripts)
            answer = child.compute(words, place, limits)
        except LimitReached as reached:
            _children.pop((folder, scripts)).kill()
            if isinstance(reached, MemoryReached) and child.begun > 1:
                continue  # earlier runs of the process may have left something; it fails only by what it needs itself
            sentence = f"Run {words['index']} {reached}, or vary less widely."
            break
        except FileError as error:
            return {"digest": words["digest"], "status": UNWRITABLE, "sentence": str(error), "seconds": 0.0}
        if answer is not None:
            return answer
        status = _children.pop((folder, scripts)).kill()
        reason = f"signal {-status}" if status < 0 else f"exit status {status}"
        sentence = (
            f"The process that computed run {words['index']} ended {MOST_DEATHS} times ({reason}): it may need more memory."
        )
    answer = {"digest": words["digest"], "status": FAILED, "sentence": sentence, "seconds": time.monotonic() - began}
    try:
        write_failure(Path(folder), words["digest"], sentence)
    except FileError as error:
        answer |= {"status": UNWRITABLE, "sentence": str(error)}
    return answer
