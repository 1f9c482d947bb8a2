# SPDX-License-Identifier: GPL-3.0-or-later
"""Gives the runs of a study to Dask workers in batches, and counts what comes back."""

from __future__ import annotations

import logging
import os
import signal
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from ..core.errors import PalpateError, imported
from .parts import RunResult, write_part
from .study_folder import OpenStudy
from .worker import BatchResult, compute_batch

BATCH_SECONDS = 5.0
"""Length of a batch. Dask, the part and its name take some 20 ms; a worker that is lost loses no more than a batch."""
MOST_PARTS = 5000
"""Parts that all runs of a study make: of a million runs, 200 at least are in a batch."""
BATCHES_EACH = 4
"""Batches of a short study for each worker, so that all end at about the same time."""
RETRIES = 2
"""How often Dask repeats a batch whose files could not be written."""
LOOK = 0.1
"""Seconds between two looks at the keyboard."""

SETTINGS = {
    "distributed.logging.distributed": "critical",
    "distributed.worker.profile.enabled": False,  # it would look a hundred times a second where a worker waits
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 1.0,  # of run_memory, where there is one
    # Values that the C library of Linux comes to by itself. With Dask's 64 kB a run of 1,024 texels and 2,000 frames took 445
    # ms of a processor instead of 187, since every large array was new pages.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 64 << 20,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 32 << 20,
    "distributed.nanny.pre-spawn-environ.NUMBA_NUM_THREADS": 1,
    "distributed.scheduler.allowed-failures": 0,  # of this machine: a batch that ended its worker is taken apart, not repeated
    "distributed.deploy.lost-worker-timeout": "5s",  # in which a nanny starts another worker, before it is replaced, too
}


def require_dask() -> None:
    """Raise :class:`PalpateError` where Dask is missing."""
    imported("distributed", "palpate sweep", "run 'pip install .[sweep]' in a checkout of Palpate")


def dask_setup(_worker: Any) -> None:
    """Leave Ctrl-C to the driver, which stops the workers; called by each worker of this machine when it starts."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def dask_client(
    workers: int, memory: float | None = None, scheduler: str | None = None, make_cluster: Callable[[], Any] | None = None
) -> Iterator[Any]:
    """Connect to a scheduler, or start workers on this machine, and yield the client.

    Parameters
    ----------
    workers : int
        Of the local cluster, one thread each.
    memory : float, optional
        MB that a worker of the local cluster may hold, before Dask's nanny ends it.
    scheduler : str, optional
        Address of a running scheduler, as in tcp://127.0.0.1:8786.
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

    known = [name for name in logging.root.manager.loggerDict if name.startswith("distributed.")]  # some have their own levels
    for name in ("distributed", "asyncio", "tornado", *known):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with dask.config.set(SETTINGS), tempfile.TemporaryDirectory(prefix="palpate-dask-") as scratch:
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
        try:
            cluster = make_cluster() if make_cluster is not None else LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",  # any free port: two studies on one machine would both take 8787
                memory_limit=0 if memory is None else int(memory * 1e6),
                local_directory=scratch,
                silence_logs=logging.CRITICAL,
                preload=[__name__],
            )  # fmt: skip
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


