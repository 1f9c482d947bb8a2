# SPDX-License-Identifier: GPL-3.0-or-later
"""Workers that do not see the study's folder: they get a copy of the frozen study, and what they compute comes back.

A worker computes a batch as any other does, into a folder of its own below Dask's local directory. The bytes of its runs are
the result of the task, and the driver appends them to a shard. So a batch that is lost with its worker is computed again, and a
run counts as done when it is on the driver's disk.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import WorkerPlugin, get_worker

from ..core.errors import FileError, PalpateError, os_error_reason
from ..core.io.file_writing import atomic_write
from ..core.io.hidden_folder import temporary_folder
from ..core.study import run_shards
from ..core.study.run_files import FAILED, RUNS, SCENES, STUDY_NAME, make_folders, write_failure
from ..core.study.study_file import read_study
from .child import DONE, UNWRITABLE
from .child import FAILED as RUN_FAILED
from .driver import Way
from .scene_evaluation import REFUSE
from .worker import NO_LIMITS, Limits, compute_batch


@dataclass(frozen=True)
class ReturnedBatch:
    """What a worker sends back.

    Attributes
    ----------
    answers : list of dict
        As of :func:`.worker.compute_batch`.
    runs : dict of str to bytes
        Runs that are done, as they stand in a shard, by their digests.
    common : dict of str to bytes
        What they have in common.
    failures : dict of str to str
        Sentences and tracebacks of runs that failed.
    """

    answers: list[dict[str, Any]]
    runs: dict[str, bytes]
    common: dict[str, bytes]
    failures: dict[str, str]


class StudyCopy(WorkerPlugin):
    """Gives each worker, those that join late too, a copy of a frozen study.

    Parameters
    ----------
    folder : Path
        Of the study.

    Raises
    ------
    FileError
        It cannot be read.
    PalpateError
        Its runs have folders, which do not come back.
    """

    def __init__(self, folder: Path):
        if read_study(folder / STUDY_NAME).has_folders:
            raise PalpateError(
                "Only runs without folders come back from workers with disks of their own: leave images, recordings and job "
                "out, or give all machines the study's folder and leave --own-disks out."
            )
        try:
            self._content = _packed(folder)
        except OSError as error:
            raise FileError(f"The study in '{folder}' could not be read ({os_error_reason(error)}): check it.") from error
        self.name = f"palpate-study-{hashlib.sha256(self._content).hexdigest()[:16]}"

    def setup(self, worker: Any) -> None:
        """Unpack the study below the worker's local directory; its own file comes last, and tells that the rest is there."""
        folder = Path(worker.local_directory) / self.name
        if (folder / STUDY_NAME).is_file():
            return
        folder.mkdir(parents=True, exist_ok=True)
        make_folders(folder)
        with zipfile.ZipFile(io.BytesIO(self._content)) as archive:
            for name in archive.namelist():  # in the order of _packed
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                with atomic_write(folder / name) as fresh:
                    fresh.write_bytes(archive.read(name))


def _packed(folder: Path) -> bytes:
    """Return scenes and file of a study as an archive."""
    with io.BytesIO() as content:
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
            for path in [*sorted((folder / SCENES).rglob("*")), folder / STUDY_NAME]:
                if path.is_file() and not path.name.startswith("."):
                    archive.writestr(zipfile.ZipInfo(path.relative_to(folder).as_posix()), path.read_bytes())
        return content.getvalue()


def compute_apart(
    name: str, runs: Sequence[dict[str, Any]], limits: Limits = NO_LIMITS, scripts: str = REFUSE
) -> ReturnedBatch:
    """Compute runs in the worker's copy of a study and return them; called by Dask.

    Parameters
    ----------
    name : str
        Of the :class:`StudyCopy`.
    runs, limits, scripts
        As of :func:`.worker.compute_batch`.
    """
    return returned(Path(get_worker().local_directory) / name, runs, limits, scripts)


def returned(folder: Path, runs: Sequence[dict[str, Any]], limits: Limits, scripts: str) -> ReturnedBatch:
    """Compute runs in a copy of a study, and take them and their failures out of it."""
    answers = compute_batch(str(folder), runs, limits, scripts)
    found: dict[str, bytes] = {}
    failures: dict[str, str] = {}
    try:
        shards = run_shards.ShardIndex(folder / RUNS)
        found = {answer["digest"]: shards.read(answer["digest"]) for answer in answers if answer["status"] == DONE}
        common = shards.all_common()
        for answer in answers:
            if answer["status"] == RUN_FAILED:
                failures[answer["digest"]] = (folder / FAILED / f"{answer['digest']}.txt").read_text(encoding="utf-8")
    except (OSError, FileError) as error:
        lost = {"digest": runs[0]["digest"], "status": UNWRITABLE, "seconds": 0.0}
        return ReturnedBatch([lost | {"sentence": f"A worker lost what it had computed: {error}"}], {}, {}, {})
    finally:
        for path in [*(folder / RUNS).glob(f"*{run_shards.SUFFIX}"), *(folder / FAILED).glob("*.txt")]:
            with suppress(OSError):
                path.unlink()
    return ReturnedBatch(answers, found, common, failures)


def keep(folder: Path, batch: ReturnedBatch) -> None:
    """Bring what a worker has sent onto the disk of the driver.

    Raises
    ------
    FileError
        It cannot be written.
    """
    for digest, text in batch.failures.items():
        sentence, _, details = text.partition("\n")
        write_failure(folder, digest, sentence, details.strip("\n"))
    if not batch.runs:
        return
    try:
        with temporary_folder(folder / RUNS, "runs") as place:
            run_shards.append(folder / RUNS, place, batch.runs, batch.common)
    except OSError as error:
        raise FileError(
            f"Runs could not be written to '{folder / RUNS}' ({os_error_reason(error)}): free some space or check the "
            "permissions, and give the same command again."
        ) from error
    for digest in batch.runs:
        with suppress(OSError):
            (folder / FAILED / f"{digest}.txt").unlink(missing_ok=True)


def way_to(client: Any, folder: Path, limits: Limits, scripts: str) -> Way:
    """Give all workers of a client a copy of a study, and return the way of batches to them; raises as :class:`StudyCopy`."""
    copy = StudyCopy(folder)
    client.register_plugin(copy)

    def kept(found: ReturnedBatch) -> list[dict[str, Any]]:
        keep(folder, found)
        return found.answers

    return Way(lambda batch: (compute_apart, copy.name, batch, limits, scripts), kept)
