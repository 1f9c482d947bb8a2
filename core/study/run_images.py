# SPDX-License-Identifier: GPL-3.0-or-later
"""The tactile images of a run, with the same names, contents and list of checksums as those of a bake."""

from __future__ import annotations

import math
from pathlib import Path

from ..io.bake_folder import IMAGE_LIST_NAME, image_files
from ..io.checksum_list import checksum_line
from ..io.file_writing import file_sha256
from ..io.frame_images import write_frame_images
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
    names, lines = [], []
    numbers = [int(frame) for frame in recording.frames]
    for start in range(0, len(numbers), at_once):
        frames = [recording.at(number) for number in numbers[start : start + at_once]]
        write_frame_images(folder, sensor, frames, recording.digest)
        own = image_files([frame.frame for frame in frames], sensor.channels is not None)
        names += own
        lines += [checksum_line(name, file_sha256(folder / name)) for name in own]
    (folder / IMAGE_LIST_NAME).write_bytes(b"".join(lines))
    return [*names, IMAGE_LIST_NAME]