def batches_of(indices: np.ndarray, total: int, seconds: float, workers: int) -> list[np.ndarray]:
    """Return indices of runs in batches of neighbours; the whole study has `total` runs, and one takes so many seconds."""
    size = min(BATCH_SECONDS / max(seconds, 1e-6), len(indices) / (BATCHES_EACH * workers))
    size = max(1, round(size), -(-total // MOST_PARTS))
    return [indices[at : at + size] for at in range(0, len(indices), size)]


class Dispatch:
    """Batches of a study at Dask workers.

    The runs of a batch that takes its worker down are computed again, each in a batch of its own, and those that do so again
    last, one after the other: if a worker is lost then, the run is the reason, and it has failed.

    Parameters
    ----------
    client : distributed.Client
    opened : OpenStudy
    on_progress : callable
        Called several times a second with what is over. An exception that it raises, KeyboardInterrupt included, stops the
        study; what is done is kept.
    """

    def __init__(self, client: Any, opened: OpenStudy, on_progress: Callable[[BatchResult], object]):
        self.client, self.opened, self.on_progress = client, opened, on_progress
        self.words = {"folder": os.fspath(opened.folder), "scripts": opened.scripts, "limit": opened.study.run_limit}
        self.over = BatchResult()

    def run(self, indices: np.ndarray) -> BatchResult:
        """Compute runs and return what became of them.

        Raises
        ------
        FileError
            Files cannot be written.
        PalpateError
            The scheduler is lost.
        """
        from concurrent.futures import CancelledError

        from distributed.comm import CommClosedError

        try:
            workers = max(1, len(self.client.scheduler_info(n_workers=-1)["workers"]))
            first, rest = indices[:workers], indices[workers:]
            lost = self._compute(list(first[:, None]))  # nobody knows how long a run takes before
            seconds = self.over.seconds / max(1, self.over.done + self.over.failed)
            lost += self._compute(batches_of(rest, len(self.opened.runs), seconds, workers))
            for index in self._compute([np.array([index]) for index in lost]):
                if self._compute([np.array([index])]):
                    self._note_fatal(index)
        except (CommClosedError, CancelledError, RuntimeError) as error:
            if isinstance(error, RuntimeError) and self.client.status == "running":  # a fault, not a lost connection
                raise
            raise _scheduler_gone() from error
        return self.over

    def _compute(self, batches: Sequence[np.ndarray]) -> list[int]:
        """Compute batches and return the runs of those that took their workers down."""
        from distributed import LocalCluster, as_completed

        cluster = self.client.cluster
        # No other reference than this to a future: Dask forgets a batch that is taken, and does not compute it again when the
        # worker that has its result is lost.
        waiting = dict(zip(self.client.map(compute_batch, batches, **self.words, pure=False, retries=RETRIES), batches))
        completed, lost = as_completed(list(waiting)), list[int]()
        try:
            while waiting:
                self.on_progress(self.over)
                if self.client.status != "running":
                    raise _scheduler_gone()
                time.sleep(LOOK)
                if isinstance(cluster, LocalCluster):
                    # A first run can end a worker before its nanny knows it, which then starts no other.
                    cluster.scale(len(cluster.worker_spec))
                for future in completed.next_batch(block=False):
                    lost += self._take(future, waiting.pop(future))
            self.on_progress(self.over)
        finally:
            with suppress(Exception):  # the scheduler may be gone
                self.client.cancel(list(waiting), force=True)
        return lost

    def _take(self, future: Any, batch: np.ndarray) -> list[int]:
        """Note what became of a batch; return its runs if it took its worker down."""
        from distributed.scheduler import KilledWorker

        if future.status == "cancelled":  # as all batches are when the scheduler ends
            raise _scheduler_gone()
        if isinstance(future.exception(), KilledWorker):  # to catch it would keep the futures of this frame
            return [int(index) for index in batch]
        found = future.result()  # waits where a result is lost with its worker, as Dask computes it again
        self.over.done += found.done
        self.over.seconds += found.seconds
        self.over.failures += found.failures
        return []

    def _note_fatal(self, index: int) -> None:
        memory = self.opened.study.run_memory
        advice = f"raise run_memory, {memory:g} MB" if memory else "it may need more memory"
        sentence = f"Run {index} ended its worker each time that it was computed: {advice}, or vary less widely."
        write_part(self.opened.folder, [RunResult(self.opened.runs[index], sentence)])
        self.over.failures.append((index, sentence))


def _scheduler_gone() -> PalpateError:
    return PalpateError(
        "The connection to the Dask scheduler is lost: start it again if it has ended, and give the same command again; what "
        "is done is kept."
    )
