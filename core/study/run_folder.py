# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a run that has a folder: for each sensor those of a bake, with images on request."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from ..io.bake_folder import (
    IMAGE_LIST_NAME,
    RECORDING_NAME,
    checksum_line,
    folder_names,
    frame_file,
    manifest_of,
    write_manifest,
)
from ..io.file_writing import file_sha256
from ..io.recording_npz import save_recording
from ..io.sensor_npz import SENSOR_NAME, save_sensor
from ..io.tactile_exr import describe, nearest_places, write_exrs
from ..model.recording import Recording
from ..model.scenario import Scenario
from ..model.sensor import Sensor

MOST_PIXELS = 1 << 20
"""Pixels that are in memory at once; one call for many small images is faster than one for each."""


def write_run_folder(folder: Path, scenario: Scenario, recording: Recording, images: bool) -> None:
    """Write a folder for each sensor into the folder of a run.

    Parameters
    ----------
    folder : Path
    scenario : Scenario
        That was computed.
    recording : Recording
    images : bool
        True for a tactile image of each frame.

    Raises
    ------
    FileError, OSError
        A file cannot be written.
    """
    names = folder_names(recording.sensors)
    for sensor in scenario.sensors:
        if not sensor.readout:
            continue
        own = folder / names[sensor.name]
        own.mkdir()
        alone = replace(recording, sensors={sensor.name: recording.sensors[sensor.name]})
        save_recording(own / RECORDING_NAME, alone, atomic=False)
        save_sensor(own / SENSOR_NAME, sensor.texels, sensor.painted, atomic=False)
        files = [RECORDING_NAME, SENSOR_NAME]
        if images:
            _write_images(own, sensor, recording)
            files.append(IMAGE_LIST_NAME)  # it lists the images
        digests = {name: file_sha256(own / name) for name in files}
        write_manifest(own, manifest_of(scenario, sensor, recording, digests))


def _write_images(folder: Path, sensor: Sensor, recording: Recording) -> None:
    """Write an image for each frame of a sensor, and the list of their SHA-256."""
    at_once = max(1, MOST_PIXELS // math.prod(sensor.texels.layout.shape))
    nearest = nearest_places(sensor.texels, recording.sensors[sensor.name].channels)
    lines = []
    numbers = [int(frame) for frame in recording.frames]
    for start in range(0, len(numbers), at_once):
        frames = [recording.at(number) for number in numbers[start : start + at_once]]
        paths = [folder / frame_file(frame.frame) for frame in frames]
        headers = [describe(sensor, frame, recording.digest) for frame in frames]
        write_exrs(paths, sensor.texels.layout, [frame.sensors[sensor.name] for frame in frames], headers, nearest)
        lines += [checksum_line(path.name, file_sha256(path)) for path in paths]
    (folder / IMAGE_LIST_NAME).write_bytes(b"".join(lines))
