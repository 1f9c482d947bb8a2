# SPDX-License-Identifier: GPL-3.0-or-later
"""The tactile images of a run, with the same names, contents and list of checksums as those of a bake."""

from __future__ import annotations

import math
from pathlib import Path

from ..io.bake_folder import IMAGE_LIST_NAME, checksum_line, frame_file
from ..io.file_writing import file_sha256
from ..io.tactile_exr import describe, nearest_places, write_exrs
from ..model.recording import Recording
from ..model.sensor import Sensor

MOST_PIXELS = 1 << 20
"""Pixels that are in memory at once; one call for many small images is faster than one for each."""


def write_run_images(folder: Path, sensor: Sensor, recording: Recording) -> list[str]:
    """Write an image for each frame of a sensor, and the list of their SHA-256; return the names of all these files.

    Raises
    ------
    FileError, OSError
        A file cannot be written.
    """
    at_once = max(1, MOST_PIXELS // math.prod(sensor.texels.layout.shape))
    nearest = nearest_places(sensor.texels, recording.sensors[sensor.name].channels)
    names, lines = [], []
    numbers = [int(frame) for frame in recording.frames]
    for start in range(0, len(numbers), at_once):
        frames = [recording.at(number) for number in numbers[start : start + at_once]]
        paths = [folder / frame_file(frame.frame) for frame in frames]
        headers = [describe(sensor, frame, recording.digest) for frame in frames]
        write_exrs(paths, sensor.texels.layout, [frame.sensors[sensor.name] for frame in frames], headers, nearest)
        names += [path.name for path in paths]
        lines += [checksum_line(path.name, file_sha256(path)) for path in paths]
    (folder / IMAGE_LIST_NAME).write_bytes(b"".join(lines))
    return [*names, IMAGE_LIST_NAME]
