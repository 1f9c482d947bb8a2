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
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from ..errors import FileError
from ..io.bake_folder import MANIFEST_NAME, RECORDING_NAME, folder_names, write_manifest
from ..io.file_writing import atomic_write, file_sha256, os_error_reason, sync_file, sync_folder, writable_folder
from ..io.recording_npz import save_recording
from ..io.sensor_manifest import manifest_of
from ..io.sensor_npz import SENSOR_NAME, save_sensor
from ..io.temporary_folder import remove_unfinished, temporary_folder
from ..model.recording import Recording
from ..model.scenario import Scenario
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
) -> None:
    """Write a run as a whole; a failure of it that was written earlier is removed.

    Parameters
    ----------
    folder : Path
        Of the study.
    run : Run
    scenario : Scenario
        That was computed.
    recording : Recording
    metrics : mapping of str to float
    seconds : float
        That computing took.
    images : bool
        Whether each frame of each sensor also gets a tactile image.

    Raises
    ------
    FileError
        A file cannot be written.
    """
    runs = folder / RUNS
    with temporary_folder(runs, "run") as hidden:
        place = hidden / "run"
        record = RunRecord(
            place,
            run.digest,
            run.index,
            dict(run.values),
            dict(metrics),
            seconds,
            tuple(recording.sensors),
            len(recording.frames),
        )
        try:
            place.mkdir()
            _write_sensors(place, scenario, recording, images)
            write_run_record(record)
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


def _write_sensors(place: Path, scenario: Scenario, recording: Recording, images: bool) -> None:
    """Write the files of each sensor and bring them onto the disk."""
    names = folder_names(recording.sensors)
    for sensor in scenario.sensors:
        if not sensor.readout:
            continue
        own = place / names[sensor.name]
        own.mkdir()
        save_recording(own / RECORDING_NAME, replace(recording, sensors={sensor.name: recording.sensors[sensor.name]}), False)
        save_sensor(own / SENSOR_NAME, sensor.texels, sensor.painted, atomic=False)
        pictures = write_run_images(own, sensor, recording) if images else []
        written = (RECORDING_NAME, SENSOR_NAME, *pictures[-1:])  # the last one lists the others
        files = {name: file_sha256(own / name) for name in written}
        write_manifest(own, manifest_of(scenario, sensor, recording, files), atomic=False)
        for name in (RECORDING_NAME, SENSOR_NAME, MANIFEST_NAME, *pictures):
            sync_file(own / name)
        sync_folder(own)


def write_failure(folder: Path, digest: str, sentence: str, details: str = "") -> None:
    """Write why a run could not be computed; raise :class:`FileError` if that is not possible."""
    text = sentence.rstrip("\n") + "\n" + (f"\n{details.rstrip()}\n" if details else "")
    with atomic_write(folder / FAILED / f"{digest}.txt") as fresh:
        fresh.write_text(text, encoding="utf-8", newline="\n", errors="backslashreplace")
