# SPDX-License-Identifier: GPL-3.0-or-later
"""The output folder of a study: what is done is known from its files.

::

    study.toml                              the study, with the version and the digests of its scenes
    scenes/<scene>.npz                      the scenes as the solver sees them (scenario_npz)
    runs/<digest>/run.json                  values and metrics of a run
    runs/<digest>/<sensor>/recording.npz    and sensor.npz, as in a bake
    failed/<digest>.txt                     why a run could not be computed: a sentence, and the traceback of a fault

A run is written in a hidden folder, brought onto the disk and renamed, so it is there as a whole or not at all.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import FileError
from ..io.bake_folder import RECORDING_NAME, folder_names
from ..io.file_writing import atomic_write, os_error_reason, sync_file, sync_folder, writable_folder
from ..io.recording_npz import save_recording
from ..io.sensor_npz import SENSOR_NAME, save_sensor
from ..io.temporary_folder import remove_unfinished, temporary_folder
from ..model.recording import Recording
from ..model.scenario import Scenario
from .study_file import Run

RUN_FORMAT = "palpate-run/1"
RUN_NAME, STUDY_NAME = "run.json", "study.toml"
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
    folder: Path, run: Run, scenario: Scenario, recording: Recording, metrics: Mapping[str, float], seconds: float
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

    Raises
    ------
    FileError
        A file cannot be written.
    """
    runs = folder / RUNS
    description = {
        "format": RUN_FORMAT,
        "digest": run.digest,
        "index": run.index,
        "values": dict(run.values),
        "metrics": dict(metrics),
        "seconds": round(seconds, 6),
        "frames": len(recording.frames),
        "sensors": list(recording.sensors),
    }
    with temporary_folder(runs, "run") as hidden:
        try:
            _write_files(hidden / "run", scenario, recording, description)
            os.rename(hidden / "run", runs / run.digest)
        except OSError as error:
            if not (runs / run.digest / RUN_NAME).is_file():  # else another process was faster
                raise FileError(
                    f"Run {run.index} could not be written to '{runs}' ({os_error_reason(error)}): "
                    "free some space or check the permissions, and give the same command again."
                ) from error
    sync_folder(runs)
    with suppress(OSError):
        (folder / FAILED / f"{run.digest}.txt").unlink(missing_ok=True)


def _write_files(place: Path, scenario: Scenario, recording: Recording, description: Mapping[str, Any]) -> None:
    place.mkdir()
    names = folder_names(recording.sensors)
    for sensor in scenario.sensors:
        if not sensor.readout:
            continue
        own = place / names[sensor.name]
        own.mkdir()
        save_recording(own / RECORDING_NAME, _of_one_sensor(recording, sensor.name), atomic=False)
        save_sensor(own / SENSOR_NAME, sensor.texels, sensor.painted, atomic=False)
        for name in (RECORDING_NAME, SENSOR_NAME):
            sync_file(own / name)
        sync_folder(own)
    file = place / RUN_NAME
    file.write_text(json.dumps(description, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8", newline="\n")
    sync_file(file)
    sync_folder(place)


def _of_one_sensor(recording: Recording, name: str) -> Recording:
    from dataclasses import replace

    return replace(recording, sensors={name: recording.sensors[name]})


def write_failure(folder: Path, digest: str, sentence: str, details: str = "") -> None:
    """Write why a run could not be computed; raise :class:`FileError` if that is not possible."""
    text = sentence.rstrip("\n") + "\n" + (f"\n{details.rstrip()}\n" if details else "")
    with atomic_write(folder / FAILED / f"{digest}.txt") as fresh:
        fresh.write_text(text, encoding="utf-8", newline="\n", errors="backslashreplace")


def failure_of(folder: Path, digest: str) -> str:
    """Return the sentence why a run could not be computed; empty when it cannot be read."""
    try:
        return (folder / FAILED / f"{digest}.txt").read_text(encoding="utf-8").partition("\n")[0]
    except OSError:
        return ""
