# SPDX-License-Identifier: GPL-3.0-or-later
"""The tactile images of a bake: a thread writes them, some frames together, while the solver computes the next ones.

A list in each folder has their SHA-256 (:func:`.bake_folder.read_checksums`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from ...core.io.bake_folder import IMAGE_LIST_NAME, checksum_line, frame_file
from ...core.io.file_writing import file_sha256
from ...core.io.tactile_exr import describe, nearest_places, write_exrs
from ...core.model.recording import Frame
from ...core.model.sensor import Sensor

MAX_BATCH_IMAGES, MAX_BATCH_PIXELS = 16, 16384
"""Most images of one sensor that are written together, and most pixels in them: one call for many small images is faster."""
MAX_WAITING_BATCHES = 8
"""Batches that may wait. Each keeps its frames in memory, so that a slow disk has to slow the solver down."""


class BakeImages:
    """The images of all sensors of one bake. Its methods raise OSError and FileError where a file cannot be written.

    Parameters
    ----------
    sensors : mapping of str to Sensor
        By the name of the sensor.
    folders : mapping of str to Path
        Where the images are written, likewise.
    digest : str
        Of the scenario.
    """

    def __init__(self, sensors: Mapping[str, Sensor], folders: Mapping[str, Path], digest: str):
        self._sensors, self._folders, self._digest = sensors, folders, digest
        self._nearest = {
            name: nearest_places(sensor.texels, sensor.channels and sensor.channels.no_frames())
            for name, sensor in sensors.items()
        }
        pixels = max((math.prod(sensor.texels.layout.shape) for sensor in sensors.values()), default=1)
        self._batch = max(1, min(MAX_BATCH_IMAGES, MAX_BATCH_PIXELS // pixels))
        self._frames: list[Frame] = []
        self._thread = ThreadPoolExecutor(1, "palpate-images")
        self._waiting: deque[Future[None]] = deque()

    def write(self, frame: Frame) -> None:
        """Write the images of a frame; while :data:`MAX_WAITING_BATCHES` are waiting, block."""
        self._frames.append(frame)
        if len(self._frames) >= self._batch:
            self._submit(MAX_WAITING_BATCHES)

    def finish(self) -> dict[str, dict[str, str]]:
        """Return, once all images are written, the SHA-256 of the list of each sensor by its name, by the sensor's name."""
        self._submit(0)
        lists = {name: folder / IMAGE_LIST_NAME for name, folder in self._folders.items()}
        return {name: {IMAGE_LIST_NAME: file_sha256(path)} for name, path in lists.items()}

    def stop(self) -> None:
        """Drop the waiting batches and end the thread."""
        self._thread.shutdown(cancel_futures=True)

    def _submit(self, may_wait: int) -> None:
        """Hand the frames so far to the thread, and return when no more batches wait than may."""
        self._waiting.append(self._thread.submit(self._write, self._frames))
        self._frames = []
        while len(self._waiting) > may_wait:
            self._waiting.popleft().result()

    def _write(self, frames: list[Frame]) -> None:
        """Write the images of some frames, and their checksums."""
        names = [frame_file(frame.frame) for frame in frames]
        for name, sensor in self._sensors.items():
            paths = [self._folders[name] / file for file in names]
            headers = [describe(sensor, frame, self._digest) for frame in frames]
            if frames:
                own = [frame.sensors[name] for frame in frames]
                write_exrs(paths, sensor.texels.layout, own, headers, self._nearest[name])
            with (self._folders[name] / IMAGE_LIST_NAME).open("ab") as file:
                file.writelines(checksum_line(path.name, file_sha256(path)) for path in paths)
