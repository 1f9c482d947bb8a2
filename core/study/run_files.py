# SPDX-License-Identifier: GPL-3.0-or-later
"""The output folder of a study: what is done is known from its files.

::

    study.toml                              the study, with the version and the digests of its scenes
    scenes/<scene>.npz                      the scenes as the solver sees them (scenario_npz)
    runs/<digest>/run.json                  values and metrics of a run
    runs/<digest>/<sensor>/recording.npz    with sensor.npz and manifest.json, as in a bake without images
    failed/<digest>.txt                     why a run could not be computed: a sentence, and the traceback of a fault

A run is written in a hidden folder, brought onto the disk and renamed, so it is there as a whole or not at all.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import FileError
from ..geometry.texels import Texels
from ..io.bake_folder import MANIFEST_NAME, RECORDING_NAME, folder_names, manifest_bytes
from ..io.file_writing import (
    atomic_write,
    file_sha256,
    os_error_reason,
    sync_file,
    sync_folder,
    writable_folder,
    write_synced,
)
from ..io.npz import PACKED_BYTES, pack_arrays, write_arrays
from ..io.recording_npz import recording_arrays
from ..io.sensor_manifest import manifest_of
from ..io.sensor_npz import SENSOR_NAME, sensor_arrays
from ..io.temporary_folder import remove_unfinished, temporary_folder
from ..model.recording import Recording
from ..model.scenario import Scenario
from ..model.sensor_parameters import Painted
from ..model.shared_results import SharedResults
from .run_images import write_run_images
from .run_record import RUN_NAME, RunRecord, write_run_record
from .study_file import Run

STUDY_NAME = "study.toml"
RUNS, FAILED, SCENES = "runs", "failed", "scenes"

_DIGEST = re.compile(r"[0-9a-f]{24}")


def make_folders(folder: Path) -> None:
    """Make the folders of a study, and remove what killed processes have left unfinished in them.

    Raises
    ------
    FileError
        They cannot be made or written to.
    """
    for name in (RUNS, FAILED, SCENES):
        remove_unfinished(writable_folder(folder / name, create=True))


def done_runs(folder: Path) -> set[str]:
    """Return the digests of the runs that are done."""
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
    folder: Path,
    run: Run,
    scenario: Scenario,
    recording: Recording,
    metrics: Mapping[str, float],
    seconds: float,
    images: bool = False,
    shared: SharedResults | None = None,
) -> None:
    """Write a run as a whole; a failure of it that was written earlier is removed.

    Parameters
    ----------
    folder : Path
        Of the study.
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
    with placed_run(folder, run) as place:
        names, frames = tuple(recording.sensors), len(recording.frames)
        _write_sensors(place, scenario, recording, images, shared or SharedResults())
        write_run_record(RunRecord(place, run.digest, run.index, dict(run.values), dict(metrics), seconds, names, frames))


@contextmanager
def placed_run(folder: Path, run: Run) -> Iterator[Path]:
    """Yield a hidden folder for the files of a run, which takes its place when the body ends; an earlier failure is removed.

    The files must be brought onto the disk by the body.

    Raises
    ------
    FileError
        A file cannot be written, which the body may also tell by OSError.
    """
    runs = folder / RUNS
    with temporary_folder(runs, "run") as hidden:
        place = hidden / "run"
        try:
            place.mkdir()
            yield place
            sync_folder(place)
            os.rename(place, runs / run.digest)
        except OSError as error:
            if not (runs / run.digest / RUN_NAME).is_file():  # else another process was faster
                raise FileError(
                    f"Run {run.index} could not be written to '{runs}' ({os_error_reason(error)}): "
                    "free some space or check the permissions, and give the same command again."
                ) from error
    sync_folder(runs)
    with suppress(OSError):
        (folder / FAILED / f"{run.digest}.txt").unlink(missing_ok=True)


def _write_sensors(place: Path, scenario: Scenario, recording: Recording, images: bool, shared: SharedResults) -> None:
    """Write the files of each sensor and bring them onto the disk."""
    names = folder_names(recording.sensors)
    for sensor in scenario.sensors:
        if not sensor.readout:
            continue
        own = place / names[sensor.name]
        own.mkdir()
        arrays = recording_arrays(replace(recording, sensors={sensor.name: recording.sensors[sensor.name]}))
        files = {
            RECORDING_NAME: _write_recording(own / RECORDING_NAME, arrays),
            SENSOR_NAME: write_synced(own / SENSOR_NAME, shared.of(_sensor_bytes, sensor.texels, sensor.painted)),
        }
        if images:
            pictures = write_run_images(own, sensor, recording)
            files[pictures[-1]] = file_sha256(own / pictures[-1])  # it lists the others
            for name in pictures:
                sync_file(own / name)
        write_synced(own / MANIFEST_NAME, manifest_bytes(manifest_of(scenario, sensor, recording, files)))
        sync_folder(own)


def _write_recording(path: Path, arrays: Mapping[str, np.ndarray]) -> str:
    """Write a recording, bring it onto the disk, and return its SHA-256."""
    if sum(array.nbytes for array in arrays.values()) <= PACKED_BYTES:
        return write_synced(path, pack_arrays(arrays))
    write_arrays(path, arrays, atomic=False)
    sync_file(path)
    return file_sha256(path)


def _sensor_bytes(texels: Texels, painted: Painted) -> bytes:
    return pack_arrays(sensor_arrays(texels, painted))


def write_failure(folder: Path, digest: str, sentence: str, details: str = "") -> None:
    """Write why a run could not be computed; raise :class:`FileError` if that is not possible."""
    text = sentence.rstrip("\n") + "\n" + (f"\n{details.rstrip()}\n" if details else "")
    with atomic_write(folder / FAILED / f"{digest}.txt") as fresh:
        fresh.write_text(text, encoding="utf-8", newline="\n", errors="backslashreplace")
