# SPDX-License-Identifier: GPL-3.0-or-later
"""Gives the runs of a study to Dask workers, in batches that last about two seconds, and counts what comes back."""

from __future__ import annotations

import logging
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ..core.errors import FileError, PalpateError
from ..core.study.study_file import Run
from . import local_worker
from .child import DONE, FAILED, UNWRITABLE
from .scene_evaluation import REFUSE
from .worker import Limits, compute_batch

BATCH_SECONDS = 2.0
"""Length of a batch: long beside the milliseconds that Dask needs for a task, short for who waits for Ctrl-C."""
FIRST_BATCH, LARGEST_BATCH = 1, 500
"""Runs of the first batches, as nobody knows how long they take, and the most of any."""
BATCHES_AHEAD = 2
"""Batches that wait at each worker, so that it is never idle."""
MOST_LOSSES = 20
"""How often a batch may be lost with its worker before the study stops; a run itself cannot end a worker."""
LOOK = 0.2
"""Seconds between two looks at the keyboard."""


@dataclass
class Tally:
    """What has become of the runs of a study so far.

    Attributes
    ----------
    done, failed : int
    seconds : float
        Of computing, in the processes.
    failures : list of (int, str)
        Indices of the first failed runs and their sentences.
    """

    done: int = 0
    failed: int = 0
    seconds: float = 0.0
    failures: list[tuple[int, str]] = field(default_factory=list)

    @property
    def finished(self) -> int:
        """Runs that are done or failed."""
        return self.done + self.failed


@dataclass(frozen=True)
class Way:
    """How batches go to workers and come back.

    Attributes
    ----------
    task : callable
        Returns a function and its arguments for the fields of the runs of a batch.
    answers : callable
        Returns what became of these runs from the result of the task.
    """

    task: Callable[[list[dict[str, Any]]], tuple[Any, ...]]
    answers: Callable[[Any], list[dict[str, Any]]]


def require_dask() -> None:
    """Raise :class:`PalpateError` where Dask is missing."""
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise PalpateError(
            f"palpate sweep needs Dask ({error}): run 'pip install .[sweep]' in a checkout of Palpate."
        ) from error


@contextmanager
def dask_client(scheduler: str | None, workers: int, make_cluster: Callable[[], Any] | None = None) -> Iterator[Any]:
    """Connect to a scheduler, or start workers on this machine, and yield the client.

    Parameters
    ----------
    scheduler : str or None
        Address, as in tcp://127.0.0.1:8786. None: a cluster of this machine's own.
    workers : int
        Of the local cluster, one thread each.
    make_cluster : callable, optional
        Returns another cluster than that of this machine, as :func:`.slurm.slurm_cluster` does.

    Raises
    ------
    PalpateError
        Dask is missing, nothing answers at the address, or the workers of this machine do not start.
    """
    require_dask()
    import dask
    from distributed import Client, LocalCluster

    own = [name for name in logging.root.manager.loggerDict if name.startswith("distributed.")]  # some have levels of their own
    for name in ("distributed", "asyncio", "tornado", *own):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    settings = {
        "distributed.scheduler.allowed-failures": MOST_LOSSES,
        "distributed.logging.distributed": "critical",
        "distributed.worker.profile.enabled": False,  # it would look a hundred times a second where a worker waits
    }
    with dask.config.set(settings), tempfile.TemporaryDirectory(prefix="palpate-dask-") as scratch:
        if scheduler is not None:
            try:
                client = Client(scheduler, timeout=10)
            except (OSError, TimeoutError, ValueError) as error:
                raise PalpateError(
                    f"No scheduler answers at '{scheduler}' ({error}): start 'dask scheduler' there, or leave --scheduler out."
                ) from error
            with _closing(client):
                yield client
            return
        if make_cluster is not None:
            cluster = make_cluster()
            with _closing(cluster, timeout=30), _closing(Client(cluster)) as client:
                yield client
            return
        try:
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",  # any free port: two studies on one machine would both take 8787
                memory_limit=0,  # the runs are computed in processes of their own
                local_directory=scratch,
                silence_logs=logging.CRITICAL,
                preload=[local_worker.__name__],
            )
        except (OSError, RuntimeError, TimeoutError) as error:  # Dask wraps what happened in a RuntimeError
            raise PalpateError(
                f"The {workers} worker processes did not start ({error}): look whether something ends processes on this "
                "machine, as a limit of memory does, and give the same command again."
            ) from error
        with _closing(cluster, timeout=10), _closing(Client(cluster)) as client:
            yield client


@contextmanager
def _closing(resource: Any, **words: Any) -> Iterator[Any]:
    try:
        yield resource
    finally:
        with suppress(Exception):  # its other end may be gone
            resource.close(**words)


