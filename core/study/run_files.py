# SPDX-License-Identifier: GPL-3.0-or-later
"""The output folder of a study: what is done is known from its files.

::

    study.toml                              the study, with the version and the digests of its scenes
    scenes/<scene>.npz                      the scenes as the solver sees them (scenario_npz)
    runs/<16 digits>.shard                  values, metrics and frames of many runs (run_shards)
    failed/<digest>.txt                     why a run could not be computed: a sentence, and the traceback of a fault

Where a study asks for images or recordings, and where a program computes its runs, each has a folder instead::

    runs/<digest>/run.json                  values and metrics of a run
    runs/<digest>/<sensor>/recording.npz    with sensor.npz and manifest.json, as in a bake without images

Runs are written in a hidden folder. Those of a batch are brought onto the disk together, in a shard or under the names of their
folders, so that each is there as a whole or not at all.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from ..errors import FileError
from ..geometry.texels import Texels
from ..io.bake_folder import MANIFEST_NAME, RECORDING_NAME, folder_names, manifest_bytes, manifest_of
from ..io.file_writing import atomic_write, file_sha256, os_error_reason, writable_folder
from ..io.group_sync import GroupSync, sync_folder, write_hashed
from ..io.hidden_folder import remove_abandoned, temporary_folder
from ..io.npz import pack_arrays
from ..io.recording_npz import recording_arrays
from ..io.sensor_npz import SENSOR_NAME, sensor_arrays
from ..model.recording import Recording
from ..model.scenario import Scenario
from ..model.sensor_parameters import Painted
from ..model.shared_results import SharedResults
from . import run_shards
from .run_images import write_run_images
from .run_record import RUN_NAME, RunRecord, write_run_record
from .study_file import Run

STUDY_NAME = "study.toml"
RUNS, FAILED, SCENES = "runs", "failed", "scenes"
PACKED, COMMON = ".run", ".common"
"""Endings in the folder of a batch: of what a run becomes in a shard, and of what runs have in common there."""

_REMEDY = "free some space or check the permissions, and give the same command again"
_DIGEST = re.compile(r"[0-9a-f]{24}")


def make_folders(folder: Path) -> None:
    """Make the folders of a study, and remove what killed processes have left unfinished in them.

    Raises
    ------
    FileError
        They cannot be made or written to.
    """
    for name in (RUNS, FAILED, SCENES):
        remove_abandoned(writable_folder(folder / name, create=True))


def done_runs(folder: Path) -> set[str]:
    """Return the digests of the runs that are done."""
    return run_folders(folder) | run_shards.digests_in(folder / RUNS)


def run_folders(folder: Path) -> set[str]:
    """Return the digests of the runs that are done and have folders of their own."""
    return _digests(folder / RUNS, "")


def failed_runs(folder: Path) -> set[str]:
    """Return the digests of the runs that could not be computed."""
    return _digests(folder / FAILED, ".txt")


def _digests(folder: Path, suffix: str) -> set[str]:
    found = set()
    with suppress(FileNotFoundError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(suffix) and _DIGEST.fullmatch(entry.name.removesuffix(suffix)):
                found.add(entry.name.removesuffix(suffix))
    return found


def write_run(
    place: Path,
    run: Run,
    scenario: Scenario,
    recording: Recording,
    metrics: Mapping[str, float],
    seconds: float,
    images: bool = False,
    shared: SharedResults | None = None,
) -> None:
    """Write the files of a run into the folder of a batch, which brings them onto the disk.

    Parameters
    ----------
    place : Path
        Of the batch.
    run : study_file.Run
    scenario : Scenario
        That was computed.
    recording : Recording
    metrics : mapping of str to float
    seconds : float
        That computing took.
    images : bool
        Whether each frame of each sensor also gets a tactile image.
    shared : SharedResults, optional
        Of the runs of this process, in which files that are alike are kept.

    Raises
    ------
    FileError
        A file cannot be written.
    """
    with run_folder(place, run) as own:
        names, frames = tuple(recording.sensors), len(recording.frames)
        _write_sensors(own, scenario, recording, images, shared or SharedResults())
        write_run_record(RunRecord(own, run.digest, run.index, dict(run.values), dict(metrics), seconds, names, frames))


@contextmanager
def run_folder(place: Path, run: Run) -> Iterator[Path]:
    """Yield a new folder for the files of a run in that of a batch; what a process that died has left of the run is removed.

    Raises
    ------
    FileError
        A file cannot be written, which the body may also tell by OSError.
    """
    own = place / run.digest
    with _told(run, place):
        shutil.rmtree(own, ignore_errors=True)
        own.mkdir()
        yield own


def write_packed_run(place: Path, run: Run, content: bytes, common_name: str, common: bytes) -> None:
    """Write what a run becomes in a shard into the folder of a batch, and what it has in common with others if it is not there.

    Raises
    ------
    FileError
        A file cannot be written.
    """
    with _told(run, place):
        start = os.fspath(place)
        _write(f"{start}/{run.digest}{PACKED}", content)
        if not os.path.exists(f"{start}/{common_name}{COMMON}"):
            _write(f"{start}/{common_name}{COMMON}", common)


def _write(path: str, content: bytes) -> None:
    with open(path, "wb", buffering=0) as file:
        rest = memoryview(content)
        while rest:
            rest = rest[file.write(rest) :]


@contextmanager
def _told(run: Run, place: Path) -> Iterator[None]:
    """Turn an OSError into a sentence about a run."""
    try:
        yield
    except OSError as error:
        raise FileError(
            f"Run {run.index} could not be written to '{place.parent}' ({os_error_reason(error)}): {_REMEDY}."
        ) from error


class RunBatch:
    """Runs whose files are brought onto the disk together.

    Attributes
    ----------
    place : Path
        Hidden folder in which runs are written; that of a run, or its file, has the name of its digest.
    """

    def __init__(self, folder: Path, place: Path):
        self.place = place
        self._folder = folder
        self._digests: list[str] = []

    def add(self, digest: str) -> None:
        """Say that a run is written as a whole."""
        self._digests.append(digest)

    def commit(self, group: GroupSync) -> None:
        """Bring the runs onto the disk and put them into their places; failures of them that were written earlier are removed.

        Raises
        ------
        FileError
            That is not possible.
        """
        if not self._digests:
            return
        runs = self._folder / RUNS
        packed = [digest for digest in self._digests if (self.place / f"{digest}{PACKED}").is_file()]
        folders = [digest for digest in self._digests if digest not in set(packed)]
        try:
            if packed:
                self._append(packed)
            if folders:
                group.sync([self.place / digest for digest in folders])
                for digest in folders:
                    self._put_into_place(digest)
                sync_folder(runs)
        except OSError as error:
            raise FileError(f"Runs could not be written to '{runs}' ({os_error_reason(error)}): {_REMEDY}.") from error
        for digest in self._digests:
            with suppress(OSError):
                (self._folder / FAILED / f"{digest}.txt").unlink(missing_ok=True)

    def _append(self, digests: list[str]) -> None:
        found = {digest: (self.place / f"{digest}{PACKED}").read_bytes() for digest in digests}
        common = {path.stem: path.read_bytes() for path in sorted(self.place.glob(f"*{COMMON}"))}
        run_shards.append(self._folder / RUNS, self.place, found, common)

    def _put_into_place(self, digest: str) -> None:
        target = self._folder / RUNS / digest
        try:
            os.rename(self.place / digest, target)
        except OSError:
            if not (target / RUN_NAME).is_file():  # else another process was faster
                raise


@contextmanager
def run_batch(folder: Path) -> Iterator[RunBatch]:
    """Yield a batch for runs of a study; those that are added to it take their places when the body ends, all with one wait
    for the disk where the file system allows that.

    Parameters
    ----------
    folder : Path
        Of the study.

    Raises
    ------
    FileError
        Files cannot be written.
    """
    with temporary_folder(folder / RUNS, "runs") as place:
        group = GroupSync(place)
        try:
            batch = RunBatch(folder, place)
            yield batch
            batch.commit(group)
        finally:
            group.close()


def _write_sensors(place: Path, scenario: Scenario, recording: Recording, images: bool, shared: SharedResults) -> None:
    """Write the files of each sensor."""
    names = folder_names(recording.sensors)
    for sensor in scenario.sensors:
        if not sensor.readout:
            continue
        own = place / names[sensor.name]
        own.mkdir()
        arrays = recording_arrays(replace(recording, sensors={sensor.name: recording.sensors[sensor.name]}))
        files = {
            RECORDING_NAME: write_hashed(own / RECORDING_NAME, pack_arrays(arrays)),
            SENSOR_NAME: write_hashed(own / SENSOR_NAME, shared.of(_sensor_bytes, sensor.texels, sensor.painted)),
        }
        if images:
            pictures = write_run_images(own, sensor, recording)
            files[pictures[-1]] = file_sha256(own / pictures[-1])  # it lists the others
        write_hashed(own / MANIFEST_NAME, manifest_bytes(manifest_of(scenario, sensor, recording, files)))


def _sensor_bytes(texels: Texels, painted: Painted) -> bytes:
    return pack_arrays(sensor_arrays(texels, painted))


def write_failure(folder: Path, digest: str, sentence: str, details: str = "") -> None:
    """Write why a run could not be computed; raise :class:`FileError` if that is not possible."""
    text = sentence.rstrip("\n") + "\n" + (f"\n{details.rstrip()}\n" if details else "")
    with atomic_write(folder / FAILED / f"{digest}.txt") as fresh:
        fresh.write_text(text, encoding="utf-8", newline="\n", errors="backslashreplace")