def run_study(
    client: Any,
    folder: Path,
    runs: Sequence[Run],
    limits: Limits,
    on_progress: Callable[[Tally], object],
    scripts: str = REFUSE,
    way: Way | None = None,
) -> Tally:
    """Compute runs and return what became of them.

    Parameters
    ----------
    client : distributed.Client
    folder : Path
        Of the study, under the same path on all machines unless they have disks of their own.
    runs : sequence of Run
        Those that are not done.
    limits : Limits
        What a run may take.
    on_progress : callable
        Called several times a second. An exception that it raises, KeyboardInterrupt included, stops the study.
    scripts : str
        What is done about the Python in a .blend, one of :data:`.scene_evaluation.SCRIPTS`.
    way : Way, optional
        Of batches to the workers and back, where these do not see the folder.

    Raises
    ------
    FileError
        Files cannot be written. What is done is kept.
    PalpateError
        Workers are lost again and again.
    """
    if way is None:
        way = Way(lambda batch: (compute_batch, os.fspath(folder), batch, limits, scripts), list)
    return _Dispatch(client, runs, way).run(on_progress)


class _Dispatch:
    """Batches at the workers and those to come.

    Parameters
    ----------
    client : distributed.Client
    runs : sequence of Run
    way : Way
    """

    def __init__(self, client: Any, runs: Sequence[Run], way: Way):
        self.client, self.runs, self.way = client, runs, way
        self.index_of = {run.digest: run.index for run in runs}
        self.next = 0
        self.batch = FIRST_BATCH
        self.waiting: dict[Any, tuple[Sequence[Run], int]] = {}
        self.tally = Tally()

    def run(self, on_progress: Callable[[Tally], object]) -> Tally:
        from concurrent.futures import CancelledError

        from distributed.comm import CommClosedError

        try:
            self._until_done(on_progress)
            return self.tally
        except (CommClosedError, CancelledError, RuntimeError) as error:
            if isinstance(error, RuntimeError) and self.client.status == "running":  # a fault, not a lost connection
                raise
            raise _scheduler_gone() from error
        finally:
            with suppress(Exception):  # the scheduler may be gone
                self.client.cancel(list(self.waiting), force=True)

    def _until_done(self, on_progress: Callable[[Tally], object]) -> None:
        from distributed import wait

        while self.next < len(self.runs) or self.waiting:
            if self.client.status != "running":
                raise _scheduler_gone()
            self._submit()
            on_progress(self.tally)
            with suppress(TimeoutError):
                for future in wait(list(self.waiting), timeout=LOOK, return_when="FIRST_COMPLETED").done:
                    self._take(future)
        on_progress(self.tally)

    def _submit(self) -> None:
        workers = max(1, len(self.client.scheduler_info(n_workers=-1)["workers"]))
        while self.next < len(self.runs) and len(self.waiting) < (1 + BATCHES_AHEAD) * workers:
            left = len(self.runs) - self.next
            size = max(1, min(self.batch, LARGEST_BATCH, left // ((1 + BATCHES_AHEAD) * workers)))
            self._send(self.runs[self.next : self.next + size], 0)
            self.next += size

    def _send(self, runs: Sequence[Run], losses: int) -> None:
        future = self.client.submit(*self.way.task([asdict(run) for run in runs]), pure=False)
        self.waiting[future] = runs, losses

    def _take(self, future: Any) -> None:
        from distributed.scheduler import KilledWorker

        runs, losses = self.waiting.pop(future)
        if future.status != "finished":
            error = future.exception() if future.status == "error" else None
            if error is not None and not isinstance(error, KilledWorker):
                raise error
            if losses + 1 >= MOST_LOSSES:
                raise PalpateError(
                    f"Workers were lost {MOST_LOSSES} times with run {runs[0].index}: look at their logs, and give the same "
                    "command again."
                )
            self._send(runs, losses + 1)
            return
        answers = self.way.answers(future.result())
        for answer in answers:
            if answer["status"] == UNWRITABLE:
                raise FileError(answer["sentence"])
            self.tally.seconds += answer["seconds"]
            if answer["status"] == DONE:
                self.tally.done += 1
            elif answer["status"] == FAILED:
                self.tally.failed += 1
                if len(self.tally.failures) < 100:
                    self.tally.failures.append((self.index_of[answer["digest"]], answer["sentence"]))
        spent = sum(answer["seconds"] for answer in answers)
        if spent > 0.0:
            self.batch = max(1, round(BATCH_SECONDS * len(answers) / spent))


def _scheduler_gone() -> PalpateError:
    return PalpateError(
        "The connection to the Dask scheduler is lost: start it again if it has ended, and give the same command again; what "
        "is done is kept."
    )
